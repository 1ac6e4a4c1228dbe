"""Reductions: functions from plan to plan that skip work. Users read their docstrings as the reasons."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from epsmesh.plan import estimate
from epsmesh.plan.equivalent_places import EquivalentPlace, Matrix, from_place, mirrored_key, translated_key
from epsmesh.plan.far_fields import far_regions
from epsmesh.plan.interpolation import interpolate_path
from epsmesh.plan.key import case_key, digest
from epsmesh.plan.proportional_depths import ProportionalDepth, depth_key, proportional_to_depth
from epsmesh.plan.steps import MOST_DOFS, MeshStep, OperatorStep, Solve
from epsmesh.plan.symmetry import is_round, model_planes
from epsmesh.plan.work import Plan, Skipped, reason_of
from epsmesh.shapes.body import Body
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case
from epsmesh.study.closure import FarRegion

# With fewer Poisson's ratios, each is solved: a reduced basis needs about five solutions itself.
_FEWEST_RATIOS = 12
_OF_TIME = "Histories of the depth and relaxation need no solve of their own."
_LONE_DEPTHS = (
    "No initial guess from other depths: each depth of this tool has its own mesh. With probe.mesh_depths all depths "
    "share one mesh."
)


def skip_beyond_body(plan: Plan) -> Plan:
    """If ε extends beyond the body, the case is the full order, for every `outside`."""
    keys = [case_key(solve.case, folded=True) if solve.case.is_full else solve.key for solve in plan.solves]
    return _merged(plan, keys, "full", reason_of(skip_beyond_body))


def skip_duplicates(plan: Plan) -> Plan:
    """Equal cases are solved once."""
    reason = reason_of(skip_duplicates)
    if any(solve.case.probe.history for solve in plan.solves):
        reason = f"{reason} {_OF_TIME}"
    return _merged(plan, [solve.key for solve in plan.solves], "duplicates", reason)


def skip_scaled(plan: Plan) -> Plan:
    """F is proportional to Young's modulus and mostly to the depth: cases that differ only in these are solved once.

    It is proportional to the depth if the contact area is constant, displacements are small and there is no slit.
    """
    first: dict[str, Case] = {}
    deeper: dict[tuple[int, ...], ProportionalDepth] = {}
    keys = []
    for solve in plan.solves:
        # A record belongs to one depth: the study's first one is solved for the others.
        text = depth_key(solve.case)
        case = first.setdefault(text, solve.case) if text else solve.case
        if case.probe.depth != solve.case.probe.depth:
            deeper |= dict.fromkeys(solve.serves, proportional_to_depth(solve.case, case))
        keys.append(case_key(case, folded=True, scaled=True))
    return _merged(replace(plan, proportional=deeper), keys, "scaling", reason_of(skip_scaled))


def skip_mirrored(plan: Plan) -> Plan:
    """Of places that a reflection or rotation of the body maps onto each other, one is solved."""
    return _without_places(plan, "mirrored", skip_mirrored, mirrored_key, of_scene=True)


def skip_translated(plan: Plan) -> Plan:
    """A column, or a half ball in a half-space, is the same anywhere on flat tissue: it is solved once."""
    return _without_places(plan, "translated", skip_translated, translated_key, of_scene=False)


def _without_places(
    plan: Plan,
    name: str,
    reduction: Callable[[Plan], Plan],
    key_of: Callable[[Case, bool], tuple[str, Matrix] | None],
    *,
    of_scene: bool,
) -> Plan:
    """Solve only the first of all cases with the same ``key_of``, which also returns the matrix to a common frame.

    ``of_scene``: the whole body is mapped onto itself, too.
    """
    first: dict[str, tuple[Solve, Matrix]] = {}
    places: dict[tuple[int, ...], EquivalentPlace] = {}
    keys = [solve.key for solve in plan.solves]
    for number, solve in enumerate(plan.solves if _sweeps_places(plan) else ()):
        if (found := key_of(solve.case, "scaling" in plan.used)) is None:
            continue
        text, matrix = found
        other, there = first.setdefault(text, (solve, matrix))
        if other is not solve:
            keys[number] = other.key
            place = EquivalentPlace(other.case.index, from_place(there, matrix), of_scene)
            places |= dict.fromkeys(solve.serves, place)
    plan = replace(plan, equivalent=places | dict(plan.equivalent))
    return _merged(plan, keys, name, reason_of(reduction))


def _sweeps_places(plan: Plan) -> bool:
    """Return whether the study has several places or directions of the tool."""
    found = {(probe.at, probe.axis, getattr(probe, "direction", None)) for probe in plan.study.probes}
    return len(found) > 1


def use_axisymmetry(plan: Plan) -> Plan:
    """Round scenes are solved in two dimensions, on a mesh of their own, unless `[mesh]` gives meshes to compare."""
    if not _asks_for_accuracy_or_truncation(plan):
        return plan
    solves = tuple(map(_on_meridian, plan.solves))
    count = sum(solve.axisymmetric for solve in solves)
    return plan.with_solves(solves).skipping("axisymmetric", count, reason_of(use_axisymmetry))


def _on_meridian(solve: Solve) -> Solve:
    """Return an axisymmetric solve on its meridian; its force differs from that of the 3D mesh, so does its key."""
    if not is_round(solve.case) or solve.case.mesh.model != "auto":
        return solve
    return replace(solve, axisymmetric=True, key=solve.key if solve.goal else digest(f"{solve.key} axisymmetric"))


def use_symmetry(plan: Plan) -> Plan:
    """Body, support and probe are symmetric: half or a quarter of the body is solved, with two equal jaws an eighth."""
    solves = tuple(_mirrored(solve) for solve in plan.solves)
    count = sum(bool(solve.mirrors) for solve in solves)
    return replace(plan, solves=solves).skipping("symmetry", count, reason_of(use_symmetry))


def share_meshes(plan: Plan) -> Plan:
    """Cases with the same geometry and element sizes share one mesh, and its assembly if they differ only in material.

    With ``outside = "green"``, places share both, and one mesh gives the far fields of many places.
    """
    regions = far_regions([solve.case for solve in plan.solves])
    plan = replace(plan.with_solves([_with_far_region(solve, regions) for solve in plan.solves]), shared=True)
    return plan.skipping("shared-mesh", len(plan.solves) - len(plan.meshes), reason_of(share_meshes))


def _with_far_region(solve: Solve, regions: Mapping[Body, FarRegion]) -> Solve:
    """Return ``solve`` with a far field from a mesh of many places; its force differs slightly, so does its key."""
    region = regions.get(solve.case.body) if solve.case.has_own_far_field else None
    if region is None:
        return solve
    key = digest(f"{solve.key} far field {region}")
    return replace(solve, key=key, case=replace(solve.case, far_region=region))


def start_from_neighbours(plan: Plan) -> Plan:
    """Solves start from the solutions of neighbouring cases (ν, places, or depths) as the initial guess.

    Depths are neighbours if contact is found or displacements are large; else Poisson's ratios or places.
    """
    plan = replace(plan, reuse=True)
    operators = [operator for step in plan.meshes for operator in step.operators if not step.axisymmetric]
    count = sum(len(operator.solves) - _fresh(operator) for operator in operators)
    if not count and _has_lone_depths(operators) and not any(solve.goal for solve in plan.solves):
        return replace(plan, skipped=(*plan.skipped, Skipped("initial-guess", 0, _LONE_DEPTHS)))
    return plan.skipping("initial-guess", count, reason_of(start_from_neighbours))


def use_reduced_basis(plan: Plan) -> Plan:
    """Of many Poisson's ratios a few are solved; a reduced basis gives the others, with a bound on the error of F."""
    if not plan.shared:
        return plan
    operators = [operator for step in plan.meshes for operator in step.operators if _sweeps_ratios(operator)]
    obstacles = [obstacle("reduced basis", operator.case) for operator in operators]
    tolerance = plan.study.planning.reduced_basis_error
    many = {
        solve.key
        for operator, obstacle in zip(operators, obstacles, strict=True)
        if not obstacle
        for solve in operator.solves
    }
    if operators and not many:
        reason = f"No reduced basis: {obstacles[0]}; each case is solved."
        return replace(plan, skipped=(*plan.skipped, Skipped("reduced", 0, reason)))
    plan = plan.with_solves(
        [
            replace(s, key=digest(f"{s.key} reduced {tolerance!r}"), reduced=True) if s.key in many else s
            for s in plan.solves
        ]
    )
    return plan.skipping("reduced", len(many), reason_of(use_reduced_basis))


