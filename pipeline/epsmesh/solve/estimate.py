"""Error bars, and the limit of the sequence of degrees, from the change in one degree more.

With s = (F_p - F_{p+1}) / F_p (:mod:`epsmesh.solve.hierarchical_estimate`) and an error that falls like p⁻², as at an
edge where u ~ r^½ (I. Babuška and M. Suri, SIAM J. Numer. Anal. 24, 750, 1987), degree p + 1 leaves an error θ s with
θ = p² / (2 p + 1). With quarter points at the probe's edge it leaves less, without them more
(:mod:`epsmesh.solve.cell_values`). The multiples are measured (:mod:`epsmesh.fitted`).

Shares are relative to F_p. Bars are valid relative to the exact force, too: where F_p is a third too high, F_exact is
25 % below it, but F_p errs by 33 %.

With several motions, K is a matrix and S = K_p - K_{p+1}. The rules above apply to every sum of motions, with its own
energy: the error is a symmetric form within ± c'Bc for every movement c. By polarisation the entries of B are at most
(B_ii B_jj)^½.
"""

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve.convergence import Convergence


def is_graded(rim: float, growth: float, *, found: bool = False, large: bool = False, sure: bool = False) -> bool:
    """Return whether a mesh is graded to the edge; ``rim`` in units of the half width, of contact if ``found``.

    ``large`` is for unilateral contact at large displacements, ``sure`` where its limit is known on large elements,
    too.
    """
    of_found = fitted.GRADED_LARGE if large else fitted.GRADED_BALL if sure else fitted.GRADED_FOUND
    largest, steepest = of_found if found else fitted.GRADED
    return rim <= largest and growth <= steepest


def is_plain(share: float) -> bool:
    """Return whether a mesh counts as one without quarter points, from the share of edges at the rim without them."""
    return share >= fitted.PLAIN


def is_fine(rim: float, growth: float) -> bool:
    """Return whether elements at the edge are small; ``rim`` in units of the probe's half width."""
    return rim <= fitted.FINE[0] and growth <= fitted.FINE[1]


def error_bar(
    decrement: float, degree: int, element: str = "displacement", *, plain: float = 0.0, unseen: float = 0.0
) -> float:
    """Return the 95 % bar on F_p, relative to F_p and to F_exact alike.

    ``decrement`` is s, ``plain`` the share of edges at the rim without quarter points, ``unseen`` is N / (F_p d) of a
    mixed element.
    """
    seen = abs(decrement) * (1 + _left(degree, element, plain) * _theta(degree))
    share = max(seen, _between(fitted.UNSEEN, fitted.UNSEEN_PLAIN, plain) * unseen)
    return share / (1 - min(share, fitted.MOST))


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
    is_fine = is_fine and (known.element, known.degree) in fitted.LIMITS_FINE
    centre, spread = fitted.LIMITS_FINE[known.element, known.degree] if is_fine else _limits(known, several=not is_one)
    if known.is_nonlinear and known.is_solved and known.degree > 1:
        centre, spread = fitted.LIMITS_SOLVED
    elif known.is_nonlinear:
        most = centre + spread
        least = min(fitted.LEAST_LARGE, centre - spread)
        centre, spread = (most + least) / 2, (most - least) / 2
    relative = np.diag(bars) / np.abs(np.diag(stiffness))
    share = 1 / np.sqrt(1 + relative)
    covered = 1 + _left(known.degree, known.element, known.plain) * theta
    left = bars * np.outer(share, share) * spread * theta / covered
    if unseen is not None and not known.has_others and not is_plain(known.plain):
        scale = np.abs(np.diag(stiffness))
        seen = np.abs(np.diag(decrements)) / scale * (fitted.APART_FINE if is_fine else 1.0)
        least = fitted.APART[known.degree] * theta * (unseen - seen) * scale
        found = np.diag(left)
        wider = np.sqrt(np.maximum(1.0, np.divide(least, found, out=np.ones_like(found), where=found > 0)))
        left = left * np.outer(wider, wider)
    return stiffness - (1 + centre * theta) * decrements, left


def _limits(known: Convergence, *, several: bool) -> tuple[float, float]:
    """Return centre and spread of the error that degree p + 1 leaves, in units of θ s, of one motion or ``several``."""
    if is_plain(known.plain):
        return fitted.LIMITS_PLAIN
    if not known.is_graded:
        return fitted.LIMITS_COARSE
    if known.has_others:
        return fitted.LIMITS_ELSEWHERE[known.element]
    return fitted.LIMITS_SEVERAL if several and known.element == "mixed" else fitted.LIMITS[known.element, known.degree]


def release_bar(released: float, finer: float, degree: int, *, extrapolated: bool = False) -> float:
    """Return the 95 % bar (J/m) on the energy ``released`` by a slit's front, or on its extrapolated limit.

    ``finer`` is its value in one degree more. The caller adds the relative bar on the energy, of which the release is a
    derivative.
    """
    return abs(released - finer) * (fitted.RELEASE[1] * _theta(degree) if extrapolated else 1 + _theta(degree))


