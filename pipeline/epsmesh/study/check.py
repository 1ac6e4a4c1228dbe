"""Physical sense of a study: what cannot work is an error, what is doubtful is a warning.

Each shape checks its own keys. This module checks combinations of sections.
"""

import itertools
from collections.abc import Sequence
from math import prod
from typing import Any, cast

import numpy as np

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.facetted import Facetted
from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.probe import LINEAR, Probe, is_direction
from epsmesh.shapes.section import Section, in_mm
from epsmesh.shapes.segmented import is_uncertain
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.study.axis import Axis
from epsmesh.study.capabilities.refusals import check_features
from epsmesh.study.check_law import check_laws
from epsmesh.study.check_mesh import (
    check_chosen,
    check_column,
    check_epsilon,
    check_gap,
    check_linear,
    check_locking,
    check_reference,
    check_sizes,
    check_support,
)
from epsmesh.study.closure import check_ball
from epsmesh.study.expected_depth import gives_force
from epsmesh.study.insertion import check_insertion, check_same_path
from epsmesh.study.insertion_stages import has_insertion
from epsmesh.study.place import place_error
from epsmesh.study.plausible import check_extent, check_moduli, check_tools
from epsmesh.study.problems import Problems
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material, Mesh, Planning, Solving
from epsmesh.study.slit import check_slit, check_slit_in
from epsmesh.study.stages import check_history

# Forces of all cases and times: a dataset then has a few hundred megabytes.
_MOST_FORCES = 2_000_000
# Points of a surface that is not checked.
_NOWHERE = np.empty((0, 3))
_OR_NO_CONTACT = '. To go on without contact at such places, write `off = "no contact"` in [probe.path]'


