"""Mooney–Rivlin law: C₁ (Ī₁ − 3) + C₂ (Ī₂ − 3), μ = 2 (C₁ + C₂), c₂ = C₂ / (C₁ + C₂).

M. Mooney, J. Appl. Phys. 11, 1940; R. S. Rivlin, Phil. Trans. R. Soc. A 241, 1948.
"""

from typing import Any

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    share = of["c2"]
    return of["lame_mu"] / 2 * ((1 - share) * (shape.first - 3) + share * (shape.second - 3))


LAW = Law(_shape, ("c2",))
