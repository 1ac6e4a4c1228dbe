"""Physical sense of a mesh: its sizes, and whether they fit the body, the probe and the material."""

from collections.abc import Sequence
from math import inf, isfinite, isinf

from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import is_level
from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.grasp import opposite
from epsmesh.shapes.probe import ON_EDGE, Probe
from epsmesh.shapes.section import in_mm
from epsmesh.study.axis import Axis
from epsmesh.study.place import held_gap
from epsmesh.study.problems import Problems
from epsmesh.study.regions import tissues_of
from epsmesh.study.schema import Material, Mesh

# Displacement elements lock as ν nears ½: from the first value on visibly, from the second on F is worth nothing
# (benchmarks/results/coverage.md), and a number that looks like any other would be returned for it.
_LOCKING = {1: (0.45, 0.45), 2: (0.49, 0.495), 3: (0.49, 0.495)}

# Mixed elements keep λ = μ, which is ν = 0.25, with the displacement and give the rest to the pressure.
_LEAST_MIXED = 0.25


def check_sizes(mesh: Mesh, problems: Problems) -> None:
    """Report sizes of elements that contradict each other."""
    if mesh.fine > mesh.coarse:
        problems.error("mesh.fine", in_mm(mesh.fine), f"must be at most coarse = {in_mm(mesh.coarse)}")
    if mesh.rim is not None and mesh.rim > mesh.fine:
        problems.error("mesh.rim", in_mm(mesh.rim), f"must be at most fine = {in_mm(mesh.fine)}")
    if isfinite(mesh.fine) and mesh.epsilon < mesh.fine:
        problems.warn(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"is smaller than one element inside it, fine = {in_mm(mesh.fine)}: meshes of such ε hardly differ",
        )


def check_linear(body: Body, material: Material, mesh: Mesh, problems: Problems) -> None:
    """Report a linear body beyond ε of a body that is linear anyway."""
    if mesh.outside == "linear" and not body.main(material).is_large:
        problems.error(
            "mesh.outside",
            mesh.outside,
            'is linear elasticity beyond epsilon, but law = "linear" is linear everywhere: use outside = '
            '"coarse", or a law of large displacements',
        )


def check_chosen(meshes: Sequence[Mesh], problems: Problems) -> None:
    """Report an ε or an `outside` without effect: with `accuracy` all sizes are chosen, and no ε is that of full order.

    Warn of cut-out columns alone: the accuracy is that of their force, not of the body's.
    """
    chosen = [mesh for mesh in meshes if mesh.accuracy is not None]
    for mesh in chosen:
        if mesh.outside != "coarse" and "epsilon" not in mesh.model_fields_set:
            what = "beyond which the body is linear" if mesh.outside == "linear" else "at which the body is cut"
            problems.error(
                "mesh.outside", mesh.outside, f'needs epsilon, {what}: write epsilon = "10 mm", or omit outside'
            )
    if chosen and all(isfinite(mesh.epsilon) and not mesh.keeps_all for mesh in meshes):
        problems.warn(
            "mesh.outside",
            chosen[0].outside,
            "cuts the body at epsilon in every case, and `accuracy` is that of the force of this column, not of the "
            'body: for F of the body omit outside and epsilon; to compare, add "full" to epsilon',
        )
    idle = [mesh for mesh in chosen if mesh.outside == "coarse" and "epsilon" in mesh.model_fields_set]
    if idle and len(chosen) == len(meshes) and all(mesh.outside == "coarse" for mesh in chosen):
        radii = dict.fromkeys("full" if isinf(mesh.epsilon) else in_mm(mesh.epsilon) for mesh in idle)
        problems.error(
            "mesh.epsilon",
            list(radii) if len(radii) > 1 else next(iter(radii)),
            "has no effect with `accuracy`, for which all sizes are chosen. Omit one of the two, or cut the "
            "body at "
            'epsilon: outside = "free"',
        )
    elif any(isfinite(mesh.epsilon) for mesh in idle):
        problems.error(
            "mesh.outside",
            "coarse",
            "is one case for every epsilon with `accuracy`, for which all sizes are chosen. Omit it: "
            '"full" in epsilon is the whole body',
        )


def held_gaps(body: Body, probe: Probe, mesh: Mesh) -> dict[str, float]:
    """Return the distances (m) between the probe's edge and fixed faces beside it, by the key that sets them."""
    frame, gaps = probe.frame_on(body), {}
    if isinstance(body, FromFile) or not is_level(body, frame):
        if isfinite(gap := held_gap(body, probe, frame)):
            gaps["body.fixed"] = gap
    elif (beside := body.hold.gap(probe.gap(body, frame))) is not None:
        gaps["body.fixed"] = beside
    if mesh.outside != "free" and isfinite(column := mesh.column(body.reach(frame))):
        gaps["mesh.epsilon"] = column - probe.expected_radius
    return {key: gap for key, gap in gaps.items() if gap > 0}


