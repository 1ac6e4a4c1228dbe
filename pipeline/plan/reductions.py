"""What is not done: each reduction is a function from plan to plan whose docstring is the reason that users read."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from pipeline.plan import estimate
from pipeline.plan.equivalent_places import EquivalentPlace, Matrix, from_place, image_key, moved_key
from pipeline.plan.far_fields import far_regions
from pipeline.plan.key import case_key, digest
from pipeline.plan.proportional_depths import ProportionalDepth, depth_key, proportional_to_depth
from pipeline.plan.steps import MOST_DOFS, MeshStep, OperatorStep, Solve, mesh_steps
from pipeline.plan.symmetry import is_round, model_planes
from pipeline.plan.work import Plan, Struck, reason_of
from pipeline.shapes.body import Body
from pipeline.study.capabilities import obstacle
from pipeline.study.closure import FarRegion
from pipeline.study.sweep import Case

# Fewer Poisson's ratios than this are solved one by one: a basis needs about five solutions itself.
_FEWEST_RATIOS = 8
_LONE_DEPTHS = (
    "No start from neighbouring depths: each depth of this tool has a mesh of its own; probe.depth_range makes it one "
    "for all."
)


def strike_past_body(plan: Plan) -> Plan:
    """An ε that reaches past the body is the full order, whatever becomes of the outside."""
    return _rekeyed(plan, "full", strike_past_body, lambda case: case_key(case, folded=True))


def strike_duplicates(plan: Plan) -> Plan:
    """The same case twice is solved once."""
    return _merged(plan, "duplicates", reason_of(strike_duplicates))


def strike_scaled(plan: Plan) -> Plan:
    """F is proportional to Young's modulus and, unless contact grows with it, displacements are large or the tool is in
    a slit, to the depth: cases that differ in them only are solved once.
    """
    first: dict[str, Case] = {}
    deeper: dict[tuple[int, ...], ProportionalDepth] = {}
    for solve in plan.solves:
        text = depth_key(solve.case)
        if text and (other := first.setdefault(text, solve.case)).probe.depth != solve.case.probe.depth:
            deeper |= dict.fromkeys(solve.serves, proportional_to_depth(solve.case, other))

    def key(case: Case) -> str:
        # Records are those of a depth: which one is solved for the others is the study's order.
        text = depth_key(case)
        return case_key(first[text] if text else case, folded=True, scaled=True)

    return _rekeyed(replace(plan, proportional=deeper), "scaling", strike_scaled, key)


def strike_images(plan: Plan) -> Plan:
    """Places that are each other's image, mirrored or turned about the body's axis, are solved once."""
    return _struck_places(plan, "images", strike_images, image_key, of_scene=True)


def strike_moved(plan: Plan) -> Plan:
    """A column, or a half ball that a half-space closes, is the same anywhere on flat tissue: it is solved once."""
    return _struck_places(plan, "moved", strike_moved, moved_key, of_scene=False)


def _struck_places(
    plan: Plan,
    name: str,
    reduction: Callable[[Plan], Plan],
    key_of: Callable[[Case, bool], tuple[str, Matrix] | None],
    *,
    of_scene: bool,
) -> Plan:
    """Let the first of all solves of which ``key_of`` gives one key, each with the matrix to it, stand for the others.

    ``of_scene`` says that the whole body is the other's image, too.
    """
    first: dict[str, tuple[Solve, Matrix]] = {}
    places: dict[tuple[int, ...], EquivalentPlace] = {}
    solves = list(plan.solves)
    for number, solve in enumerate(plan.solves if _sweeps_places(plan) else ()):
        if (found := key_of(solve.case, "scaling" in plan.used)) is None:
            continue
        text, matrix = found
        other, there = first.setdefault(text, (solve, matrix))
        if other is not solve:
            solves[number] = replace(solve, key=other.key)
            place = EquivalentPlace(other.case.index, from_place(there, matrix), of_scene)
            places |= dict.fromkeys(solve.serves, place)
    plan = replace(plan.with_solves(solves), equivalent=places | dict(plan.equivalent))
    return _merged(plan, name, reason_of(reduction))


def _sweeps_places(plan: Plan) -> bool:
    """Tell whether a tool of the plan's study stands in several places, or in several directions."""
    found = {(probe.at, probe.axis, getattr(probe, "direction", None)) for probe in plan.study.probes}
    return len(found) > 1