def _sweeps_ratios(operator: OperatorStep) -> bool:
    """Return whether a reduced basis suits an operator: many materials, displacement elements, one force.

    The operator of displacement elements depends on one parameter; the error bound is on the work of one movement.
    """
    solve, case = operator.solves[0], operator.case
    ratios = {solve.key if case.body.regions else solve.case.material.poisson for solve in operator.solves}
    return (
        len(ratios) >= _FEWEST_RATIOS
        and case.way.element == "displacement"
        and solve.goal is None
        and not solve.axisymmetric
        and case.movements == 1 + case.is_closed
    )


def condense_sweeps(plan: Plan) -> Plan:
    """Ten or more depths on one mesh of a small body are solved on the contact surface, to which it is condensed once.

    The tool finds its contact there.
    """
    if not plan.shared:
        return plan
    plan = replace(plan, condensed=True)
    steps = [step for step in plan.meshes if not step.axisymmetric and _is_small(step)]
    count = sum(len(operator.solves) for step in steps for operator in step.operators if operator.is_condensed)
    return plan.skipping("condensed", count, reason_of(condense_sweeps))


def skip_stored(plan: Plan, stored: frozenset[str]) -> Plan:
    """Stored cases are read, not computed again."""
    if plan.study.solve.timing:
        stored &= plan.all_keys - frozenset(plan.keys)
    found = frozenset(solve.key for solve in plan.solves) & stored
    kept = tuple(solve for solve in plan.solves if solve.key not in found) if found else plan.solves
    plan = replace(plan, solves=kept, stored=found)
    return plan.skipping("stored", len(found), reason_of(skip_stored))


