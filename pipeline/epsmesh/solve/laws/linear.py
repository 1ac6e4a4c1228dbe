"""Linear elasticity: λ/2 (tr ε)² + μ ε : ε, ε the symmetric part of F − I."""

from typing import Any

import ufl

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    strain = ufl.sym(shape.gradient) - ufl.Identity(shape.gradient.ufl_shape[0])
    return of["lame_mu"] * ufl.inner(strain, strain)


LAW = Law(_shape, modulus=lambda of: of["lame_lambda"], dilation=lambda shape: ufl.tr(shape.gradient) - 3)
