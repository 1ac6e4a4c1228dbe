"""From what one degree more changes to an error bar, and to the value that the degrees tend to.

With s = F_p - F_{p+1} (:mod:`pipeline.solve.enrich`), and an error that falls like p⁻², as it does at an edge where
u ~ r^½ (I. Babuška and M. Suri, SIAM J. Numer. Anal. 24, 750, 1987), what degree p + 1 leaves is θ s with
θ = p² / (2 p + 1). On meshes with quarter-point elements at the edge it is less, on naive ones sometimes more: the
multiples of θ s below are measured, with the coverage that they reach, in docs/accuracy.md.

A probe that moves in several ways has a stiffness matrix K, and S = K_p - K_{p+1}. What the scalars above say of each
motion they say of every sum of motions, by its own energy: the error that is left is a symmetric form that lies, for
every movement c, within ± c'Bc, where B grows with the energy of the error. By polarisation its entries are at most
(B_ii B_jj)^½: energies of motions bound the diagonal, and those of sums of motions the rest.
"""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

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


def stiffness_bars(stiffness: FloatArray, relative: FloatArray, *, apart: bool = False) -> FloatArray:
    """Return the 95 % bars on the entries of a stiffness (n, n), from the ``relative`` ones on its diagonal (n).

    The entries between motions that symmetry keeps ``apart`` are zero, and known to be.
    """
    root = np.sqrt(np.abs(relative * np.diag(stiffness)))
    return np.diag(root**2) if apart else np.outer(root, root)


def extrapolate_stiffness(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, degree: int, element: str
) -> tuple[FloatArray, FloatArray]:
    """Return the stiffness (n, n) that the degrees tend to on a mesh graded to the edge, and the bars on its entries.

    ``decrements`` is K_p - K_{p+1}. The new bars are the same share of ``bars``, those on K_p, for every entry.
    """
    (centre, spread), theta = _LIMITS[element], _theta(degree)
    return stiffness - (1 + centre * theta) * decrements, bars * spread * theta / (1 + _BAR * theta)
