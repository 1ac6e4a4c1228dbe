"""Mooney–Rivlin law: C₁ (Ī₁ − 3) + C₂ (Ī₂ − 3), μ = 2 (C₁ + C₂), c₂ = C₂ / (C₁ + C₂).

M. Mooney, J. Appl. Phys. 11, 1940; R. S. Rivlin, Phil. Trans. R. Soc. A 241, 1948.
"""

from typing import Any

from pipeline.solve.laws.law import Law, Of, isochoric, second_isochoric


def _shape(gradient: Any, of: Of) -> Any:
    volume, first = isochoric(gradient)
    share = of["c2"]
    return of["lame_mu"] / 2 * ((1 - share) * (first - 3) + share * (second_isochoric(gradient, volume) - 3))


LAW = Law(_shape, ("c2",))
