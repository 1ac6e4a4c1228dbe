"""Error bars, and the limit of the sequence of degrees, from the change in one degree more.

With s = (F_p - F_{p+1}) / F_p (:mod:`epsmesh.solve.hierarchical_estimate`) and an error that falls like p⁻², as at an
edge where u ~ r^½ (I. Babuška and M. Suri, SIAM J. Numer. Anal. 24, 750, 1987), degree p + 1 leaves an error θ s with
θ = p² / (2 p + 1). With quarter points at the probe's edge it leaves less, without them more
(:mod:`epsmesh.solve.cell_values`). The multiples below are measured; benchmarks/results/coverage.md has their coverage.

Shares are relative to F_p. Bars are valid relative to the exact force, too: where F_p is a third too high, F_exact is
25 % below it, but F_p errs by 33 %.

With several motions, K is a matrix and S = K_p - K_{p+1}. The rules above apply to every sum of motions, with its own
energy: the error is a symmetric form within ± c'Bc for every movement c. By polarisation the entries of B are at most
(B_ii B_jj)^½.
"""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.convergence import Convergence

# Largest error that degree p + 1 leaves, in units of θ s: with quarter points, without, and for straight elements.
_LEFT = {"displacement": 1.0, "mixed": 1.25}
_LEFT_PLAIN, _LEFT_STRAIGHT = 1.75, 1.5
# Error of a mixed element in units of N, the squared energy norm of the first correction: s alone may vanish by chance.
_UNSEEN, _UNSEEN_PLAIN = 0.3, 0.8
# A mesh counts as one without quarter points from this share of edges without them.
_PLAIN = 0.2
# Largest decrement, as a share of F_p, that enters a bar: above it the force is not known.
_MOST = 0.9
# The limit of F is F_{p+1} - (centre ± spread) θ s on meshes graded to the edge, by element and degree. Further values:
# mixed elements with several motions, other meshes, and meshes without quarter points.
_LIMITS = {
    ("displacement", 2): (0.4, 0.25),
    ("displacement", 3): (0.4, 0.25),
    ("mixed", 2): (0.38, 0.3),
    ("mixed", 3): (0.58, 0.34),
}
_LIMITS_SEVERAL = (0.5, 0.35)
# The same for one motion of a disc on a plain body, with small elements at the edge: (e/s - 1)/θ was 0.20 to 0.48 for
# displacement elements, and 0.16 to 0.58 for mixed ones where N < 2.3 s. Below blades it was up to 0.54 and 0.63.
_LIMITS_FINE = {("displacement", 2): (0.345, 0.17), ("mixed", 2): (0.37, 0.24)}
# For mixed elements the spread is at least this many θ (N - |s|), by degree. Two errors of opposite sign may cancel in
# s, while N contains both. Where limits are those of small elements, N counts from 1.3 |s| on.
_APART, _APART_FINE = {2: 0.3, 3: 0.15}, 1.3
_LIMITS_COARSE, _LIMITS_PLAIN = (0.4, 1.0), (0.85, 0.85)
# The same at large displacements, where contact is bonded and one degree more was solved:
# benchmarks/results/deep_contact.md.
_LIMITS_SOLVED = (0.9, 0.6)
# Interfaces between materials, curved surfaces and thin plates add errors. The next degree removes another share of
# these errors than of those at the probe's edge.
_LIMITS_ELSEWHERE = {"displacement": (0.4, 0.4), "mixed": (0.5, 0.9)}
# At large displacements s is too large, the more so the deeper, and where the law stiffens: the limit is then above
# F_{p+1}, by at most so many θ s (e/s was 0.36 to 1.32 in 60 cases). The other end is that of linear elasticity.
_LEAST_LARGE = -0.95
# Energy release of a slit's front: the limit is that of degree p + 1, less (centre ± spread) θ times its last change.
_RELEASE = (0.45, 0.9)
# Unilateral contact: |F_2 - F_exact| in units of the decrement of degree 3, of N, and of the squared bar on the area.
_FOUND, _FOUND_UNSEEN, _FOUND_OF_AREA = 1.6, 1.4, 1.5
# The limit of F is F_p - (centre ± spread) bars on meshes graded to the expected edge of contact, by element and
# degree. With degree 3 the decrement says little, since most of the error is that of the area. Then the values for
# balls with degree 2, for meshes that are not graded, by degree, and for contact that the tool's own edge ends; the
# factor on the spread for bodies that are not plain.
_FOUND_LIMITS = {
    ("displacement", 2): (0.25, 0.45),
    ("mixed", 2): (0.42, 0.42),
    ("displacement", 3): (0.0, 0.5),
    ("mixed", 3): (0.2, 0.6),
}
_FOUND_BALL = {("displacement", 2): (0.45, 0.29), ("mixed", 2): (0.56, 0.32)}
_FOUND_COARSE = {2: (0.27, 0.85), 3: (0.0, 1.0)}
_FOUND_ENDED, _FOUND_ELSEWHERE = (0.43, 0.4), 1.25
# The same where contact is solved again: in units of the change in one degree more, and of the area's bar.
_FOUND_AGAIN, _FOUND_AT_EDGE = 2.0, 0.1
# The same at large displacements, for the area's bar, by degree: benchmarks/results/deep_contact.md.
AT_EDGE_LARGE = {2: 0.15, 3: 0.075}
# The same for the share of the contact in facets at sharp ends of the tool, in all degrees: nodes at an end slide off
# it, so that F lacks a part of that strip, of which one degree more sees little. Errors against meshes four times
# finer, which lack a quarter as much, were up to 0.19 of it.
_FOUND_AT_SHARP_END = 0.3
# The limit of F there, for balls on plain bodies in degree 2: F_2 - (centre ± spread) (F_2 - F_3). The bar is at least
# a share of the area's bar, which covers what the contact's edge adds by chance.
_FOUND_LARGE, _FOUND_LARGE_AT_EDGE, _FOUND_LARGE_DEGREE = (1.08, 0.35), 0.12, 2
# Limits of a mesh that counts as graded to the edge: rim size relative to the probe's half width, and growth; then
# those where the width of contact is found, at small and at large displacements.
_GRADED, _GRADED_FOUND = (0.4, 0.7), (0.26, 0.41)
_GRADED_LARGE = (0.61, 0.81)
# The same for balls with displacement elements of degree 2, whose limit is known on larger elements, too.
_GRADED_BALL = (0.41, 0.61)
# The same for small elements, below those of the coarsest recipe.
_FINE = (0.31, 0.61)


