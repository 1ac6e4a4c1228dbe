"""Gent's law: −μ J_m/2 ln(1 − (Ī₁ − 3)/J_m), infinite at Ī₁ = 3 + J_m; J_m is the parameter ``limit``.

A. N. Gent, Rubber Chem. Technol. 69, 1996.
"""

from typing import Any

import ufl

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    return -of["lame_mu"] / 2 * of["limit"] * ufl.ln(1 - (shape.first - 3) / of["limit"])


LAW = Law(_shape, ("limit",))
