"""Forces of scenes whose body is as good as endless sidewards, by the integral equation of layered bodies.

The equation has round frictionless tools on flat layers of linear elasticity, but not the body's sides. Three cases
that are solved with their sides tell whether it replaces solves, in a surrogate of hundreds of cases.
"""

from collections.abc import Hashable
from functools import partial
from itertools import product
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Layered
from epsmesh.shapes.probe import Probe
from epsmesh.states import FAILED, OK
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh_identify.layered.body import RIGID, LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from epsmesh_identify.surrogate.cases import Domain, Solve

if TYPE_CHECKING:
    import xarray as xr

# Relative error of forces between the depths that are computed, and of the integral equation itself.
_ERROR = 1e-5
# Largest difference from solves of the sides with which the equation is a guess of them: what is left is smoother.
_ALIKE = 0.3
# The difference that sides make, over the largest displacement of the surface there or beyond, at these multiples of
# their distance. On 32 scenes with sides at least two thicknesses away, free or fixed, ν = 0.3 and 0.49, it was at most
# 2.4. Without solver, a larger difference than the last number is not claimed.
_OF_SIDES, _BEYOND = 6.0, (1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3)
_FAR, _MOST_OF_SIDES = 2.0, 0.02
# Corners of the ranges that are solved with their sides, and all solves: the middle, too.
_CORNERS = 2
CHECKS = 1 + _CORNERS
# Supports below the whole tissue. Sides, fixed or free, are far away.
_SUPPORTS = ("bottom", "bottom+sides")


def profile_of(probe: Probe) -> Profile | None:
    """Return the section of a round tool; None for any other."""
    found = probe.revolved
    return Profile(found.slope, found.limit, found.flat, found.kinks) if found else None


def layered_body(case: Case) -> LayeredBody | None:
    """Return the layers of a case on their rigid base; None if the equation does not have what the case has."""
    body, frame = case.body, case.frame
    is_flat = isinstance(body, Layered) and not body.embedded and body.fixed in _SUPPORTS
    is_on_top = frame.is_upright and frame.point[2] == body.heights[1]
    is_elastic = not (case.way.is_large or any(region.is_large for region in body.regions))
    if not (isinstance(body, Layered) and is_flat and is_on_top and is_elastic and _slides(case.probe)):
        return None
    if case.load.acts or case.way.has_terms or case.is_truncated or case.varies:
        return None
    return LayeredBody(tuple(_layers(case, body)), RIGID)


def _slides(probe: Probe) -> bool:
    """Return whether contact is that of a round tool without friction, and cannot lift off in its middle."""
    section = probe.revolved
    if section is None or probe.motion != "press" or probe.slit is not None:
        return False
    return probe.contact == ("frictionless" if section.is_flat else "unilateral") and probe.friction == 0


def _layers(case: Case, body: Layered) -> list[Layer]:
    rest = body.heights[1] - body.heights[0]
    found = []
    for layer in body.layer:
        thickness = min(layer.thickness or rest, rest)
        found.append(Layer(layer.young, layer.poisson, thickness))
        rest -= thickness
    if not body.is_filled:
        found.append(Layer(case.material.young, case.material.poisson, rest))
    return found


def solve_wide(study: Study, error: float = _ERROR) -> "xr.Dataset":
    """Return force, force_error, status and message of a study of such cases, as a run returns them.

    The error bar is ``error`` times the force.

    Raises:
        ValueError: if :func:`layered_body` has no body for a case.
    """
    import xarray as xr  # noqa: PLC0415 (slow to import, and only needed here)

    number = np.arange(len(study)).reshape(study.shape)
    force, message = np.full(number.size, np.nan), np.full(number.size, "", dtype=object)
    for (body, profile), cases in _by_scene(study):
        depth, places = np.array([case.probe.depth for case in cases]), [number[case.index] for case in cases]
        try:
            force[places] = body.force(profile, depth)
        except ValueError as too_wide:
            message[places] = str(too_wide)
    status = np.where(np.isfinite(force), OK, FAILED).astype(object)
    data = {"force": force, "force_error": error * force, "status": status, "message": message}
    axes = [axis.name for axis in study.axes]
    return xr.Dataset({name: (axes, values.reshape(study.shape)) for name, values in data.items()})