def use_axisymmetry(plan: Plan) -> Plan:
    """A round scene of which the mesh is not the question is solved on its meridian, on a mesh of its own."""
    if not _asks_for_accuracy_or_truncation(plan):
        return plan
    solves = tuple(map(_on_meridian, plan.solves))
    count = sum(solve.axisymmetric for solve in solves)
    return plan.with_solves(solves).struck_by("axisymmetric", count, reason_of(use_axisymmetry))


def _on_meridian(solve: Solve) -> Solve:
    """Return a solve of a round scene on its meridian: another force than that of the mesh asked for, another key."""
    if not is_round(solve.case) or solve.case.mesh.model != "auto":
        return solve
    return replace(solve, axisymmetric=True, key=solve.key if solve.goal else digest(f"{solve.key} axisymmetric"))


def use_symmetry(plan: Plan) -> Plan:
    """Body, support and probe are their own mirror image: half or a quarter of the body is solved."""
    solves = tuple(_mirrored(solve) for solve in plan.solves)
    count = sum(bool(solve.mirrors) for solve in solves)
    return replace(plan, solves=solves).struck_by("symmetry", count, reason_of(use_symmetry))


def share_meshes(plan: Plan) -> Plan:
    """Cases on the same geometry and sizes share one mesh, and its set-up if they differ in the material only; half
    balls that the body's own far field closes, in the place, too. The far fields of many places share a mesh as well.
    """
    regions = far_regions([solve.case for solve in plan.solves])
    plan = replace(plan.with_solves([_with_far_region(solve, regions) for solve in plan.solves]), shared=True)
    return plan.struck_by("sharing", len(plan.solves) - len(mesh_steps(plan.solves)), reason_of(share_meshes))


def _with_far_region(solve: Solve, regions: Mapping[Body, FarRegion]) -> Solve:
    """Return ``solve`` with the far field of a mesh that many places share: another force, hence another key."""
    region = regions.get(solve.case.body) if solve.case.has_own_far_field else None
    if region is None:
        return solve
    key = digest(f"{solve.key} far field {region}")
    return replace(solve, key=key, case=replace(solve.case, far_region=region))


def reuse_solutions(plan: Plan) -> Plan:
    """A solve begins from the solutions for neighbouring Poisson's ratios or places, or, where contact is found or
    displacements are large, depths.
    """
    plan = replace(plan, reuse=True)
    operators = [operator for step in plan.meshes for operator in step.operators if not step.axisymmetric]
    count = sum(len(operator.solves) - _fresh(operator) for operator in operators)
    if not count and _has_lone_depths(operators) and not any(solve.goal for solve in plan.solves):
        return replace(plan, struck=(*plan.struck, Struck("reuse", 0, _LONE_DEPTHS)))
    return plan.struck_by("reuse", count, reason_of(reuse_solutions))


def use_reduced_basis(plan: Plan) -> Plan:
    """Many Poisson's ratios on one operator: a few are solved, and the rest follow with a bound on the error of F."""
    if not plan.shared:
        return plan
    operators = [operator for step in plan.meshes for operator in step.operators if _sweeps_ratios(operator)]
    obstacles = [obstacle("reduced basis", operator.case) for operator in operators]
    tolerance = plan.study.planning.tolerance
    many = {
        solve.key
        for operator, obstacle in zip(operators, obstacles, strict=True)
        if not obstacle
        for solve in operator.solves
    }
    if operators and not many:
        reason = f"No reduced basis: {obstacles[0]}, and each is solved."
        return replace(plan, struck=(*plan.struck, Struck("reduced", 0, reason)))
    plan = plan.with_solves(
        [
            replace(s, key=digest(f"{s.key} reduced {tolerance!r}"), reduced=True) if s.key in many else s
            for s in plan.solves
        ]
    )
    return plan.struck_by("reduced", len(many), reason_of(use_reduced_basis))


def _sweeps_ratios(operator: OperatorStep) -> bool:
    """Tell whether an operator is solved for many materials, with displacement elements, whose operator depends on one
    parameter, and for one force: the bound is on the work of one movement, not on forces that several take.
    """
    solve, case = operator.solves[0], operator.case
    ratios = {solve.key if case.body.regions else solve.case.material.poisson for solve in operator.solves}
    return (
        len(ratios) >= _FEWEST_RATIOS
        and case.element == "displacement"
        and solve.goal is None
        and not solve.axisymmetric
        and case.movements == 1 + case.is_closed
    )