def check_sense(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check each section, then combinations of sections."""
    bodies, probes = cast(Sequence[Body], sections["body"]), cast(Sequence[Probe], sections["probe"])
    materials, meshes = cast(Sequence[Material], sections["material"]), cast(Sequence[Mesh], sections["mesh"])
    problems.each(_tell_notices, body=bodies)
    problems.each(_tell_of_fields, body=bodies, material=materials)
    problems.each(_check_boundary, body=bodies)
    linear = [material for material in materials if not material.is_large]
    if linear:
        problems.each(warn_of_depth, probe=probes)
    problems.each(lambda probe, _: probe.check(problems), probe=probes)
    problems.each(lambda probe, _: probe.check_tip(problems), probe=probes)
    problems.each(lambda probe, _: probe.jaw and probe.jaw.check(problems), probe=probes)
    problems.each(check_history, probe=probes)
    problems.each(check_sizes, mesh=meshes)
    check_chosen(meshes, problems)
    problems.each(check_epsilon, mesh=meshes, probe=probes)
    problems.each(check_linear, body=bodies, material=materials, mesh=meshes)
    problems.each(check_support, body=bodies, mesh=meshes)
    way = next((axis for axis in axes if axis.off), None)
    placed = _placed(bodies, probes, way, problems)
    for body, probe in placed:
        for check in (check_column, check_ball, check_gap, check_slit_in):
            problems.each(check, body=(body,), probe=(probe,), mesh=meshes)
    check_tools(placed, problems)
    check_features(sections, placed, problems)
    check_laws(bodies, materials, problems)
    problems.each(check_moduli, body=bodies, material=materials)
    problems.each(check_extent, body=bodies)
    tools = tuple({probe.elastic: probe for probe in probes}.values())
    problems.each(check_locking, body=bodies, material=materials, mesh=meshes, probe=tools)
    check_reference(meshes, axes, placed, problems)
    _check_times(probes, axes, problems)
    for planning in cast(Sequence[Planning], sections["plan"]):
        if planning.path_error is not None and way is None:
            problems.error("plan.path_error", planning.path_error, "is for places along [probe.path]: omit it")
    _check_forces(sections, probes, problems)
    check_same_path(probes, problems)
    for solve in cast(Sequence[Solving], sections["solve"]):
        if solve.exact and "exact" in solve.model_fields_set and has_insertion(probes):
            problems.error("solve.exact", solve.exact, "the path of an insertion has no F_exact: omit it")
        if "repeats" in solve.model_fields_set and not solve.timing:
            problems.error("solve.repeats", solve.repeats, "is of timing studies: add `timing = true`, or omit it")


def _check_forces(sections: dict[str, tuple[Section, ...]], probes: Sequence[Probe], problems: Problems) -> None:
    """Report what does not go with forces that are given, and depths that are found."""
    if not any(map(gives_force, probes)):
        return
    if not all(map(gives_force, probes)):
        problems.error("probe.force", None, "is in some of the [[probe]] tables only: give it, or a depth, in all")
    for planning in cast(Sequence[Planning], sections["plan"]):
        if planning.stop_near_exact is not None:
            problems.error("plan.stop_near_exact", planning.stop_near_exact, "is for depths that are given: omit it")
    for solve in cast(Sequence[Solving], sections["solve"]):
        if solve.timing:
            problems.error("solve.timing", solve.timing, "times solves at depths that are given: give a depth")
    for body in cast(Sequence[Body], sections["body"]):
        if is_uncertain(body):
            problems.error("body.boundary_uncertainty", None, "has a bar for forces, not for depths: give a depth")


def check_steps(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check the stages of an insertion as the cases that they are: slits, in which a blade slides.

    A needle deep in tissue that it cuts has a toughness, but no insertion.
    """
    if "tool" not in sections or problems.errors:
        return
    found = Problems()
    check_sense(sections, axes, found)
    for problem in found.errors:
        if problem.key in ("probe.toughness", "probe.crack_shape"):
            continue
        problems.error("probe.insertion", None, f"its states are slits: {problem.key}: {problem.allowed}")


def _check_times(probes: Sequence[Probe], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Report histories with more times, over all cases, than a dataset can have."""
    histories = {probe.history for probe in probes} - {None}
    times = {time for history in histories if history for time in history.times()}
    cases = prod(map(len, axes))
    if len(times) * cases > _MOST_FORCES:
        problems.error(
            "probe.history.steps",
            None,
            f"gives {len(times)} times of {cases} cases: at most {_MOST_FORCES} forces; write fewer steps",
        )


def _placed(
    bodies: Sequence[Body], probes: Sequence[Probe], way: Axis | None, problems: Problems
) -> list[tuple[Body, Probe]]:
    """Return the bodies with the probes that have a place on them, and report those that have none."""
    sane = [probe for probe in probes if _has_place(probe, problems)]
    placed, fitting = [], []
    refused: dict[tuple[str, str, str], list[Probe]] = {}
    for body, probe in itertools.product(bodies, sane):
        with problems.about(body=body, probe=probe):
            if _check_place(body, probe, way, problems, refused):
                placed.append((body, probe))
    for (body_name, probe_name, why), lost in refused.items():
        places = [[in_mm(x) for x in probe.at] for probe in lost]
        more = f"; the same for {len(places) - 1} more places, up to {', '.join(places[-1])}" if len(places) > 1 else ""
        with problems.about(body=_named(bodies, body_name), probe=_named(probes, probe_name)):
            problems.error(
                way.path if way else "probe.at", places[0], f"{why}{more}{'' if lost[0].slit else _OR_NO_CONTACT}"
            )
    _check_way(way, probes, placed, problems)
    for body, probe in placed:
        with problems.about(body=body, probe=probe):
            if _check_thickness(body, probe, problems) and check_slit(body, probe, problems):
                check_insertion(body, probe, problems)
                fitting.append((body, probe))
    return fitting


def warn_of_depth(probe: Probe, problems: Problems) -> None:
    """Warn of depths at which strains at the edge of a tool are large for linear elasticity."""
    if probe.is_flat and (insertion := getattr(probe, "insertion", None)):
        problems.warn(
            "probe.insertion.to",
            in_mm(insertion.to),
            "assumes small strains: before the puncture, and at the blade's tip, linear elasticity is an extrapolation",
        )
        return
    if probe.pull is not None and probe.pull > LINEAR * probe.contact_width:
        problems.warn(
            "probe.pull",
            in_mm(probe.pull),
            f"is {probe.pull / probe.contact_width:.0%} of the half width of contact. Above {LINEAR:.0%}, use a law "
            "of large displacements: it follows jaws over the tissue, and a linear one leaves the contact in its place",
        )
    found = Problems()
    probe.warn_of_strains(found)
    for one in found.warnings:
        if probe.force is None:
            problems.warn(one.key, one.found, one.allowed)
        else:
            problems.warn("probe.force", f"{probe.force:.6g} N", f"expected depth {one.found}: {one.allowed}")


def _tell_notices(body: Body, problems: Problems) -> None:
    """Warn of what was found in the files of a body and of its regions."""
    for notice in body.notices:
        problems.warn("body.file" if isinstance(body, FromFile) else "body.region", getattr(body, "file", None), notice)


def _tell_of_fields(body: Body, material: Material, problems: Problems) -> None:
    """Warn of what was found in images of the modulus."""
    for key, tissue in tissues_of(body, material):
        for notice in tissue.varying.notices if tissue.varying else ():
            problems.warn(f"{key}.young.file", tissue.varying and tissue.varying.file, notice)
    varying = body.main(material).varying
    if body.pieces or varying is None or varying.kind == "function":
        return
    points = _NOWHERE
    if isinstance(body, Facetted):
        points = body.triangles.points
    elif isinstance(body, Layered) and body.shape == "box":
        points = body.corners
    values = varying.at(points)
    if (lacks := ~(values > 0)).any():
        first = int(lacks.argmax())
        share = f"{lacks.sum()} of {len(points)} points of the surface: cases fail whose elements come there"
        problems.warn(
            "", None, f"{varying.refusal('material.young', points[first], float(values[first]))}. So at {share}"
        )


def _check_boundary(body: Body, problems: Problems) -> None:
    """Check that the surface can be shifted to the ends of its boundary's range."""
    if is_uncertain(body):
        try:
            for sign in (-1, 1):
                body.varied(offset=sign * body.boundary_range)
        except SurfaceError as error:
            problems.error("body.boundary_uncertainty", body.boundary_uncertainty, f"is too large: {error}")


def _check_thickness(body: Body, probe: Probe, problems: Problems) -> bool:
    """Report a depth larger than the thickness of the body, and warn of one that compresses all of the thickness."""
    thickness, closes = body.thickness(probe.frame_on(body)), probe.jaw.depth if probe.jaw else 0.0
    if probe.deepest + closes >= thickness:
        both = " of both jaws together" if probe.jaw else ""
        problems.error(
            "probe.insertion.to" if getattr(probe, "insertion", None) else "probe.depth",
            in_mm(probe.deepest),
            f"must be{both} below {in_mm(thickness)}, the thickness of the tissue under the tool, along its axis",
        )
        return False
    if LINEAR * thickness < probe.deepest <= LINEAR * probe.half_width and probe.force is None:
        problems.warn(
            "probe.depth",
            in_mm(probe.deepest),
            f"is {probe.deepest / thickness:.0%} of the thickness of the tissue under the tool, "
            f"{in_mm(thickness)}. Above "
            f"{LINEAR:.0%}, linear elasticity is an extrapolation",
        )
    return True


def _has_place(probe: Probe, problems: Problems) -> bool:
    """Report vectors without a direction, and return whether there is none."""
    sane = True
    with problems.about(probe=probe):
        for key in ("axis", "direction", "pull_direction"):
            vector = getattr(probe, key, None)
            if vector is not None and not is_direction(vector):
                problems.error(f"probe.{key}", list(vector), "must be a vector of three finite numbers, not all zero")
                sane = False
    return sane


def _named(sections: Sequence[Section], name: str) -> Section:
    """Return the section of that name."""
    return next(section for section in sections if section.name == name)


def _check_place(
    body: Body, probe: Probe, way: Axis | None, problems: Problems, refused: dict[tuple[str, str, str], list[Probe]]
) -> bool:
    """Report a place at which the probe cannot touch the body, and return whether it can.

    Places of a path are added to ``refused``, by body, probe and reason: they are reported together.
    """
    error = place_error(body, probe)
    if error is None:
        return True
    found = getattr(probe, error.key)
    if error.key != "at":
        problems.error(f"probe.{error.key}", _written(found), str(error))
    elif way is None:
        problems.error("probe.at", [in_mm(x) for x in found], str(error))
    elif way.off != "no contact":
        refused.setdefault((body.name, probe.name, str(error)), []).append(probe)
    return False


def _written(found: Any) -> Any:
    """Return a value of a probe as messages have it."""
    return in_mm(found) if isinstance(found, float) else found and list(found)


def _check_way(
    way: Axis | None, probes: Sequence[Probe], placed: Sequence[tuple[Body, Probe]], problems: Problems
) -> None:
    """Report a path that misses the body, and a slit on a path that may leave the body."""
    if way is None or way.off != "no contact" or problems.errors:
        return
    if any(probe.slit for probe in probes):
        problems.error("probe.path.off", way.off, "a blade in a slit does not leave the body: omit `off`")
    elif not placed:
        problems.error("probe.path", None, "misses the body: the tool fits at none of its places")
