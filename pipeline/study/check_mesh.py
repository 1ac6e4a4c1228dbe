"""Physical sense of a mesh: its sizes among themselves, and with the body, probe and material that it is for."""

from collections.abc import Sequence
from math import isfinite, isinf

from pipeline.shapes.body import Body
from pipeline.shapes.contact import is_level
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import ON_EDGE, Probe
from pipeline.shapes.section import in_mm
from pipeline.study.place import held_gap
from pipeline.study.problems import Problems
from pipeline.study.regions import tissues_of
from pipeline.study.schema import Material, Mesh
from pipeline.study.sweep import Axis

# Displacement elements lock as ν nears ½: from the first value on visibly, from the second on F is worth nothing
# (docs/accuracy.md), and a number that looks like any other would be returned for it.
_LOCKING = {1: (0.45, 0.45), 2: (0.49, 0.495), 3: (0.49, 0.495)}

# Mixed elements keep λ = μ, which is ν = 0.25, with the displacement and give the rest to the pressure.
_LEAST_MIXED = 0.25


def check_sizes(mesh: Mesh, problems: Problems) -> None:
    """Refuse sizes of elements that contradict each other."""
    if mesh.fine > mesh.coarse:
        problems.error("mesh.fine", in_mm(mesh.fine), f"must be at most coarse = {in_mm(mesh.coarse)}")
    if mesh.rim is not None and mesh.rim > mesh.fine:
        problems.error("mesh.rim", in_mm(mesh.rim), f"must be at most fine = {in_mm(mesh.fine)}")


def check_chosen(meshes: Sequence[Mesh], problems: Problems) -> None:
    """Refuse an ε that does nothing in all of a study: with an accuracy, sizes are chosen where no part is kept."""
    if not all(mesh.accuracy is not None and mesh.outside == "coarse" for mesh in meshes):
        return
    for mesh in meshes:
        if "epsilon" in mesh.model_fields_set:
            problems.error(
                "mesh.epsilon",
                "full" if isinf(mesh.epsilon) else in_mm(mesh.epsilon),
                "does nothing beside an accuracy, for which sizes are chosen: leave one of the two out, or keep a part "
                'of the body, outside = "free"',
            )


def held_gaps(body: Body, probe: Probe, mesh: Mesh) -> dict[str, float]:
    """Return the distances (m) between the probe's edge and the faces held beside it, by the key that sets them."""
    frame, gaps = probe.frame_on(body), {}
    if isinstance(body, FromFile) or not is_level(body, frame):
        if isfinite(gap := held_gap(body, probe, frame)):
            gaps["body.fixed"] = gap
    elif (beside := body.support.gap(probe.gap(body, frame))) is not None:
        gaps["body.fixed"] = beside
    if mesh.outside not in ("coarse", "free") and isfinite(column := mesh.column(body.reach(frame))):
        gaps["mesh.epsilon"] = column - (probe.expected_radius if isinstance(probe, Indenter) else probe.circumradius)
    return {key: gap for key, gap in gaps.items() if gap > 0}


def check_column(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Refuse a column that contact runs out of."""
    frame = probe.frame_on(body)
    column = mesh.column(body.reach(frame))
    if mesh.outside == "free" and isinstance(probe, Indenter) and column <= (1 + ON_EDGE) * probe.half_length:
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"keeps a column that contact along the {probe.shape} runs out of: must be above half its length, "
            f'{in_mm(probe.half_length)}, or use outside = "coarse"',
        )


def check_gap(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Between the probe and a held face there must be room for an element, or F is that of the element."""
    if _meets_held_column(body, probe, mesh):
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"keeps a column that is held at its side, and that the {probe.shape} reaches, {in_mm(probe.pressed)} from "
            f'its axis: must be above that, or use outside = "coarse" or "free"',
        )
        return
    if mesh.accuracy is not None and "rim" not in mesh.model_fields_set:
        return
    for key, gap in held_gaps(body, probe, mesh).items():
        if gap < mesh.rim_size(probe.half_width):
            problems.error(
                key,
                in_mm(mesh.epsilon) if key == "mesh.epsilon" else None,
                f"leaves {in_mm(gap)} between the probe's edge and a held face, less than an element there: "
                f"use a rim below {in_mm(gap)}",
            )


def _meets_held_column(body: Body, probe: Probe, mesh: Mesh) -> bool:
    """Tell whether the tissue would have to be pushed in where it is held, which no displacement does."""
    frame = probe.frame_on(body)
    if mesh.outside != "fixed" or probe.slit is not None:
        return False
    column = mesh.column(body.reach(frame))
    return column <= probe.pressed * (1 + ON_EDGE)


def check_epsilon(mesh: Mesh, probe: Probe, problems: Problems) -> None:
    """Warn of a fine mesh that the contact may leave, and of a rim that does not resolve the probe."""
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


def check_support(body: Body, mesh: Mesh, problems: Problems) -> None:
    """Refuse a support that elements cannot follow."""
    body.support.check(body.heights, mesh.fine, problems)


def check_locking(body: Body, material: Material, mesh: Mesh, problems: Problems) -> None:
    """Check elements against Poisson's ratios of all the materials of a body."""
    poissons = {f"{key}.poisson": tissue.poisson for key, tissue in tissues_of(body, material)}
    if mesh.element_for(max(poissons.values())) == "mixed":
        if max(poissons.values()) <= _LEAST_MIXED:
            problems.error(
                "mesh.element",
                mesh.element,
                f'mixed elements are for Poisson\'s ratios above {_LEAST_MIXED}; use "auto" or "displacement"',
            )
        return
    visible, most = _LOCKING[mesh.degree]
    for key, poisson in poissons.items():
        if poisson > most:
            problems.error(
                key,
                poisson,
                f"displacement elements of degree {mesh.degree} lock: must be at most {most}; "
                'with degree 2 or 3 and element = "auto", mixed elements take values up to 0.5',
            )
        elif poisson > visible or poisson == most:
            problems.warn(
                key, poisson, f"displacement elements of degree {mesh.degree} lock at this value: F comes out too high"
            )


def check_reference(meshes: Sequence[Mesh], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Warn where nothing of the study is a full order to compare with."""
    if all(isfinite(mesh.epsilon) for mesh in meshes if mesh.accuracy is None):
        if any(mesh.accuracy is not None for mesh in meshes):
            return
        swept = any(axis.name == "epsilon" for axis in axes)
        problems.warn(
            "mesh.epsilon",
            None,
            f'{"the list has" if swept else "there is"} no "full" case: F_max, F/F_max and speed-up stay empty',
        )
