"""Physical sense of a study: what cannot work is an error, what is doubtful a warning."""

import itertools
from math import hypot, isfinite

from pipeline.study.problems import Problems
from pipeline.study.schema import AnyBody, AnyProbe, Below, Blade, Box, Material, Mesh, Section, Solve
from pipeline.study.sweep import Axis

# Linear elasticity: strain under the probe is of order depth / radius.
_LINEAR = 0.10
# Displacement elements lock as ν nears ½: from the first value on visibly, from the second on F is worth nothing
# (docs/accuracy.md), and a number that looks like any other would be returned for it.
_LOCKING = {1: (0.45, 0.45), 2: (0.49, 0.495), 3: (0.49, 0.495)}

# Mixed elements keep λ = μ, which is ν = 0.25, with the displacement and give the rest to the pressure.
_LEAST_MIXED = 0.25
# A footprint this near the edge, in units of the body, touches it: the rest is rounding.
_TOUCHING = 1e-9
# Elements may be this much longer than a strip is wide.
_LONGEST_NEEDLE = 200


def check_sense(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check single sections, then pairs of sections that must fit each other."""
    bodies, materials, probes, meshes = (sections[name] for name in ("body", "material", "probe", "mesh"))
    for body in bodies:
        _check_body(body, problems)  # type: ignore[arg-type]
    for probe in probes:
        _check_probe(probe, problems)  # type: ignore[arg-type]
        _check_motion(probe, problems)  # type: ignore[arg-type]
    for mesh in meshes:
        _check_mesh(mesh, problems)  # type: ignore[arg-type]
    for body, probe in itertools.product(bodies, probes):
        _check_fit(body, probe, problems)  # type: ignore[arg-type]
    for mesh, probe in itertools.product(meshes, probes):
        _check_epsilon(mesh, probe, problems)  # type: ignore[arg-type]
    for body, mesh in itertools.product(bodies, meshes):
        _check_outside(body, mesh, problems)  # type: ignore[arg-type]
        _check_strip(body, mesh, problems)  # type: ignore[arg-type]
    for body, probe, mesh in itertools.product(bodies, probes, meshes):
        _check_gap(body, probe, mesh, problems)  # type: ignore[arg-type]
    for material, mesh in itertools.product(materials, meshes):
        _check_locking(material, mesh, problems)  # type: ignore[arg-type]
    _check_reference(meshes, axes, problems)
    (solve,) = sections["solve"]
    assert isinstance(solve, Solve)
    if "repeats" in solve.model_fields_set and not solve.timing:
        problems.error("solve.repeats", solve.repeats, "only a timing study repeats its cases: add `timing = true`")


def _mm(length: float) -> str:
    return f"{length * 1e3:.4g} mm"


def _check_body(body: AnyBody, problems: Problems) -> None:
    if isinstance(body.fixed, Below) and not -body.height < body.fixed.below < 0:
        problems.error(
            "body.fixed",
            f"below {_mm(body.fixed.below)}",
            f"must lie inside the body: between -{_mm(body.height)} and 0 mm",
        )


def _check_probe(probe: AnyProbe, problems: Problems) -> None:
    if probe.depth > _LINEAR * probe.half_width:
        problems.warn(
            "probe.depth",
            _mm(probe.depth),
            f"is more than {_LINEAR:.0%} of the probe's half width {_mm(probe.half_width)}: linear elasticity is "
            "then an extrapolation (F stays proportional to depth)",
        )
    if not isinstance(probe, Blade):
        return
    if probe.direction[2] != 0 or hypot(*probe.direction) == 0 or not all(map(isfinite, probe.direction)):
        problems.error("probe.direction", list(probe.direction), "must be a horizontal vector: [x, y, 0], not all zero")
    if probe.slice > 0 and probe.action != "cut":
        problems.error("probe.slice", _mm(probe.slice), 'only a cut slices: set action = "cut"')
    if probe.slice > 0 and probe.contact == "frictionless":
        problems.error(
            "probe.slice", _mm(probe.slice), "a frictionless blade slides along without force: use contact = 'bonded'"
        )


def _check_motion(probe: AnyProbe, problems: Problems) -> None:
    if probe.motion == "all" and probe.contact != "bonded":
        problems.error(
            "probe.motion", probe.motion,
            f'a {probe.contact} probe holds the tissue in one direction only: use contact = "bonded"',
        )  # fmt: skip


def _check_mesh(mesh: Mesh, problems: Problems) -> None:
    if mesh.fine > mesh.coarse:
        problems.error("mesh.fine", _mm(mesh.fine), f"must be at most coarse = {_mm(mesh.coarse)}")
    if mesh.rim is not None and mesh.rim > mesh.fine:
        problems.error("mesh.rim", _mm(mesh.rim), f"must be at most fine = {_mm(mesh.fine)}")


def _check_fit(body: AnyBody, probe: AnyProbe, problems: Problems) -> None:
    if isinstance(probe, Blade) and hypot(probe.direction[0], probe.direction[1]) == 0:
        return
    if _gap_to_side(body, probe) <= _TOUCHING * body.reach((0.0, 0.0)):
        top = f"{_mm(body.size[0])} × {_mm(body.size[1])}" if isinstance(body, Box) else f"radius {_mm(body.radius)}"
        problems.error(
            "probe.at",
            [_mm(x) for x in probe.at],
            f"the footprint of the {probe.shape} must lie inside the body's top ({top}), not on or over its edge",
        )


def _gap_to_side(body: AnyBody, probe: AnyProbe) -> float:
    """Distance (m) between the footprint and the edge of the body's top, negative outside."""
    if not isinstance(probe, Blade):
        return body.gap(probe.at) - probe.half_width
    (tx, ty), half_l, half_w = probe.along, probe.length / 2, probe.width / 2
    corners = [
        (probe.at[0] + i * half_l * tx - j * half_w * ty, probe.at[1] + i * half_l * ty + j * half_w * tx)
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    return min(body.gap(corner) for corner in corners)


def held_gaps(body: AnyBody, probe: AnyProbe, mesh: Mesh) -> dict[str, float]:
    """Return the distances (m) between the probe's edge and the faces held beside it, by the key that sets them."""
    gaps = {}
    if isinstance(body.fixed, Below):
        gaps["body.fixed"] = hypot(_gap_to_side(body, probe), body.fixed.below)
    elif "sides" in body.fixed:
        gaps["body.fixed"] = _gap_to_side(body, probe)
    if mesh.outside == "fixed" and mesh.epsilon < body.reach(probe.at):
        gaps["mesh.epsilon"] = mesh.epsilon - probe.circumradius
    return {key: gap for key, gap in gaps.items() if gap > 0}


def _check_gap(body: AnyBody, probe: AnyProbe, mesh: Mesh, problems: Problems) -> None:
    """Between the probe and a held face there must be room for an element, or F is that of the element."""
    if mesh.accuracy is not None and "rim" not in mesh.model_fields_set:
        return
    for key, gap in held_gaps(body, probe, mesh).items():
        if gap < mesh.rim_size(probe.half_width):
            problems.error(
                key, None, f"leaves {_mm(gap)} between the probe's edge and a held face, less than an element there: "
                f"use a rim below {_mm(gap)}",
            )  # fmt: skip


def _check_strip(body: AnyBody, mesh: Mesh, problems: Problems) -> None:
    """A level that leaves a strip far thinner than the elements beside it makes needles of them."""
    if not isinstance(body.fixed, Below) or not isfinite(mesh.fine):
        return
    strip = min(-body.fixed.below, body.height + body.fixed.below)
    if 0 < strip < mesh.fine / _LONGEST_NEEDLE:
        problems.error(
            "body.fixed",
            f"below {_mm(body.fixed.below)}",
            f"leaves a strip of {_mm(strip)} at the side, too thin for elements of {_mm(mesh.fine)}: "
            f"use fine = {_mm(_LONGEST_NEEDLE * strip)} at most, or another level",
        )


def _check_epsilon(mesh: Mesh, probe: AnyProbe, problems: Problems) -> None:
    if mesh.epsilon < probe.circumradius:
        problems.warn(
            "mesh.epsilon",
            _mm(mesh.epsilon),
            f"is less than the probe's radius {_mm(probe.circumradius)}: part of the contact lies outside the fine mesh"
            + ("" if mesh.outside == "coarse" else ", and the column cuts the footprint off"),
        )
    if mesh.rim_size(probe.half_width) > probe.half_width:
        problems.warn(
            "mesh.rim",
            _mm(mesh.rim_size(probe.half_width)),
            f"does not resolve the probe, whose half width is {_mm(probe.half_width)}: F may be far off",
        )


def _check_outside(body: AnyBody, mesh: Mesh, problems: Problems) -> None:
    if mesh.outside == "free" and body.fixed == "sides" and isfinite(mesh.epsilon):
        problems.error(
            "mesh.outside",
            mesh.outside,
            "the column round the probe does not touch the fixed sides and would float: "
            'use `outside = "coarse"` or "fixed", or fix the bottom',
        )


def _check_locking(material: Material, mesh: Mesh, problems: Problems) -> None:
    if mesh.element_for(material.poisson) == "mixed":
        _check_mixed(material, mesh, problems)
        return
    visible, most = _LOCKING[mesh.degree]
    if material.poisson > most:
        problems.error(
            "material.poisson",
            material.poisson,
            f"displacement elements of degree {mesh.degree} lock: must be at most {most}; "
            'with degree 2 or 3 and element = "auto", mixed elements take values up to 0.5',
        )
    elif material.poisson > visible or material.poisson == most:
        problems.warn(
            "material.poisson",
            material.poisson,
            f"displacement elements of degree {mesh.degree} lock at this value: F comes out too high",
        )


def _check_mixed(material: Material, mesh: Mesh, problems: Problems) -> None:
    if mesh.degree == 1:
        problems.error("mesh.element", mesh.element, "there is no stable mixed element of degree 1: use 2 or 3")
    if material.poisson <= _LEAST_MIXED:
        problems.error(
            "mesh.element", mesh.element, f"mixed elements are for Poisson's ratios above {_LEAST_MIXED}; "
            'use "auto" or "displacement"',
        )  # fmt: skip


def _check_reference(meshes: tuple[Section, ...], axes: tuple[Axis, ...], problems: Problems) -> None:
    if all(isfinite(mesh.epsilon) for mesh in meshes if isinstance(mesh, Mesh) and mesh.accuracy is None):
        if any(isinstance(mesh, Mesh) and mesh.accuracy is not None for mesh in meshes):
            return
        swept = any(axis.name == "epsilon" for axis in axes)
        problems.warn(
            "mesh.epsilon",
            None,
            f'{"the list has" if swept else "there is"} no "full" case: F_max, F/F_max and speed-up stay empty',
        )
