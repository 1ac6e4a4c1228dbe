"""From measured curves to estimates: the fit, its verdict, both bars, their parts, and profiles."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from epsmesh.arrays import FloatArray
from epsmesh.study.identified import FITS
from epsmesh_identify.estimation.air import levels, off_the_air
from epsmesh_identify.estimation.attraction import attractions
from epsmesh_identify.estimation.bars import interval, tail
from epsmesh_identify.estimation.fit import FINEST, Fit, fit
from epsmesh_identify.estimation.hidden import hidden_bars
from epsmesh_identify.estimation.limits import at_an_end, begins_later, cut, out_of_range
from epsmesh_identify.estimation.model import REACH, Model
from epsmesh_identify.estimation.parts import (
    SOURCES,
    CurveFit,
    Estimate,
    Measured,
    NoiseEstimate,
    Profile,
    Unknown,
    Window,
)
from epsmesh_identify.estimation.profiles import Likelihood, ends, profile
from epsmesh_identify.estimation.seen import combinations
from epsmesh_identify.estimation.sources import mesh, shares, too_deep
from epsmesh_identify.estimation.start import refined, start
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.report.identified import engineering, title

# A law does not fit if a smooth deviation from it is so much more likely, as logarithm of the ratio of the evidence:
# on synthetic curves of the right law this happens to less than 2 % (benchmarks/results/identify.md).
MISFIT = 1.2
# Least squares of a right law is within this share of the bar, but for 1 % of 900 synthetic curves.
_FAR = 0.85
# An unknown is not seen if its bar covers this share of its range, or of what was known before.
_BLIND = 0.75
# Unknowns that are far from normal whatever the fit says.
_CURVED = ("poisson", "relaxation_")
# Profiles are scaled so that they are this high at the ends of a bar: twice the fall of a normal likelihood.
_AT_BAR = 3.84
# A curve has at least so many points.
_FEWEST = 10
# Contact before the first row, in recorded depths: half the depth at contact of 0.5, four fifths of it at 4.
_REACHES = (REACH, 1.5, 4.0)
_WINDOWS = (0.25, 0.5, 1.0)
# A force above that of air by so many of its usual steps from row to row is one of contact.
_NOISE = 5.0


def identify(measured: Sequence[Measured], unknowns: Sequence[Unknown]) -> Estimate:
    """Return the unknowns of one or several curves with their 95 % bars.

    Contact point and baseline of each curve are always unknown. Ranges with an infinite end are those of the curve.

    Raises:
        ExperimentError: if a curve is no curve, or is fitted at depths for which its force is not known.
    """
    for one in measured:
        _check(one.curve)
    found, least = _fitted(measured, unknowns)
    model = found.model
    x, low, high, profiles = _bars(found)
    ours = mesh(found)
    low, high = x - np.hypot(x - low, ours), x + np.hypot(high - x, ours)
    wanted = tuple(k for k, unknown in enumerate(model.space.unknowns) if unknown.is_wanted)
    beyond = out_of_range(found)
    sticking = list(attractions([one.curve for one in measured], is_much=True))
    seen = _seen(model, low, high)
    wrong = [] if beyond else list(sticking or _misfits(found, least, x, np.array([low, high]), seen))
    does_fit = not (beyond or wrong)
    verdict = beyond or FITS
    if wrong:
        found = least
        x, verdict = found.x, f"does not fit: {'; '.join(wrong)}"
    hidden_low, hidden_high = hidden_bars(found, wanted) if does_fit else (low, high)
    sides = [low, high, np.fmin(low, hidden_low), np.fmax(high, hidden_high)]
    estimate, low, high, low_hidden, high_hidden = (_values(model, np.clip(side, 0.0, 1.0)) for side in [x, *sides])
    scale = np.sqrt(np.diag(found.mixture.spread))
    if not does_fit:
        low, high, low_hidden, high_hidden = np.full((4, len(x)), np.nan)
    return Estimate(
        unknowns=model.space.unknowns,
        estimate=estimate,
        low=low,
        high=high,
        low_hidden=low_hidden,
        high_hidden=high_hidden,
        part=_parts(found, sides[0], sides[1], ours) * ((high - low) / 2)[:, None],
        correlation=found.mixture.spread / np.outer(scale, scale),
        seen=seen,
        verdict=verdict,
        curves=tuple(_curve(found, number) for number in range(len(measured))),
        profiles=profiles,
        windows=() if does_fit or beyond else _windows(measured, found),
        evidence=found.misfit,
        notes=(*combinations(found, seen), *(_notes(found) if does_fit else _doubtful(replace(found, x=x)))),
    )


def _fitted(measured: Sequence[Measured], unknowns: Sequence[Unknown]) -> tuple[Fit, Fit]:
    """Return the fit, and the one of the law alone, by least squares: that of a law that does not fit.

    Contact may be as far before the first row as a curve that begins deep in contact says.
    """
    for reach in _REACHES:
        model = Model.of(measured, unknowns, reach)
        model, x = model.tilted(start(model))
        x = refined(model, x)
        found = fit(model, x)
        if not begins_later(found):
            break
    values = model.space.values(x)
    return found, replace(found, x=x, force=tuple(model.predict(number, values) for number in range(len(measured))))


def _check(curve: Curve) -> None:
    """Refuse what is no curve."""
    if len(curve.force) < _FEWEST:
        raise ExperimentError(curve.name, f"has {len(curve.force)} points: at least {_FEWEST} are needed")
    columns = [curve.depth, curve.force, *([] if curve.time is None else [curve.time])]
    if not all(np.isfinite(column).all() for column in columns):
        raise ExperimentError(curve.name, "has numbers that are not finite")
    if not (np.ptp(curve.force) > 0 and np.ptp(curve.depth) > 0):
        raise ExperimentError(curve.name, "force or depth is constant")


def _values(model: Model, x: FloatArray) -> FloatArray:
    return np.array([float(model.space.value(k, at)) for k, at in enumerate(x)])


def _bars(found: Fit) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, Profile]]:
    """Return estimates and bars (u,) in coordinates: those of the mixture, or of profiles where it is not normal."""
    model, mixture = found.model, found.mixture
    x = mixture.middle
    low, high = np.array([interval(mixture, place) for place in range(len(x))]).T
    shared = [k for k, unknown in enumerate(model.space.unknowns) if " of " not in unknown.name and unknown.is_wanted]
    is_cut = any(low[k] < 0 or high[k] > 1 for k in shared)
    if not is_cut and not any(model.names[k].startswith(_CURVED) for k in shared):
        return x, low, high, {}
    # The profile has the most probable noise: its threshold is raised as bars of all noises are wider than that one's.
    top = mixture.covariance[mixture.top]
    student = float(stdtrit(mixture.freedom, 1 - tail(mixture)))
    wider = float(np.median((high - low) / 2 / np.sqrt(np.diag(top)) / student))
    squared = (student * max(wider, 1.0)) ** 2
    threshold = mixture.freedom * np.log1p(squared / mixture.freedom)
    likelihood, profiles = Likelihood(found), {}
    for place in shared:
        spread = float(np.sqrt(top[place, place]))
        curve, best = profile(likelihood, np.clip(found.x, 0.0, 1.0), place, spread, threshold)
        first, last = ends(curve, threshold)
        # A mixture within the range has also what noises say that are less probable.
        within = low[place] >= 0 and high[place] <= 1
        low[place], high[place] = (min(first, low[place]), max(last, high[place])) if within else (first, last)
        x[place] = best
        values = np.array([float(model.space.value(place, at)) for at in curve.value])
        profiles[model.names[place]] = Profile(values, curve.fall * _AT_BAR / threshold)
    return x, low, high, profiles


def _parts(found: Fit, low: FloatArray, high: FloatArray, ours: FloatArray) -> FloatArray:
    """Return parts (u, len(SOURCES)) of the bars, as shares of their half widths: squares add up to 1."""
    of_mesh = np.minimum((ours / ((high - low) / 2)) ** 2, 1.0)
    squares = shares(found) * (1 - of_mesh)[:, None]
    squares[:, SOURCES.index("mesh")] = of_mesh
    return np.sqrt(np.maximum(squares, 0.0))


def _seen(model: Model, low: FloatArray, high: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which unknowns (u,) the curves see: bars are well within the range, or within what was known before."""
    _, precision = model.space.prior
    before = np.where(precision > 0, 2 * 1.96 / np.sqrt(np.maximum(precision, 1e-300)), 1.0)
    return np.asarray(np.clip(high, 0, 1) - np.clip(low, 0, 1) < _BLIND * before)


