"""Veronda and Westmann's law: C₁ (exp(α (Ī₁ − 3)) − 1) − α C₁/2 (Ī₂ − 3), μ = α C₁; α is the parameter ``alpha``.

D. R. Veronda and R. A. Westmann, J. Biomech. 3, 1970.
"""

from typing import Any

import ufl

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    alpha = of["alpha"]
    stiffening = (ufl.exp(alpha * (shape.first - 3)) - 1) / alpha
    return of["lame_mu"] * (stiffening - (shape.second - 3) / 2)


LAW = Law(_shape, ("alpha",))
