"""Ogden's law: Σ 2μ sₖ/αₖ² (λ̄₁^αₖ + λ̄₂^αₖ + λ̄₃^αₖ − 3), with shares sₖ of μ and principal stretches λ̄ᵢ of the shape.

R. W. Ogden, Proc. R. Soc. A 326, 1972. Terms that are not given have the share 0.

The squares of λ̄ᵢ are q + 2p cos(φ + 2πi/3), q = Ī₁/3, the roots of the characteristic polynomial. Their derivatives
are infinite where two of them are equal, though those of the sum are not: it is a smooth function of p² and p³ cos 3φ.
p² + δ² in place of p², and a slightly smaller cos 3φ, keep all derivatives finite, and change stresses by 1e-8.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl

from epsmesh.solve.laws.law import Law, Of, Shape

TERMS = 3
_DELTA, _WITHIN = 3e-5, 1 - 1e-8
# The squares at rest.
_REST = (1 + 3**0.5 * _DELTA, 1.0, 1 - 3**0.5 * _DELTA)


def _shape(shape: Shape, of: Of) -> Any:
    squares = _roots(shape)
    terms = ((of[f"share{term}"], of[f"alpha{term}"]) for term in range(1, TERMS + 1))
    return sum(
        2 * of["lame_mu"] * share / alpha**2 * (_powers(squares, alpha / 2) - _powers(_REST, alpha / 2))
        for share, alpha in terms
    )


def _powers(squares: Sequence[Any], exponent: Any) -> Any:
    return sum(square**exponent for square in squares)


def _roots(shape: Shape) -> list[Any]:
    """Return the roots of x³ − Ī₁ x² + Ī₂ x − 1.

    The parts are q, p² and p³ cos 3φ: by Ī₁ and Ī₂, second derivatives near rest would be differences of large numbers.
    """
    gradient, volume = shape.gradient, ufl.det(shape.gradient)
    cofactor = ufl.cofac(gradient)
    first = volume ** (-2 / 3) * ufl.inner(gradient, gradient)
    second = volume ** (-4 / 3) * ufl.inner(cofactor, cofactor)
    middle = shape.part(first / 3)
    size = ufl.sqrt(shape.part((first**2 - 3 * second) / 9) + _DELTA**2)
    angle = ufl.acos(_WITHIN * shape.part((2 * first**3 - 9 * first * second + 27) / 54) / size**3) / 3
    return [middle + 2 * size * ufl.cos(angle + 2 * np.pi * number / 3) for number in range(3)]


LAW = Law(_shape, tuple(f"{name}{term}" for term in range(1, TERMS + 1) for name in ("share", "alpha")))