def _curve(found: Fit, number: int) -> CurveFit:
    model, force = found.model, found.force[number]
    values = model.space.values(found.x)
    noise, scale = found.noise(number)
    # The fit has means over blocks of points.
    block = len(force) / len(model.thinned(force))
    jacobian = found.jacobian[number]
    variance = np.einsum("ni,ij,nj->n", jacobian, found.mixture.spread, jacobian)
    return CurveFit(
        name=model.measured[number].curve.name,
        depth=model.depth(number, values, force),
        force=model.measured[number].curve.force,
        fit=force,
        band=1.96 * np.sqrt(np.maximum(variance, 0.0)),
        noise=NoiseEstimate(noise.correlation ** (1 / block), noise.white, noise.growth, scale),
    )


def _misfits(
    found: Fit, least: Fit, middle: FloatArray, bars: FloatArray, seen: npt.NDArray[np.bool_]
) -> Iterator[str]:
    """Yield why a law does not fit, unless what it leaves is too small to matter.

    Estimates are in the ``middle`` (u,) of ``bars`` (2, u), in coordinates.

    A deviation from the law is much more probable than none; or noise is slow and large just to absorb what the law
    leaves: then least squares is outside the bar, or the baseline off the air.
    """
    if _is_small(found) or _is_small(least):
        return
    if found.misfit > MISFIT:
        yield _misfit(least)
        return
    space = found.model.space
    for place, unknown in enumerate(space.unknowns):
        # A bar that the end of the range cuts has no end there.
        is_cut = np.array([bars[0, place] <= 0, bars[1, place] >= 1])
        away = np.where(is_cut, [-np.inf, np.inf], _FAR * (bars[:, place] - middle[place]))
        is_out = not away[0] <= least.x[place] - middle[place] <= away[1]
        if unknown.is_wanted and seen[place] and is_out:
            value, low, high = (
                engineering(float(space.value(place, at)), unknown.unit) for at in (least.x[place], *bars[:, place])
            )
            yield (
                f"{title(unknown.name)} is {value} by least squares, at or beyond the end of the error bar, {low} to "
                f"{high}, of a fit with correlated noise: this absorbs what the law leaves"
            )
    yield from off_the_air(found)