def is_graded(rim: float, growth: float, *, found: bool = False, large: bool = False, sure: bool = False) -> bool:
    """Return whether a mesh is graded to the edge; ``rim`` in units of the half width, of contact if ``found``.

    ``large`` is for unilateral contact at large displacements, ``sure`` where its limit is known on large elements,
    too.
    """
    of_found = _GRADED_LARGE if large else _GRADED_BALL if sure else _GRADED_FOUND
    largest, steepest = of_found if found else _GRADED
    return rim <= largest and growth <= steepest


def is_plain(share: float) -> bool:
    """Return whether a mesh counts as one without quarter points, from the share of edges at the rim without them."""
    return share >= _PLAIN


def is_fine(rim: float, growth: float) -> bool:
    """Return whether elements at the edge are small; ``rim`` in units of the probe's half width."""
    return rim <= _FINE[0] and growth <= _FINE[1]


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


def stiffness_bars(stiffness: FloatArray, relative: FloatArray, *, decoupled: bool = False) -> FloatArray:
    """Return the 95 % bars on the entries of a stiffness (n, n), from the ``relative`` ones on its diagonal (n).

    With ``decoupled``, symmetry makes the entries between motions exactly zero: their bars are zero.
    """
    root = np.sqrt(np.abs(relative * np.diag(stiffness)))
    return np.diag(root**2) if decoupled else np.outer(root, root)