def extrapolate_release(released: FloatArray, finer: FloatArray, degree: int) -> FloatArray:
    """Return the limit of the energy released by a slit's front in the sequence of degrees."""
    return released - (1 + fitted.RELEASE[0] * _theta(degree)) * (released - finer)


def found_bar(decrement: float, unseen: float = 0.0, area_bar: float = 0.0) -> float:
    """Return the relative 95 % bar on F_p for unilateral contact, whose pressure falls to zero at the edge.

    ``decrement`` is the share of the energy that one degree more removes with the area fixed, ``unseen`` N / (2 U) of a
    mixed element. F is stationary with respect to the area: the square of ``area_bar`` covers what the decrement
    misses, which may be small by chance.
    """
    share = max(fitted.FOUND * abs(decrement), fitted.FOUND_UNSEEN * unseen, fitted.FOUND_OF_AREA * area_bar**2)
    return share / (1 - min(share, fitted.MOST))


def found_again_bar(
    share: float, area_bar: float, at_edge: float = fitted.AT_EDGE, *, at_end: float = 0.0
) -> tuple[float, float]:
    """Return a decrement and the relative 95 % bar on F_p, from the ``share`` of F that one degree more removes.

    Contact is solved again in that degree. The share may vanish by chance, so the bar is at least a fraction
    ``at_edge`` of ``area_bar``. ``at_end`` is the bar of what one degree more does not see at sharp ends of the tool.
    """
    bar = max(fitted.FOUND_AGAIN * abs(share), at_edge * area_bar, at_end)
    return 2 * share / fitted.FOUND, bar / (1 - min(bar, fitted.MOST))


def of_steps(force: float, coarse: float, without: float) -> float:
    """Return the relative bar of friction on a ``force`` (N), which is ``coarse`` with half as many load steps.

    It contains a share of what friction adds to the force ``without`` it.
    """
    return abs(coarse / force - 1) + fitted.FRICTION * abs(force / without - 1)


def unresolved(rim: float) -> float:
    """Return the least relative bar on F where elements at the edge of contact, ``rim`` half widths, are too large."""
    return rim / (rim + fitted.FOUND_UNRESOLVED) if rim > 1 else 0.0


def extrapolate_found(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, known: Convergence
) -> tuple[FloatArray, FloatArray]:
    """Return the limit of F / d (1, 1) of unilateral contact, and its bar.

    The middle of its known error is subtracted from F; where one degree more raises F, F and its bar stay. Where
    Newton's method finds the contact, the limit is known for balls, and below flat tools of linear laws.
    """
    if known.is_nonlinear:
        return _extrapolate_found_large(stiffness, decrements, bars, known)
    which = known.element, known.degree
    of_ball = known.is_ball and which in fitted.FOUND_BALL
    centre, spread = fitted.FOUND_BALL[which] if of_ball else fitted.FOUND_LIMITS[which]
    if not known.is_graded or known.is_ended:
        centre, spread = fitted.FOUND_ENDED if known.is_graded else fitted.FOUND_COARSE[known.degree]
    spread *= fitted.FOUND_ELSEWHERE if known.has_others and known.is_graded else 1.0
    left = known.friction_bar * np.abs(stiffness)
    own, falls = bars - left, decrements > 0
    return stiffness - np.where(falls, centre, 0.0) * own, np.where(falls, spread, 1.0) * own + left


def _extrapolate_found_large(
    stiffness: FloatArray, decrements: FloatArray, bars: FloatArray, known: Convergence
) -> tuple[FloatArray, FloatArray]:
    is_known = (known.is_ball or known.is_flat) and known.degree == fitted.FOUND_LARGE_DEGREE and known.is_graded
    if not is_known or known.has_others or known.friction_bar or decrements[0, 0] <= 0:
        return stiffness, bars
    of_ball = fitted.FOUND_BALL_AGAIN if known.is_linear else fitted.FOUND_LARGE
    centre, spread = of_ball if known.is_ball else fitted.FOUND_FLAT
    change = fitted.FOUND / 2 * decrements  # F_2 - F_3: see `found_again_bar`
    least = max(fitted.FOUND_LARGE_AT_EDGE * known.at_edge, known.least) * np.abs(stiffness)
    return stiffness - centre * change, np.maximum(spread * change, least)


def _theta(degree: int) -> float:
    return degree**2 / (2 * degree + 1)


def _left(degree: int, element: str, plain: float) -> float:
    return fitted.LEFT_STRAIGHT if degree == 1 else _between(fitted.LEFT[element], fitted.LEFT_PLAIN, plain)


def _between(best: float, worst: float, plain: float) -> float:
    return best + (worst - best) * min(1.0, plain / fitted.PLAIN)
