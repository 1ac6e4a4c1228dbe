"""Yeoh's law: C₁ x + C₂ x² + C₃ x³, x = Ī₁ − 3, with μ = 2 C₁, c₂ = C₂/C₁ and c₃ = C₃/C₁.

O. H. Yeoh, Rubber Chem. Technol. 66, 1993.
"""

from typing import Any

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    x = shape.first - 3
    return of["lame_mu"] / 2 * x * (1 + x * (of["c2"] + of["c3"] * x))


LAW = Law(_shape, ("c2", "c3"))