def extrapolate(
    stiffness: FloatArray,
    decrements: FloatArray,
    bars: FloatArray,
    known: Convergence,
    unseen: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the limit of the stiffness (n, n) in the sequence of degrees, and the bars on its entries.

    ``decrements`` is K_p - K_{p+1}, ``bars`` are those on K_p. All entries get the same relative correction. The bar is
    wider where ``unseen`` (n), N of a mixed element in units of the diagonal stiffnesses, demands it.
    """
    theta, is_one = _theta(known.degree), len(stiffness) == 1
    is_fine = known.is_fine and is_one and not known.is_nonlinear and not is_plain(known.plain)
    is_fine = is_fine and (known.element, known.degree) in _LIMITS_FINE
    centre, spread = _LIMITS_FINE[known.element, known.degree] if is_fine else _limits(known, several=not is_one)
    if known.is_nonlinear and known.is_solved and known.degree > 1:
        centre, spread = _LIMITS_SOLVED
    elif known.is_nonlinear:
        most = centre + spread
        least = min(_LEAST_LARGE, centre - spread)
        centre, spread = (most + least) / 2, (most - least) / 2
    relative = np.diag(bars) / np.abs(np.diag(stiffness))
    share = 1 / np.sqrt(1 + relative)
    covered = 1 + _left(known.degree, known.element, known.plain) * theta
    left = bars * np.outer(share, share) * spread * theta / covered
    if unseen is not None and not known.has_others and not is_plain(known.plain):
        scale = np.abs(np.diag(stiffness))
        seen = np.abs(np.diag(decrements)) / scale * (_APART_FINE if is_fine else 1.0)
        least = _APART[known.degree] * theta * (unseen - seen) * scale
        found = np.diag(left)
        wider = np.sqrt(np.maximum(1.0, np.divide(least, found, out=np.ones_like(found), where=found > 0)))
        left = left * np.outer(wider, wider)
    return stiffness - (1 + centre * theta) * decrements, left


def _limits(known: Convergence, *, several: bool) -> tuple[float, float]:
    """Return centre and spread of the error that degree p + 1 leaves, in units of θ s, of one motion or ``several``."""
    if is_plain(known.plain):
        return _LIMITS_PLAIN
    if not known.is_graded:
        return _LIMITS_COARSE
    if known.has_others:
        return _LIMITS_ELSEWHERE[known.element]
    return _LIMITS_SEVERAL if several and known.element == "mixed" else _LIMITS[known.element, known.degree]


def release_bar(released: float, finer: float, degree: int, *, extrapolated: bool = False) -> float:
    """Return the 95 % bar (J/m) on the energy ``released`` by a slit's front, or on its extrapolated limit.

    ``finer`` is its value in one degree more. The caller adds the relative bar on the energy, of which the release is a
    derivative.
    """
    return abs(released - finer) * (_RELEASE[1] * _theta(degree) if extrapolated else 1 + _theta(degree))


def extrapolate_release(released: FloatArray, finer: FloatArray, degree: int) -> FloatArray:
    """Return the limit of the energy released by a slit's front in the sequence of degrees."""
    return released - (1 + _RELEASE[0] * _theta(degree)) * (released - finer)


def found_bar(decrement: float, unseen: float = 0.0, area_bar: float = 0.0) -> float:
    """Return the relative 95 % bar on F_p for unilateral contact, whose pressure falls to zero at the edge.

    ``decrement`` is the share of the energy that one degree more removes with the area fixed, ``unseen`` N / (2 U) of a
    mixed element. F is stationary with respect to the area: the square of ``area_bar`` covers what the decrement
    misses, which may be small by chance.
    """
    share = max(_FOUND * abs(decrement), _FOUND_UNSEEN * unseen, _FOUND_OF_AREA * area_bar**2)
    return share / (1 - min(share, _MOST))


def found_again_bar(
    share: float, area_bar: float, at_edge: float = _FOUND_AT_EDGE, *, at_end: float = 0.0
) -> tuple[float, float]:
    """Return a decrement and the relative 95 % bar on F_p, from the ``share`` of F that one degree more removes.

    Contact is solved again in that degree. The share may vanish by chance, so the bar is at least a fraction
    ``at_edge`` of ``area_bar``. ``at_end`` is the share of the contact in facets at sharp ends of the tool.
    """
    bar = max(_FOUND_AGAIN * abs(share), at_edge * area_bar, _FOUND_AT_SHARP_END * at_end)
    return 2 * share / _FOUND, bar / (1 - min(bar, _MOST))


def extrapolate_found(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, known: Convergence
) -> tuple[FloatArray, FloatArray]:
    """Return the limit of F / d (1, 1) of unilateral contact, and its bar.

    The middle of its known error is subtracted from F; where one degree more raises F, F and its bar stay. At large
    displacements the limit is known for balls only.
    """
    if known.is_nonlinear:
        return _extrapolate_found_large(stiffness, decrements, bars, known)
    which = known.element, known.degree
    centre, spread = _FOUND_BALL[which] if known.is_ball and which in _FOUND_BALL else _FOUND_LIMITS[which]
    if not known.is_graded or known.is_ended:
        centre, spread = _FOUND_ENDED if known.is_graded else _FOUND_COARSE[known.degree]
    spread *= _FOUND_ELSEWHERE if known.has_others and known.is_graded else 1.0
    left = known.friction_bar * np.abs(stiffness)
    own, falls = bars - left, decrements > 0
    return stiffness - np.where(falls, centre, 0.0) * own, np.where(falls, spread, 1.0) * own + left


def _extrapolate_found_large(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, known: Convergence
) -> tuple[FloatArray, FloatArray]:
    is_ball = known.is_ball and known.degree == _FOUND_LARGE_DEGREE and not known.has_others and not known.friction_bar
    if not (is_ball and known.is_graded and decrements[0, 0] > 0):
        return stiffness, bars
    (centre, spread), change = _FOUND_LARGE, _FOUND / 2 * decrements  # F_2 - F_3: see `found_again_bar`
    least = _FOUND_LARGE_AT_EDGE * known.at_edge * np.abs(stiffness)
    return stiffness - centre * change, np.maximum(spread * change, least)


def _theta(degree: int) -> float:
    return degree**2 / (2 * degree + 1)


def _left(degree: int, element: str, plain: float) -> float:
    return _LEFT_STRAIGHT if degree == 1 else _between(_LEFT[element], _LEFT_PLAIN, plain)


def _between(best: float, worst: float, plain: float) -> float:
    return best + (worst - best) * min(1.0, plain / _PLAIN)
