"""Physical sense of a study: what cannot work is an error, what is doubtful a warning.

What makes no sense in a shape by itself, the shape reports; here is what must fit together.
"""

import itertools
from collections.abc import Sequence
from math import isfinite
from typing import cast

from pipeline.shapes.body import Body
from pipeline.shapes.contact import is_flat, is_level
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import Probe, is_direction
from pipeline.shapes.section import Section, in_mm
from pipeline.study.closure import check_closure, check_far_field
from pipeline.study.large import check_large
from pipeline.study.place import held_gap, place_error
from pipeline.study.problems import Problems
from pipeline.study.regions import tissues_of
from pipeline.study.schema import Material, Mesh, Solving
from pipeline.study.slit import check_slit, check_slit_in
from pipeline.study.sweep import Axis

# Linear elasticity: strain under the probe is of order depth / radius.
_LINEAR = 0.10
# Displacement elements lock as ν nears ½: from the first value on visibly, from the second on F is worth nothing
# (docs/accuracy.md), and a number that looks like any other would be returned for it.
_LOCKING = {1: (0.45, 0.45), 2: (0.49, 0.495), 3: (0.49, 0.495)}

# Mixed elements keep λ = μ, which is ν = 0.25, with the displacement and give the rest to the pressure.
_LEAST_MIXED = 0.25
_FINDS_CONTACT = 2  # the degree of elements that find where a tool touches


