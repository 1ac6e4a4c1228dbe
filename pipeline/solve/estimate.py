"""Error bars, and the value that the degrees tend to, from what one degree more changes.

With s = (F_p - F_{p+1}) / F_p (:mod:`pipeline.solve.hierarchical_estimate`), and an error that falls like p⁻², as at an
edge where u ~ r^½ (I. Babuška and M. Suri, SIAM J. Numer. Anal. 24, 750, 1987), degree p + 1 leaves θ s with
θ = p² / (2 p + 1), less with quarter points at the probe's edge, more without (:mod:`pipeline.solve.cell_values`). The
multiples below are measured, and their coverage is in docs/accuracy.md.

Shares are of F_p. Bars are relative to the exact force, too: where F_p is a third too high, F_exact is 25 % below it,
but F_p errs by 33 %.

With several motions, K is a matrix and S = K_p - K_{p+1}. The rules above hold for every sum of motions, by its own
energy: the error is a symmetric form within ± c'Bc for every movement c. By polarisation the entries of B are at most
(B_ii B_jj)^½.
"""

import numpy as np

from pipeline.arrays import FloatArray

# What degree p + 1 leaves, at most, in units of θ s: with quarter points, without, and for straight elements.
_LEFT = {"displacement": 1.0, "mixed": 1.25}
_LEFT_PLAIN, _LEFT_STRAIGHT = 1.75, 1.5
# What N, the energy norm squared of the first correction, leaves to a mixed element whose s may vanish by chance.
_UNSEEN, _UNSEEN_PLAIN = 0.3, 0.8
# From this share of edges without quarter points on, a mesh counts as one that has none.
_PLAIN = 0.2
# A larger share of F_p than this makes no larger bar: the force is not known.
_MOST = 0.9
# F is at F_{p+1} - (centre ± spread) θ s on meshes graded to the edge, by element and degree; of several movements of
# mixed elements; on other meshes, and without quarter points.
_LIMITS = {
    ("displacement", 2): (0.4, 0.25),
    ("displacement", 3): (0.4, 0.25),
    ("mixed", 2): (0.38, 0.3),
    ("mixed", 3): (0.58, 0.34),
}
_LIMITS_SEVERAL = (0.5, 0.35)
# Or, of mixed elements, at ± so many θ (N - |s|) from there, if that is more: s is then what two errors leave of each
# other, and N knows of both.
_APART = {2: 0.3, 3: 0.15}
_LIMITS_COARSE, _LIMITS_PLAIN = (0.4, 1.0), (0.85, 0.85)
# Where materials meet, a surface is curved, or the body is a plate, part of the error is from there: the next degree
# takes another share.
_LIMITS_ELSEWHERE = {"displacement": (0.4, 0.4), "mixed": (0.5, 0.9)}
# The energy that a slit's front releases is at that of degree p + 1, less (centre ± spread) θ times what that changed.
_RELEASE = (0.45, 0.9)
# Found contact: |F_2 - F_exact| in units of what degree 3 takes away, and of N; and what is left, in bars, once F_2 is
# corrected by half of it: on meshes graded to where contact is expected to end, of plain bodies and of others, and on
# meshes that are not.
_FOUND, _FOUND_UNSEEN, _FOUND_OF_AREA = 1.6, 1.4, 1.5
_FOUND_SPREAD, _FOUND_SPREAD_ELSEWHERE, _FOUND_SPREAD_COARSE = 0.4, 0.5, 0.8
# And where contact is found again: |F_p - F_exact| in units of what one degree more changes, and of the area's bar.
_FOUND_AGAIN, _FOUND_AT_EDGE = 2.0, 0.1
# Graded to the edge: the coarsest that was measured, relative to the probe's half width, and the growth from there.
_GRADED = (0.4, 0.7)


def is_graded(rim: float, growth: float) -> bool:
    """Tell whether a mesh is graded to the probe's edge; ``rim`` in units of the probe's half width."""
    return rim <= _GRADED[0] and growth <= _GRADED[1]


def error_bar(
    decrement: float, degree: int, element: str = "displacement", *, plain: float = 0.0, unseen: float = 0.0
) -> float:
    """Return the 95 % bar on F_p, relative to F_p and to F_exact alike.

    ``decrement`` is s, ``plain`` the share of edges at the rim without quarter points, ``unseen`` is N / (F_p d) of a
    mixed element.
    """
    seen = abs(decrement) * (1 + _left(degree, element, plain) * _theta(degree))
    share = max(seen, _between(_UNSEEN, _UNSEEN_PLAIN, plain) * unseen)
    return share / (1 - min(share, _MOST))


def stiffness_bars(stiffness: FloatArray, relative: FloatArray, *, apart: bool = False) -> FloatArray:
    """Return the 95 % bars on the entries of a stiffness (n, n), from the ``relative`` ones on its diagonal (n).

    The entries between motions that symmetry keeps ``apart`` are zero, and known to be.
    """
    root = np.sqrt(np.abs(relative * np.diag(stiffness)))
    return np.diag(root**2) if apart else np.outer(root, root)