def _by_scene(study: Study) -> list[tuple[tuple[LayeredBody, Profile], list[Case]]]:
    """Return the cases of each body and tool, which differ in depth only."""
    scenes: dict[Hashable, tuple[tuple[LayeredBody, Profile], list[Case]]] = {}
    for case in study.cases():
        body, profile = layered_body(case), profile_of(case.probe)
        if body is None or profile is None:
            raise ValueError(f"{study.file}: {case}: is no round frictionless tool on flat linear elastic layers")
        key = body, case.probe.model_copy(update={"depth": 1.0}).model_dump_json()
        scenes.setdefault(key, ((body, profile), []))[1].append(case)
    return list(scenes.values())


def wide_solve(domain: Domain, solve: Solve) -> tuple[Solve, float] | None:
    """Return what solves the cases of a surrogate by the equation, and how much it differs from solves (relative).

    It is None if the equation does not have their scene, or not at all their sides. Up to three cases are solved by
    ``solve``, at the largest depth: in the middle of all ranges, and at the two corners at which the surface moves most
    at the body's sides. The error bars of all cases are then the largest sum of theirs and of what the equation differs
    there. Without solver, a bound by how far the surface moves at the sides stands for the difference.

    Raises:
        ModuleNotFoundError: if there is no solver, and the sides may change forces by more than 2 %.
    """
    middle, error, most = np.zeros(len(domain.ranges)), _ERROR, 0.0
    if any(layered_body(case) is None for case in _study(domain, middle).cases()):
        return None
    for place in (middle, *_corners(domain)):
        study = _study(domain, place)
        try:
            solved = solve(study)
        except ModuleNotFoundError:  # no solver is installed
            differs, bar = 0.0, max(map(_of_sides, study.cases()))
            if bar > _MOST_OF_SIDES:
                raise
        else:
            force, bars = (np.ravel(solved[name]) for name in ("force", "force_error"))
            differs = float(np.abs(np.ravel(solve_wide(study)["force"]) / force - 1).max())
            bar = float((bars / force).max())
        if not differs <= _ALIKE:
            return None
        error, most = max(error, differs + bar), max(most, differs)
    return partial(solve_wide, error=error), most


def _study(domain: Domain, place: FloatArray) -> Study:
    """Return the study of the case at a place (ranges,) in [-1, 1], at the largest depth."""
    values = [one.value(np.array([x])) for one, x in zip(domain.ranges, place, strict=True)]
    return domain.study(values, np.array([domain.deepest]))


def _corners(domain: Domain) -> list[FloatArray]:
    """Return the corners of all ranges, in [-1, 1], at which the surface moves most at the body's sides."""
    corners = [np.array(corner) for corner in product((-1.0, 1.0), repeat=len(domain.ranges))] if domain.ranges else []
    moved = [_moved(_study(domain, corner).case((0,) * (len(domain.ranges) + 2))) for corner in corners]
    return [corners[k] for k in np.argsort(moved)[::-1][:_CORNERS]]


def _moved(case: Case) -> float:
    """Return how far the surface moves at the nearest side, over the depth."""
    return _displacements(case, (1.0,))[0]


def _of_sides(case: Case) -> float:
    """Return a bound of the relative difference that the sides make; infinite if they are near."""
    low, high = case.body.heights
    if case.body.gap(case.frame.point) < _FAR * (high - low):
        return inf
    return _OF_SIDES * max(_displacements(case, _BEYOND))


def _displacements(case: Case, places: tuple[float, ...]) -> list[float]:
    """Return how far the surface moves at multiples of the distance of the nearest side, over the depth."""
    body, profile = layered_body(case), profile_of(case.probe)
    assert body is not None and profile is not None
    depth = case.probe.depth
    try:
        force = float(body.force(profile, np.array([depth]))[0])
    except ValueError:  # contact is too wide for the equation: so is that of the solve with the case
        return [inf]
    gap = case.body.gap(case.frame.point)
    return [abs(body.point_load(times * gap)) * force / depth for times in places]