def condense_sweeps(plan: Plan) -> Plan:
    """Ten or more depths of a tool that finds its contact, on one mesh of a small body: what may touch is condensed
    once, and each depth is solved on that.
    """
    if not plan.shared:
        return plan
    plan = replace(plan, condensed=True)
    steps = [step for step in plan.meshes if not step.axisymmetric and _is_small(step)]
    count = sum(len(operator.solves) for step in steps for operator in step.operators if operator.is_condensed)
    return plan.struck_by("condensed", count, reason_of(condense_sweeps))


def strike_stored(plan: Plan, stored: frozenset[str]) -> Plan:
    """A case whose record is stored is read back."""
    if plan.study.solve.timing:
        stored &= frozenset(plan.reference_keys)
    kept = tuple(solve for solve in plan.solves if solve.key not in stored)
    found = frozenset(solve.key for solve in plan.solves) & stored
    plan = replace(plan, solves=kept, stored=found)
    return plan.struck_by("stored", len(found), reason_of(strike_stored))


# In the order in which they are applied.
REDUCTIONS: dict[str, Callable[[Plan], Plan]] = {
    "duplicates": strike_duplicates,
    "full": strike_past_body,
    "scaling": strike_scaled,
    "images": strike_images,
    "moved": strike_moved,
    "axisymmetric": use_axisymmetry,
    "symmetry": use_symmetry,
    "sharing": share_meshes,
    "reuse": reuse_solutions,
    "reduced": use_reduced_basis,
    "condensed": condense_sweeps,
}


def _rekeyed(plan: Plan, name: str, reduction: Callable[[Plan], Plan], key: Callable[..., str]) -> Plan:
    """Give every solve the key that ``key`` makes of its case, and merge those that then agree."""
    plan = plan.with_solves([replace(solve, key=key(solve.case)) for solve in plan.solves])
    return _merged(plan, name, reason_of(reduction))


def _merged(plan: Plan, name: str, reason: str) -> Plan:
    unique: dict[str, list[Solve]] = {}
    for solve in plan.solves:
        unique.setdefault(solve.key, []).append(solve)
    merged = tuple(replace(same[0], serves=_joined(same)) if len(same) > 1 else same[0] for same in unique.values())
    return replace(plan, solves=merged).struck_by(name, len(plan.solves) - len(merged), reason)


def _joined(solves: Iterable[Solve]) -> tuple[tuple[int, ...], ...]:
    return tuple(index for solve in solves for index in solve.serves)


def _mirrored(solve: Solve) -> Solve:
    use = solve.case.mesh.model == "auto" and not solve.axisymmetric
    return replace(solve, mirrors=model_planes(solve.case)) if use else solve


def _fresh(operator: OperatorStep) -> int:
    """Return how many solves of an operator have no neighbour to begin from."""
    return len(operator.sweeps) if operator.case.is_followed else 1


def _has_lone_depths(operators: list[OperatorStep]) -> bool:
    """Tell whether solves differ in the depth only, and have meshes of their own for that."""
    seen = set[str]()
    for solve in (solve for operator in operators for solve in operator.solves):
        case, probe = solve.case, solve.case.probe
        if probe.is_unilateral and any(getattr(probe, key) is None for key in probe.SWEPT):
            same = repr((case.body, case.tissues, case.mesh, probe.model_dump(exclude={"depth"})))
            if same in seen:
                return True
            seen.add(same)
    return False


def _is_small(step: MeshStep) -> bool:
    """Tell whether a body is small enough to be condensed, as far as can be told before it is meshed."""
    case = step.case
    cells = estimate.cells(case) * 0.5 ** len(step.mirrors)
    return (
        case.element == "displacement"
        and case.solve.method != "iterative"
        and (estimate.dofs(cells, case.mesh.degree) <= MOST_DOFS)
    )


def _asks_for_accuracy_or_truncation(plan: Plan) -> bool:
    """Tell whether a study varies scenes and truncation, but not the mesh: sizes, elements, or ε with all outside."""
    if any(obstacle("meridian of a comparison", solve.case) for solve in plan.solves):
        return False
    swept = {axis.key for axis in plan.study.axes if axis.section == "mesh"}
    if swept - {"epsilon", "outside", "accuracy"}:
        return False
    return all(solve.goal or solve.case.is_full or solve.case.is_truncated for solve in plan.solves)