def extrapolate(
    stiffness: FloatArray,
    decrements: FloatArray,
    bars: FloatArray,
    degree: int,
    element: str,
    *,
    plain: float = 0.0,
    graded: bool = True,
    elsewhere: bool = False,
    unseen: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the stiffness (n, n) that the degrees tend to, and the bars on its entries.

    ``decrements`` is K_p - K_{p+1}, ``bars`` those on K_p: of each, the same share of F_p is left, or more where
    ``unseen`` (n), N of a mixed element in units of the stiffnesses on the diagonal, asks for it. ``elsewhere`` tells
    that the probe's edge may not be all that F errs by.
    """
    theta = _theta(degree)
    centre, spread = _limits(
        degree, element, plain=plain, graded=graded, elsewhere=elsewhere, several=len(stiffness) > 1
    )
    relative = np.diag(bars) / np.abs(np.diag(stiffness))
    share = 1 / np.sqrt(1 + relative)
    left = bars * np.outer(share, share) * spread * theta / (1 + _left(degree, element, plain) * theta)
    if unseen is not None and not elsewhere and plain < _PLAIN:
        scale = np.abs(np.diag(stiffness))
        least = _APART[degree] * theta * (unseen - np.abs(np.diag(decrements)) / scale) * scale
        found = np.diag(left)
        wider = np.sqrt(np.maximum(1.0, np.divide(least, found, out=np.ones_like(found), where=found > 0)))
        left = left * np.outer(wider, wider)
    return stiffness - (1 + centre * theta) * decrements, left


def _limits(
    degree: int, element: str, *, plain: float, graded: bool, elsewhere: bool, several: bool
) -> tuple[float, float]:
    """Return centre and spread of what degree p + 1 leaves, in units of θ s."""
    if plain >= _PLAIN:
        return _LIMITS_PLAIN
    if not graded:
        return _LIMITS_COARSE
    if elsewhere:
        return _LIMITS_ELSEWHERE[element]
    return _LIMITS_SEVERAL if several and element == "mixed" else _LIMITS[element, degree]


def release_bar(released: float, finer: float, degree: int, *, extrapolated: bool = False) -> float:
    """Return the 95 % bar (J/m) on what a slit's front releases, or on what the degrees tend to.

    ``finer`` is what one degree more makes of it. The relative bar on the energy, of which it is a derivative, is to
    be added.
    """
    return abs(released - finer) * (_RELEASE[1] * _theta(degree) if extrapolated else 1 + _theta(degree))


def extrapolate_release(released: FloatArray, finer: FloatArray, degree: int) -> FloatArray:
    """Return what the degrees tend to of what a slit's front releases."""
    return released - (1 + _RELEASE[0] * _theta(degree)) * (released - finer)


def found_bar(decrement: float, unseen: float = 0.0, area_bar: float = 0.0) -> float:
    """Return the 95 % bar on F_p, relative, where contact is found, and pressure falls to nought at its edge.

    ``decrement`` is the share of the energy that one degree more takes away while that area is held, ``unseen``
    N / (2 U) of a mixed element. F is stationary in the area: the square of ``area_bar`` is what the decrement, which
    may be small by chance, does not know of.
    """
    share = max(_FOUND * abs(decrement), _FOUND_UNSEEN * unseen, _FOUND_OF_AREA * area_bar**2)
    return share / (1 - min(share, _MOST))


def found_again_bar(share: float, area_bar: float) -> tuple[float, float]:
    """Return a decrement and the 95 % bar on F_p, relative, from the ``share`` that one degree more takes away of F.

    That is with contact found again; as it may vanish by chance, the bar is never below a share of that on the area.
    """
    bar = max(_FOUND_AGAIN * abs(share), _FOUND_AT_EDGE * area_bar)
    return 2 * share / _FOUND, bar / (1 - min(bar, _MOST))


def extrapolate_found(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, *, graded: bool = True, elsewhere: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return what F / d (1, 1) of found contact tends to, and the bar on it: F_2 is too large by half a bar or so.

    ``graded`` tells that the mesh is, to where contact is expected to end, ``elsewhere`` that this may not be all that
    F errs by.
    """
    spread = _FOUND_SPREAD_ELSEWHERE if elsewhere else _FOUND_SPREAD
    return stiffness - _FOUND / 2 * decrements, (spread if graded else _FOUND_SPREAD_COARSE) * bars


def _theta(degree: int) -> float:
    return degree**2 / (2 * degree + 1)


def _left(degree: int, element: str, plain: float) -> float:
    return _LEFT_STRAIGHT if degree == 1 else _between(_LEFT[element], _LEFT_PLAIN, plain)


def _between(best: float, worst: float, plain: float) -> float:
    return best + (worst - best) * min(1.0, plain / _PLAIN)