# In the order of their application.
REDUCTIONS: dict[str, Callable[[Plan], Plan]] = {
    "duplicates": skip_duplicates,
    "full": skip_beyond_body,
    "scaling": skip_scaled,
    "mirrored": skip_mirrored,
    "translated": skip_translated,
    "axisymmetric": use_axisymmetry,
    "symmetry": use_symmetry,
    "shared-mesh": share_meshes,
    "initial-guess": start_from_neighbours,
    "reduced": use_reduced_basis,
    "condensed": condense_sweeps,
    "path": interpolate_path,
}


def _merged(plan: Plan, keys: Sequence[str], name: str, reason: str) -> Plan:
    """Return the plan in which solves of the same one of ``keys`` are one, the first, which serves the cases of all."""
    if len({*keys}) == len(keys) and all(solve.key == key for solve, key in zip(plan.solves, keys, strict=True)):
        return plan
    same: dict[str, list[Solve]] = {}
    for solve, key in zip(plan.solves, keys, strict=True):
        same.setdefault(key, []).append(solve)
    changed = {solve.key: key for solve, key in zip(plan.solves, keys, strict=True) if solve.key != key}
    merged = tuple(_joined(key, solves) for key, solves in same.items())
    of_cases = tuple(changed.get(key, key) for key in plan.keys) if changed else plan.keys
    count = sum(_of_paths(plan, solves) - 1 for solves in same.values())
    return replace(plan, solves=merged, keys=of_cases).skipping(name, count, reason)


def _of_paths(plan: Plan, solves: Sequence[Solve]) -> int:
    """Return the number of solves; of an insertion, whose stages may be one state, that of different paths."""
    if not plan.study.is_insertion:
        return len(solves)
    stages = [axis.is_stage for axis in plan.study.axes]
    paths = [tuple(n for n, is_stage in zip(one.case.index, stages, strict=True) if not is_stage) for one in solves]
    return len(set(paths))


def _joined(key: str, solves: Sequence[Solve]) -> Solve:
    first, *others = solves
    if not others and first.key == key:
        return first
    return replace(first, key=key, serves=tuple(index for solve in solves for index in solve.serves))


def _mirrored(solve: Solve) -> Solve:
    use = solve.case.mesh.model == "auto" and not solve.axisymmetric
    return replace(solve, mirrors=model_planes(solve.case)) if use else solve


def _fresh(operator: OperatorStep) -> int:
    """Return the number of an operator's solves without an initial guess from a neighbour."""
    return len(operator.sweeps) if operator.case.way.is_followed else 1


def _has_lone_depths(operators: list[OperatorStep]) -> bool:
    """Return whether solves with different meshes differ only in the depth."""
    seen = set[str]()
    for solve in (solve for operator in operators for solve in operator.solves):
        case, probe = solve.case, solve.case.probe
        if probe.is_unilateral and probe.jaw is None and any(getattr(probe, key) is None for key in probe.SWEPT):
            of_tool = probe.height, probe.model_dump(exclude={"depth", "history"})
            same = repr((case.body, case.tissues, case.mesh, of_tool))
            if same in seen:
                return True
            seen.add(same)
    return False


def _is_small(step: MeshStep) -> bool:
    """Return whether a body is estimated to be small enough for condensation."""
    case = step.case
    cells = estimate.cells(case) * 0.5 ** len(step.mirrors)
    return (
        case.way.element == "displacement"
        and case.solve.method != "iterative"
        and (estimate.dofs(cells, case.mesh.degree) <= MOST_DOFS)
    )


def _asks_for_accuracy_or_truncation(plan: Plan) -> bool:
    """Return whether a study varies scenes and truncation only: no element sizes, no elements, no ε of a whole body."""
    if any(obstacle("meridian, in a comparison", solve.case) for solve in plan.solves):
        return False
    swept = {axis.key for axis in plan.study.axes if axis.section == "mesh"}
    if swept - {"epsilon", "outside", "accuracy"}:
        return False
    return all(solve.goal or solve.case.is_full or solve.case.is_truncated for solve in plan.solves)
