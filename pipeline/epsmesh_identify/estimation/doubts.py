"""Doubts about units: what is measured does not go with the scene, or with any tissue."""

from collections.abc import Iterator, Sequence
from math import inf, nan, sqrt

import numpy as np
import xarray as xr

from epsmesh.study.case import Case
from epsmesh.study.check import warn_of_depth
from epsmesh.study.plausible import size_of
from epsmesh.study.problems import Problems
from epsmesh_identify.estimation.model import MODULI
from epsmesh_identify.estimation.parts import CurveFit, Measured, Unknown
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.report.identified import engineering

# Depths in half widths of a tool, and moduli (Pa) from gels to hard plastics, beyond which a unit is probably wrong.
_DEPTHS = (1e-4, 30.0)
_MODULI = (100.0, 1e10)
# Contact begins, roughly, at this share of the force; a depth less the machine's way is at least this share of it.
_BEGUN, _LEAST_WAY = 0.05, 1e-3
# Powers of the radius that F goes as, and how much more it may be.
_POWERS, _MORE = {"sphere": 0.5, "paraboloid": 0.5, "disc": 1.0}, 1.1
# Forces that are this many times off the ends of the moduli's ranges are none of them.
_ROUGH = 3.0


def doubts_of_scale(cases: Sequence[Case], curves: Sequence[Curve]) -> Iterator[str]:
    """Yield what is doubtful about the depths of curves, each measured on the scene of a case."""
    for case, curve in zip(cases, curves, strict=True):
        yield from _of_curve(curve, case)


def _of_curve(curve: Curve, case: Case) -> Iterator[str]:
    """Yield a doubt about the depths of a curve that was measured on the scene of a case."""
    way, width, thickness = float(np.ptp(curve.depth)), size_of(case.probe), case.body.thickness(case.frame)
    question = "is its unit right, or that of the study?"
    if not _DEPTHS[0] <= way / width <= _DEPTHS[1]:
        yield f"{curve.name}: the depth changes by {way:.3g} m, {way / width:.3g} half widths of the tool: {question}"
    elif way > thickness:
        yield f"{curve.name}: the depth changes by {way:.3g} m, and the tissue is {thickness:.3g} m thick: {question}"


def doubts_of_depth(cases: Sequence[Case], found: Sequence[CurveFit]) -> Iterator[str]:
    """Yield for each fitted curve, on the scene of a case, why its law may be an extrapolation at its depth."""
    for case, curve in zip(cases, found, strict=True):
        if case.way.is_large or any(region.is_large for region in case.body.regions):
            continue
        problems, deepest = Problems(), float(np.nanmax(curve.depth))
        warn_of_depth(case.probe.model_copy(update={"depth": deepest, "history": None}), problems)
        for problem in problems.warnings:
            depth = f"its depth of {engineering(deepest, 'm')}"
            yield f"{curve.name}: {depth if problem.allowed.startswith('is ') else f'at {depth}'} {problem.allowed}"


def doubts_of_radius(cases: Sequence[Case], sought: Sequence[Unknown]) -> Iterator[str]:
    """Yield what an error of the tool's radius does to E, if it is taken for exact.

    On a deep body F goes as E √R of a ball or a paraboloid and as E R of a flat punch.
    """
    of_tools = [case.probe for case in cases if case.probe.shape in _POWERS]
    has_error = any(one.name.partition(" of ")[0] == "radius" for one in sought)
    if has_error or not of_tools or not any(one.name.endswith(MODULI) for one in sought):
        return
    remedy = 'give its error, such as errors = {radius = "5 %"} in the [[measurement]]'
    if len(cases) > 1:
        yield f"The radius of each tool is taken for exact: {remedy}"
        return
    (tool,) = of_tools
    less = 100 * (1 - _MORE ** -_POWERS[tool.shape])
    radius = engineering(getattr(tool, "radius", nan), "m")
    yield f"The radius of {radius} is taken for exact. If it is 10 % more, E is about {less:.0f} % less: {remedy}"


def doubts_of_force(measured: Sequence[Measured], unknowns: Sequence[Unknown]) -> tuple[str, ...]:
    """Return a doubt for each curve whose force no modulus within its range gives, not even roughly.

    Other unknowns are in the middle of their ranges, and the contact point is where the force is small.
    """
    doubts = []
    for one in measured:
        depth, force = _largest(one.curve)
        stiffness = next(((u.low, u.high) for u in unknowns if u.name == "machine_stiffness"), (inf, inf))
        ends = []
        for high, machine in enumerate(stiffness):
            compliance = 1 / machine if one.machine_compliance is None else one.machine_compliance
            way = np.array([max(depth - compliance * force, _LEAST_WAY * depth)])
            ends.append(float(one.forward.force(way, _values(unknowns, high))[0]))
        if not ends[0] / _ROUGH <= force <= ends[1] * _ROUGH:
            side, limit = ("below", ends[0]) if force < ends[0] else ("above", ends[1])
            doubts.append(
                f"{one.curve.name}: {force:.2g} N at a depth of about {depth:.2g} m is {side} the {limit:.2g} N of the "
                "moduli in [identify]: a unit is wrong, such as mN for µN or mm for µm, or their ranges are"
            )
    return tuple(doubts)


def _largest(curve: Curve) -> tuple[float, float]:
    """Return the largest depth (m) below about the contact point, and the rise of the force (N) to there."""
    force = curve.force - np.median(curve.force[: max(1, len(curve.force) // 20)])
    top = int(np.argmax(curve.depth))
    rise = float(np.max(force[: top + 1]))
    begun = curve.depth[np.flatnonzero(force[: top + 1] > _BEGUN * rise)]
    return float(curve.depth[top] - (begun[0] if begun.size else curve.depth[0])), rise


def _values(unknowns: Sequence[Unknown], high: int) -> dict[str, float]:
    """Return values of unknowns: moduli at the lower or upper end of their range, others in the middle."""
    values = {}
    for one in unknowns:
        if one.name.endswith(MODULI):
            values[one.name] = one.high if high else one.low
        elif one.prior is not None:
            values[one.name] = one.prior[0]
        elif one.is_logarithmic:
            values[one.name] = sqrt(one.low * one.high)
        else:
            values[one.name] = (one.low + one.high) / 2
    return values


def doubts_of_moduli(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return what is doubtful about the moduli that an identification found."""
    of_modulus = dataset["unknown"].values[(np.atleast_2d(dataset["unit"].values)[0] == "Pa").nonzero()]
    doubts: list[str] = []
    for name in of_modulus:
        values = np.atleast_1d(dataset["estimate"].sel(unknown=name).values)
        doubts += [doubt for doubt in (doubt_of_modulus(str(name), float(value)) for value in values) if doubt]
    return tuple(doubts)


def doubt_of_modulus(name: str, value: float) -> str:
    """Return a doubt about a modulus (Pa) that came out; "" if it is one of soft matter or plastics."""
    if not _MODULI[0] <= value <= _MODULI[1]:
        return (
            f"{name} of {value:.3g} Pa is no modulus from soft gels (100 Pa) to hard plastics (10 GPa): a unit is "
            "probably wrong, such as mN for µN, or mm for µm"
        )
    return ""
