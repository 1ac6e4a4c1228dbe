"""The depth at a given force, from the forces at trial depths: a secant on logarithmic scales, within a bracket.

F rises with the depth, nearly like a power of it. Trials are ordinary cases, each with its depth. The search ends where
F differs from the given force by less than its error bar can tell; the last step, along the secant, needs no solve.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, isfinite, log, nan, sqrt

from epsmesh.units import canonical

# The search ends within this share of the error bar of F, between a least and a largest relative difference. Without a
# bar it ends within the given one.
_SHARE_OF_BAR, _LEAST, _MOST, _WITHOUT_BAR = 0.1, 1e-6, 0.02, 1e-4
# Depths whose logarithms differ by less make no secant: their meshes differ, and their forces by a part of the bars.
# It is this many bars, between a least and a largest difference.
_BARS_APART, _LEAST_APART, _APART = 20.0, 1e-3, 0.02
# Smallest and largest exponent of the depth in F, largest step, and most trials.
_EXPONENTS, _STEP, _MOST_TRIALS = (0.4, 8.0), 4.0, 16
# A trial beside the one that was found, for the slope of F there.
_BESIDE = 0.9
# Depths within this share of one another: a failure at the deeper one is the end.
_NEAR = 1.02
# Failures without a single force after which a case has failed.
_FAILURES = 3


@dataclass(frozen=True)
class Trial:
    """A case at a ``depth`` (m): its force (N; NaN if it failed) with the relative error bar, and why it failed.

    ``is_end``: no larger depth can be reached.
    """

    depth: float
    force: float = nan
    bar: float = nan
    message: str = ""
    is_end: bool = False

    @property
    def is_known(self) -> bool:
        """Whether it has a force."""
        return isfinite(self.force) and self.force > 0


@dataclass(frozen=True)
class DepthAtForce:
    """The depth (m) at a given ``force`` (N), its error bar (m), and the trial depth whose solution is the case's.

    With a ``message`` the force is not reached: ``depth`` and ``reached`` are then the largest depth and force (N).
    ``exponent`` is that of the depth in F there, and ``times`` the factor from the force of that solution to this one.
    """

    force: float
    depth: float = nan
    error: float = nan
    solved: float = nan
    exponent: float = nan
    times: float = nan
    message: str = ""
    reached: float = nan


def next_depth(force: float, trials: Sequence[Trial], most: float, exponent: float | None) -> float | DepthAtForce:
    """Return the next depth (m) to try for a ``force`` (N), or what was found; ``most`` is the largest depth.

    ``exponent`` is that of the depth in F, if it is known exactly.
    """
    known = [trial for trial in trials if trial.is_known]
    if not known:
        return _begin(force, trials)
    best = min((trial for trial in known), key=lambda trial: abs(log(trial.force / force)))
    slope = exponent or _secant(best, known)
    if abs(log(force / best.force)) <= _tolerance(best) and not best.is_end:
        return _found(force, best, slope) if slope else canonical(_BESIDE * best.depth)
    below = max((trial for trial in known if trial.force < force), key=lambda trial: trial.depth, default=None)
    if below and (below.is_end or below.depth >= most):
        return _unreached(force, below, "no larger depth is possible" if not below.is_end else below.message)
    above = min((t for t in trials if not t.is_known or t.force >= force), key=lambda t: t.depth, default=None)
    if below and above and not above.is_known and above.depth < _NEAR * below.depth:
        return _unreached(force, below, above.message)
    depth = _within(_step(force, best, slope), below, above, most)
    if _is_tried(depth, trials) or len(trials) >= _MOST_TRIALS:
        # Forces of meshes of their own need not rise from one depth to a near one.
        left, beside = abs(log(force / best.force)), canonical(_BESIDE * best.depth)
        # Or the depths that are left differ by less than trials do, whatever F does over them.
        is_near = left <= best.bar or abs(log(depth / best.depth)) < _LEAST
        if slope and is_near:
            return _found(force, best, slope, further=left)
        if is_near and not _is_tried(beside, trials) and len(trials) < _MOST_TRIALS:
            return beside
        reason = f"the depth was not found in {len(trials)} trials"
        return DepthAtForce(force, best.depth, solved=best.depth, message=reason, reached=best.force)
    return depth


def _is_tried(depth: float, trials: Sequence[Trial]) -> bool:
    return any(abs(log(depth / trial.depth)) < _LEAST for trial in trials)


def _begin(force: float, trials: Sequence[Trial]) -> float | DepthAtForce:
    last = min(trials, key=lambda trial: trial.depth)
    if len(trials) >= _FAILURES:
        return DepthAtForce(force, solved=last.depth, message=last.message)
    return canonical(last.depth / 2)


def _tolerance(trial: Trial) -> float:
    if not isfinite(trial.bar):
        return _WITHOUT_BAR
    return min(max(_SHARE_OF_BAR * trial.bar, _LEAST), _MOST)


def _secant(best: Trial, known: Sequence[Trial]) -> float | None:
    """Return the exponent of the depth in F from the trial nearest to the ``best`` that is not too near; None if none.

    Where load steps end, F is known at another mesh's depth: it counts all the same.
    """
    least = min(max(_BARS_APART * best.bar, _LEAST_APART), _APART) if isfinite(best.bar) else _APART
    apart = [trial for trial in known if abs(log(trial.depth / best.depth)) >= least]
    if not apart:
        return None
    other = min(apart, key=lambda trial: abs(log(trial.depth / best.depth)))
    found = log(other.force / best.force) / log(other.depth / best.depth)
    return min(max(found, _EXPONENTS[0]), _EXPONENTS[1])


def _step(force: float, best: Trial, slope: float | None) -> float:
    factor = exp(log(force / best.force) / (slope or 1.5))
    return best.depth * min(max(factor, 1 / _STEP), _STEP)


def _within(depth: float, below: Trial | None, above: Trial | None, most: float) -> float:
    """Return a depth within the bracket, or in the middle of it, and not beyond the largest."""
    low, high = below.depth if below else 0.0, above.depth if above else most
    # Not up to a depth that fails.
    end = high if above is None or above.is_known else high / sqrt(_NEAR)
    if above and not low < depth < end and low < high:
        depth = sqrt(low * high) if low else high / 2
    return canonical(min(depth, most))


def _found(force: float, best: Trial, slope: float, further: float = 0.0) -> DepthAtForce:
    """Return the depth a last step along the secant away from the ``best``; the bar has a part of that step."""
    step = log(force / best.force)
    depth = best.depth * exp(step / slope)
    error = depth * (best.bar + _SHARE_OF_BAR * abs(step) + further) / slope
    return DepthAtForce(force, depth, error, best.depth, slope, force / best.force)


def _unreached(force: float, below: Trial, reason: str) -> DepthAtForce:
    text = f"the force is not reached: at {1e3 * below.depth:.4g} mm it is {1e3 * below.force:.4g} mN"
    return DepthAtForce(force, below.depth, solved=below.depth, message=f"{text}, and {reason}", reached=below.force)
