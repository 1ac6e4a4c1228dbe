"""From what one degree more changes to an error bar, and to the value that the degrees tend to.

With s = F_p - F_{p+1} (:mod:`pipeline.solve.enrich`), and an error that falls like p⁻², as it does at an edge where
u ~ r^½ (I. Babuška and M. Suri, SIAM J. Numer. Anal. 24, 750, 1987), what degree p + 1 leaves is θ s with
θ = p² / (2 p + 1). On meshes with quarter-point elements at the edge it is less, on naive ones sometimes more: the
multiples of θ s below are measured, with the coverage that they reach, in docs/accuracy.md.
"""

# F_p is too high by between s and s (1 + _BAR θ) in more than 95 % of all cases.
_BAR = 1.25
# On meshes graded to the edge F is at F_{p+1} - (centre ± spread) θ s.
_LIMITS = {"displacement": (0.4, 0.25), "mixed": (0.5, 0.35)}


def _theta(degree: int) -> float:
    return degree**2 / (2 * degree + 1)


def error_bar(decrement: float, degree: int) -> float:
    """Return the relative 95 % bar on F_p, given s / F_p."""
    return abs(decrement) * (1 + _BAR * _theta(degree))


def extrapolate(decrement: float, bar: float, degree: int, element: str) -> tuple[float, float]:
    """Return what to multiply F_p with, given s / F_p on a mesh graded to the edge, and the bar on the product.

    The new bar is the same share of ``bar``, that on F_p, whatever that was made of.
    """
    (centre, spread), theta = _LIMITS[element], _theta(degree)
    factor = 1 - decrement * (1 + centre * theta)
    return factor, bar * spread * theta / (1 + _BAR * theta) / factor