def check_sense(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check single sections, then those that must fit each other."""
    bodies, probes = cast(Sequence[Body], sections["body"]), cast(Sequence[Probe], sections["probe"])
    materials, meshes = cast(Sequence[Material], sections["material"]), cast(Sequence[Mesh], sections["mesh"])
    for body in bodies:
        if isinstance(body, FromFile):
            with problems.about(body=body):
                for notice in body.notices:
                    problems.warn("body.file", body.file, notice)
    linear = [material for material in materials if not material.is_large]
    for probe in probes:
        with problems.about(probe=probe):
            if linear:
                _check_depth(probe, problems)
            _check_motion(probe, problems)
            probe.check(problems)
    for mesh in meshes:
        with problems.about(mesh=mesh):
            _check_mesh(mesh, problems)
    for mesh, probe in itertools.product(meshes, probes):
        with problems.about(mesh=mesh, probe=probe):
            _check_epsilon(mesh, probe, problems)
            _check_depth_range(mesh, probe, problems)
    for body, mesh in itertools.product(bodies, meshes):
        with problems.about(body=body, mesh=mesh):
            body.support.check(body.heights, mesh.fine, problems)
            _check_outside(body, mesh, problems)
    way = next((axis for axis in axes if axis.off), None)
    placed = _placed(bodies, probes, way, problems)
    for (body, probe), mesh in itertools.product(placed, meshes):
        with problems.about(body=body, probe=probe, mesh=mesh):
            _check_column(body, probe, mesh, problems)
            check_closure(body, probe, mesh, problems)
            _check_gap(body, probe, mesh, problems)
            _check_straight(body, probe, mesh, problems)
            check_slit_in(body, probe, mesh, problems)
    check_large(bodies, materials, probes, meshes, problems)
    for body, material, mesh in itertools.product(bodies, linear, meshes):
        with problems.about(body=body, material=material, mesh=mesh):
            _check_locking(dict(tissues_of(body, material)), mesh, problems)
            check_far_field(material, mesh, problems)
    _check_reference(meshes, axes, problems)
    for solve in cast(Sequence[Solving], sections["solve"]):
        if "repeats" in solve.model_fields_set and not solve.timing:
            problems.error("solve.repeats", solve.repeats, "only a timing study repeats its cases: add `timing = true`")


def _placed(
    bodies: Sequence[Body], probes: Sequence[Probe], way: Axis | None, problems: Problems
) -> list[tuple[Body, Probe]]:
    """Return the bodies with the probes that have a place on them, and report those that have none."""
    sane = [probe for probe in probes if _has_place(probe, problems)]
    placed, fitting = [], []
    for body, probe in itertools.product(bodies, sane):
        with problems.about(body=body, probe=probe):
            if _check_place(body, probe, way, problems):
                placed.append((body, probe))
    _check_way(way, probes, placed, problems)
    for body, probe in placed:
        with problems.about(body=body, probe=probe):
            if _check_thickness(body, probe, problems) and check_slit(body, probe, problems):
                fitting.append((body, probe))
    return fitting


def _check_depth(probe: Probe, problems: Problems) -> None:
    """Warn of depths at which strains are large below an edge; a tool that is not flat tells of its own."""
    if isinstance(probe, Indenter) or probe.half_width <= 0:  # a slit that leaves nothing of a blade says so itself
        return
    proportional = "F stays proportional to depth" if probe.proportional_to else "strains are taken to be small"
    if probe.depth > _LINEAR * probe.half_width:
        problems.warn(
            "probe.depth",
            in_mm(probe.depth),
            f"is {probe.depth / probe.half_width:.0%} of the probe's half width {in_mm(probe.half_width)}: above "
            f"{_LINEAR:.0%}, where F of a neo-Hookean body is about 1 % less, linear elasticity is an extrapolation "
            f"({proportional})",
        )


def _check_thickness(body: Body, probe: Probe, problems: Problems) -> bool:
    """Report a depth that the body does not have, and warn of one that squeezes all of its thickness."""
    thickness = body.thickness(probe.frame_on(body))
    if probe.depth >= thickness:
        problems.error(
            "probe.depth", in_mm(probe.depth),
            f"must be below the {in_mm(thickness)} that the body reaches below the probe, along its axis",
        )  # fmt: skip
        return False
    if _LINEAR * thickness < probe.depth <= _LINEAR * probe.half_width:
        problems.warn(
            "probe.depth", in_mm(probe.depth),
            f"is {probe.depth / thickness:.0%} of the {in_mm(thickness)} of tissue below the probe: above "
            f"{_LINEAR:.0%} linear elasticity is an extrapolation",
        )  # fmt: skip
    return True


def _check_motion(probe: Probe, problems: Problems) -> None:
    if probe.motion == "all" and probe.contact != "bonded":
        problems.error(
            "probe.motion", probe.motion,
            f'a {probe.contact} probe holds the tissue in one direction only: use contact = "bonded"',
        )  # fmt: skip


def _has_place(probe: Probe, problems: Problems) -> bool:
    """Report directions that are none; what has one has no place."""
    sane = True
    with problems.about(probe=probe):
        for key in ("axis", "direction"):
            vector = getattr(probe, key, None)
            if vector is not None and not is_direction(vector):
                problems.error(f"probe.{key}", list(vector), "must be a vector of three finite numbers, not all zero")
                sane = False
    return sane


def _check_mesh(mesh: Mesh, problems: Problems) -> None:
    if mesh.fine > mesh.coarse:
        problems.error("mesh.fine", in_mm(mesh.fine), f"must be at most coarse = {in_mm(mesh.coarse)}")
    if mesh.rim is not None and mesh.rim > mesh.fine:
        problems.error("mesh.rim", in_mm(mesh.rim), f"must be at most fine = {in_mm(mesh.fine)}")


def _check_place(body: Body, probe: Probe, way: Axis | None, problems: Problems) -> bool:
    """Report a place at which the probe cannot touch the body, and tell whether it has one."""
    error = place_error(body, probe)
    if error is not None and not (way and way.off == "lost" and error.key == "at"):
        found, key = getattr(probe, error.key), way.path if way and error.key == "at" else f"probe.{error.key}"
        problems.error(key, [in_mm(x) for x in found] if error.key == "at" else found and list(found), str(error))
    return error is None


def _check_way(way: Axis | None, probes: Sequence[Probe], placed: Sequence[tuple[Body, Probe]],
               problems: Problems) -> None:  # fmt: skip
    """Refuse a path that never meets a body, and the loss of a contact that cannot be lost."""
    if way is None or way.off != "lost" or problems.errors:
        return
    if any(probe.slit for probe in probes):
        problems.error("probe.path.off", way.off, "a blade that stands in a slit does not leave the body: refuse it")
    elif not placed:
        problems.error("probe.path", None, "meets the body nowhere: of all its places there is none to stand on")


def held_gaps(body: Body, probe: Probe, mesh: Mesh) -> dict[str, float]:
    """Return the distances (m) between the probe's edge and the faces held beside it, by the key that sets them."""
    frame, gaps = probe.frame_on(body), {}
    if isinstance(body, FromFile) and isfinite(gap := held_gap(body, probe, frame)):
        gaps["body.fixed"] = gap
    if not is_level(body, frame):
        return {"body.fixed": gap} if isfinite(gap := held_gap(body, probe, frame)) else {}
    if not gaps and (beside := body.support.gap(probe.gap(body, frame))) is not None:
        gaps["body.fixed"] = beside
    if mesh.outside not in ("coarse", "free") and isfinite(column := mesh.column(body.reach(frame))):
        gaps["mesh.epsilon"] = column - (probe.expected_radius if isinstance(probe, Indenter) else probe.circumradius)
    return {key: gap for key, gap in gaps.items() if gap > 0}


def _check_column(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    frame = probe.frame_on(body)
    if not mesh.is_closed and isfinite(mesh.column(body.reach(frame))) and not is_level(body, frame):
        problems.error(
            "mesh.outside", mesh.outside,
            "a column is kept below a level face that the probe presses straight down on only: "
            'use outside = "coarse" here',
        )  # fmt: skip


def _check_gap(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Between the probe and a held face there must be room for an element, or F is that of the element."""
    if mesh.accuracy is not None and "rim" not in mesh.model_fields_set:
        return
    for key, gap in held_gaps(body, probe, mesh).items():
        if gap < mesh.rim_size(probe.half_width):
            problems.error(
                key, None, f"leaves {in_mm(gap)} between the probe's edge and a held face, less than an element there: "
                f"use a rim below {in_mm(gap)}",
            )  # fmt: skip


def _check_epsilon(mesh: Mesh, probe: Probe, problems: Problems) -> None:
    if mesh.epsilon < probe.circumradius:
        reach, is_cut = in_mm(probe.circumradius), mesh.outside in ("free", "fixed")
        if isinstance(probe, Indenter):
            what = f"is less than {reach}, up to which the {probe.shape} may touch: contact may leave the fine mesh"
            what += ", but not beyond the column" if is_cut else ""
        else:
            what = f"is less than the probe's radius {reach}: part of the contact lies outside the fine mesh"
            what += ", and the column cuts the footprint off" if is_cut else ""
        problems.warn("mesh.epsilon", in_mm(mesh.epsilon), what)
    if mesh.rim_size(probe.half_width) > probe.half_width:
        problems.warn(
            "mesh.rim",
            in_mm(mesh.rim_size(probe.half_width)),
            f"does not resolve the probe, whose half width is {in_mm(probe.half_width)}: F may be far off",
        )


def _check_depth_range(mesh: Mesh, probe: Probe, problems: Problems) -> None:
    """Refuse one mesh for many depths whose sizes are chosen for the accuracy of each."""
    if mesh.accuracy is not None and isinstance(probe, Indenter) and probe.depth_range:
        problems.error(
            "probe.depth_range", [in_mm(depth) for depth in probe.depth_range],
            "is for meshes with sizes of your own: where an accuracy is asked for, each depth has one that is chosen "
            "for it; leave one of the two out",
        )  # fmt: skip


def _check_outside(body: Body, mesh: Mesh, problems: Problems) -> None:
    if mesh.outside == "free" and not body.support.holds_column() and isfinite(mesh.epsilon):
        problems.error(
            "mesh.outside",
            mesh.outside,
            "the column round the probe does not touch the fixed sides and would float: "
            'use `outside = "coarse"` or "fixed", or fix the bottom',
        )


def _check_straight(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Refuse what elements of a degree cannot follow: no error bar tells how much tissue straight ones leave out."""
    if probe.is_unilateral and mesh.degree != _FINDS_CONTACT:
        problems.error(
            "mesh.degree", mesh.degree, f"must be {_FINDS_CONTACT} where contact is unilateral: its edge falls between "
            "elements of degree 1, and on those of degree 3 forces at nodes do not tell pressure from tension",
        )  # fmt: skip
    if mesh.degree > 1:
        return
    if body.inclusion:
        problems.error("mesh.degree", mesh.degree, "is too low for inclusions, which straight elements cut: use 2 or 3")
    elif not is_flat(body, probe, probe.frame_on(body)):
        problems.error("mesh.degree", mesh.degree, "is too low for a curved surface, or a tilted probe: use 2 or 3")


def _check_locking(poissons: dict[str, float], mesh: Mesh, problems: Problems) -> None:
    """Check elements against Poisson's ratios, by key, of all the materials of a body."""
    if mesh.element_for(max(poissons.values())) == "mixed":
        _check_mixed(max(poissons.values()), mesh, problems)
        return
    visible, most = _LOCKING[mesh.degree]
    for key, poisson in poissons.items():
        if poisson > most:
            problems.error(
                key, poisson, f"displacement elements of degree {mesh.degree} lock: must be at most {most}; "
                'with degree 2 or 3 and element = "auto", mixed elements take values up to 0.5',
            )  # fmt: skip
        elif poisson > visible or poisson == most:
            problems.warn(
                key, poisson, f"displacement elements of degree {mesh.degree} lock at this value: F comes out too high"
            )


def _check_mixed(largest: float, mesh: Mesh, problems: Problems) -> None:
    if mesh.degree == 1:
        problems.error("mesh.element", mesh.element, "there is no stable mixed element of degree 1: use 2 or 3")
    if largest <= _LEAST_MIXED:
        problems.error(
            "mesh.element", mesh.element, f"mixed elements are for Poisson's ratios above {_LEAST_MIXED}; "
            'use "auto" or "displacement"',
        )  # fmt: skip


def _check_reference(meshes: Sequence[Mesh], axes: tuple[Axis, ...], problems: Problems) -> None:
    if all(isfinite(mesh.epsilon) for mesh in meshes if mesh.accuracy is None):
        if any(mesh.accuracy is not None for mesh in meshes):
            return
        swept = any(axis.name == "epsilon" for axis in axes)
        problems.warn(
            "mesh.epsilon",
            None,
            f'{"the list has" if swept else "there is"} no "full" case: F_max, F/F_max and speed-up stay empty',
        )