def check_column(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Report a column that the contact is not inside."""
    frame = probe.frame_on(body)
    column = mesh.column(body.reach(frame))
    if mesh.outside == "free" and column <= (1 + ON_EDGE) * probe.half_length:
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"is too small: the {probe.shape} touches tissue outside the column of that radius; must be above half its "
            f'length, {in_mm(probe.half_length)}; or use outside = "coarse"',
        )


def check_gap(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Report a gap between the probe, or a second jaw, and a fixed face that has no room for an element."""
    if _meets_held_column(body, probe, mesh):
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"is too small: the side of the column is fixed, and the {probe.shape} reaches it; must be above "
            f'{in_mm(probe.pressed)}, the radius of the tool; or use outside = "coarse" or "free"',
        )
        return
    if mesh.accuracy is not None and "rim" not in mesh.model_fields_set:
        return
    tools = {"tool": probe} | ({} if (jaw := opposite(body, probe)) is None else {"second jaw": jaw})
    for name, tool in tools.items():
        for key, gap in held_gaps(body, tool, mesh).items():
            if gap < mesh.rim_size(tool.half_width):
                problems.error(
                    key,
                    in_mm(mesh.epsilon) if key == "mesh.epsilon" else None,
                    f"leaves {in_mm(gap)} between the {name}'s edge and a fixed face, less than one element. Use a "
                    f"`rim` below {in_mm(gap)}",
                )


def _meets_held_column(body: Body, probe: Probe, mesh: Mesh) -> bool:
    """Return whether the probe presses tissue that is fixed: there is no such displacement."""
    frame = probe.frame_on(body)
    if mesh.outside != "fixed" or probe.slit is not None:
        return False
    column = mesh.column(body.reach(frame))
    return column <= probe.pressed * (1 + ON_EDGE)


def check_epsilon(mesh: Mesh, probe: Probe, problems: Problems) -> None:
    """Warn of a fine mesh that the contact may leave, and of a rim that does not resolve the probe."""
    if mesh.epsilon < probe.circumradius:
        reach, is_cut = in_mm(probe.circumradius), mesh.outside in ("free", "fixed")
        if not probe.is_flat:
            what = f"is less than {reach}, up to which the {probe.shape} may touch: contact may leave the fine mesh"
            what += ", but not the column" if is_cut else ""
        else:
            what = f"is less than the tool's radius {reach}: part of the contact is outside the fine mesh"
            what += ", and the column cuts part of it off" if is_cut else ""
        problems.warn("mesh.epsilon", in_mm(mesh.epsilon), what)
    if mesh.rim_size(probe.half_width) > probe.half_width:
        problems.warn(
            "mesh.rim",
            in_mm(mesh.rim_size(probe.half_width)),
            f"is larger than the tool's half width {in_mm(probe.half_width)}: F may be far off",
        )


def check_support(body: Body, mesh: Mesh, problems: Problems) -> None:
    """Report a support that elements cannot follow."""
    key = "body.fixed" if body.resting is None else "body.support.on"
    body.hold.check(key, body.heights, mesh.fine, problems)


def check_locking(body: Body, material: Material, mesh: Mesh, probe: Probe, problems: Problems) -> None:
    """Check elements against Poisson's ratios of all the materials of a body, and of a tool that deforms."""
    tissues = dict(tissues_of(body, material)) | ({"probe": tool} if (tool := probe.elastic) else {})
    poissons = {f"{key}.poisson": tissue.poisson for key, tissue in tissues.items()}
    is_large = body.main(material).is_large
    if mesh.element_for(max(poissons.values()), is_large=is_large) == "mixed":
        if max(poissons.values()) <= _LEAST_MIXED:
            problems.error(
                "mesh.element",
                mesh.element,
                f'mixed elements need Poisson\'s ratios above {_LEAST_MIXED}; use "auto" or "displacement"',
            )
        return
    visible, most = _LOCKING[mesh.degree]
    of_law = " with a law of large displacements" if is_large else ""
    allowed = min(most, mesh.MIXED_FROM) if is_large else most
    for key, poisson in poissons.items():
        if poisson > allowed:
            problems.error(
                key,
                poisson,
                f"displacement elements of degree {mesh.degree} lock: must be at most {allowed}{of_law}. "
                'Mixed elements allow values up to 0.5: use degree 2 or 3, and element = "auto"',
            )
        elif poisson > visible or poisson == most:
            problems.warn(
                key, poisson, f"displacement elements of degree {mesh.degree} lock at this value: F is too large"
            )


def check_reference(
    meshes: Sequence[Mesh], axes: tuple[Axis, ...], placed: Sequence[tuple[Body, Probe]], problems: Problems
) -> None:
    """Warn of a study without a full-order case to compare with, and of an ε that is one under another name."""
    epsilons = {mesh.epsilon for mesh in meshes if mesh.accuracy is None}
    if any(map(isinf, epsilons)) or any(mesh.accuracy is not None for mesh in meshes):
        return
    farthest = max((body.farthest(probe.frame_on(body)) for body, probe in placed[:1]), default=inf)
    if beyond := min((epsilon for epsilon in epsilons if epsilon >= farthest), default=None):
        found, what = in_mm(beyond), 'extends beyond the body: write "full" in its place. Without a "full" case'
    else:
        swept = any(axis.name == "epsilon" for axis in axes)
        found, what = None, f'{"the list has" if swept else "there is"} no "full" case:'
    problems.warn("mesh.epsilon", found, f"{what} the dataset has no F_max, F/F_max and speed-up")
