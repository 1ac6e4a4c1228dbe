"""Compressible neo-Hookean law: μ/2 (F : F − 3) − μ ln J + λ/2 (J − 1)².

It is polyconvex (J. M. Ball, Arch. Rational Mech. Anal. 63, 1977), and infinite at J = 0.
"""

from typing import Any

import ufl

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    gradient, mu = shape.gradient, of["lame_mu"]
    return mu / 2 * (ufl.inner(gradient, gradient) - 3) - mu * ufl.ln(ufl.det(gradient))


LAW = Law(_shape, modulus=lambda of: of["lame_lambda"], dilation=lambda shape: ufl.det(shape.gradient) - 1)