def _misfit(least: Fit) -> str:
    """Return by how much a law that does not fit differs from the worst curve, by least squares."""
    number = int(np.argmax([belief.misfit for belief in least.beliefs]))
    force, measured = least.force[number], least.model.measured[number]
    residual = measured.curve.force - force
    largest = float(np.abs(residual).max() / np.ptp(measured.curve.force))
    name = f' of "{measured.curve.name}"' if len(least.force) > 1 else ""
    return (
        f"the force{name} differs from the law's by a smooth curve, up to {100 * largest:.2g} % of the largest force; "
        "no single modulus describes it"
    )


def _notes(found: Fit) -> Iterator[str]:
    """Yield what may make the bars of a law that fits too small."""
    yield from cut(found)
    yield from levels(found)
    for sentence in attractions([one.curve for one in found.model.measured], is_much=False):
        yield f"{sentence[0].upper()}{sentence[1:]}: E may be off by more than its error bar."


def _doubtful(found: Fit) -> Iterator[str]:
    """Yield what is doubtful about the values of a law that does not fit."""
    yield from at_an_end(found)
    for name, why in too_deep(found):
        yield f"{name}: {why}: values are an extrapolation."


def _is_small(found: Fit) -> bool:
    """Return whether what the law leaves of every curve is too small to say anything about the law.

    It is within the error of the law's forces, of mesh and interpolation, or within that of any measured force.
    """
    values = found.model.space.values(found.x)
    for number, (one, force) in enumerate(zip(found.model.measured, found.force, strict=True)):
        error = one.forward.error(found.model.depth(number, values, force), values)
        error = np.where(np.isfinite(error), error, 0.0)  # beyond the known depths nothing is excused
        ours = float(np.max(error * np.abs(force - found.model.offset(number, values))))
        if np.abs(one.curve.force - force).max() > max(ours, FINEST * np.ptp(one.curve.force)):
            return False
    return True


def _windows(measured: Sequence[Measured], found: Fit) -> tuple[Window, ...]:
    """Return the modulus by least squares, without deviations from the law, up to larger and larger depths."""
    if "young" not in found.model.names:
        return ()
    place, values = found.model.names.index("young"), found.model.space.values(found.x)
    # From where the force begins to rise: a law that does not fit has a contact point anywhere.
    touch = {found.model.own("contact_point", number): _touch(one.curve) for number, one in enumerate(measured)}
    depths = [found.model.depth(number, values | touch, force) for number, force in enumerate(found.force)]
    most = max(float(depth.max()) for depth in depths)
    windows = []
    for share in _WINDOWS:
        cut = [_cut(one, depth <= share * most) for one, depth in zip(measured, depths, strict=True)]
        pressed = [int(np.sum((depth > 0) & (depth <= share * most))) for depth in depths]
        if min(pressed) < _FEWEST or any(np.ptp(one.curve.force) == 0 for one in cut):
            continue
        model = Model(cut, found.model.space)
        windows.append(Window(share * most, float(model.space.value(place, start(model)[place]))))
    return tuple(windows)


def _touch(curve: Curve) -> float:
    """Return the recorded depth (m) from which the force is above that of air, or of the first rows, and its noise."""
    first = max(3, len(curve.force) // 20)
    noise = _NOISE * float(np.median(np.abs(np.diff(curve.force))))
    below = np.flatnonzero(curve.force[: int(np.argmax(curve.depth)) + 1] <= np.median(curve.force[:first]) + noise)
    return float(curve.depth[below[-1]]) if below.size else float(curve.depth[0])


def _cut(measured: Measured, keep: npt.NDArray[np.bool_]) -> Measured:
    curve = measured.curve
    time = None if curve.time is None else curve.time[keep]
    return replace(measured, curve=replace(curve, depth=curve.depth[keep], force=curve.force[keep], time=time))
