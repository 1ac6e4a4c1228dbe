"""The plan of a study: the steps that compute its cases, and what each reduction skipped, and why."""

from collections import Counter
from collections.abc import Collection, Hashable
from dataclasses import replace
from math import isnan
from operator import is_

from epsmesh.plan.key import case_key, normalised, reference_key
from epsmesh.plan.recipe import friction_bar, rungs_for, takes_most
from epsmesh.plan.reductions import REDUCTIONS, skip_stored
from epsmesh.plan.shard import Shard, take
from epsmesh.plan.steps import Solve
from epsmesh.plan.symmetry import is_round, model_planes
from epsmesh.plan.thin import refuse_thin
from epsmesh.plan.work import NO_RECORD, EndPlans, Plan, Skipped
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.capabilities.refusals import STEPS_IN_SPACE
from epsmesh.study.case import Case
from epsmesh.study.ends import ends_of
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.schema import Mesh, Solving
from epsmesh.study.sweep import Study
from epsmesh.study.way import Motion

__all__ = [
    "EXACT",
    "Plan",
    "Skipped",
    "ask_for_exact",
    "declare",
    "first_attempts",
    "leave_out_stored",
    "make_plan",
    "of_unit_scene",
]

_RUBS = (
    "Friction has an error bar of its own, expected up to {:.2g} % of F, which finer meshes keep: an accuracy below "
    "twice that takes longer than estimated, or is not reached ({} solves)."
)
# Relative error of F_exact, or its share of the study's accuracy: well below the errors of the study.
EXACT, _EXACT_SHARE = 1e-3, 0.3
# A slit has many edges: an error of 1e-3 would need three times the cells and ten times the time.
EXACT_OF_SLIT = 3e-3
_SEEKS = (
    "Forces are given: these solves are at the expected depths. Further ones follow, until the depth of each case is "
    "found: none where F is proportional to the depth, else mostly three to five. F_exact is at the depths found."
)
_OFF_BODY = "Places where the tool does not touch the body need no solve."


def declare(study: Study) -> Plan:
    """Return the plan that solves every case of ``study`` by itself."""
    found = [None if case.no_contact else _declared(case) for case in study.cases()]
    keys = tuple(solve.key if solve else NO_RECORD for solve in found)
    plan = Plan(study, tuple(solve for solve in found if solve), keys)
    return plan.skipping("no contact", keys.count(NO_RECORD), _OFF_BODY)


def _declared(case: Case) -> Solve:
    return Solve(case_key(case), case, (case.index,), goal=case.mesh.accuracy)


def make_plan(
    study: Study,
    stored: Collection[str] = (),
    without: Collection[str] = (),
    shard: Shard | None = None,
) -> Plan:
    """Return the plan of ``study`` after all reductions; ``stored`` are the keys of stored records.

    ``without`` names reductions not to use, besides those of the study; "all" is all of them. A timing study uses none:
    each case is computed alone. ``shard`` selects a part before stored cases are skipped, so that all shards split
    the study in the same way.

    Raises:
        ValueError: if ``without`` has an unknown name.
        StudyError: if the study leaves to its measured curves what cases need, asks for an accuracy of time steps in
            three dimensions, or has a layer or region too thin to be meshed.
    """
    if study.lacking:
        raise StudyError(study.file, study.lacking)
    left_out = {*without, *study.planning.without}
    if unknown := left_out - {*REDUCTIONS, "stored", "all"}:
        raise ValueError(f"unknown reduction {', '.join(sorted(unknown))}; there are {', '.join(REDUCTIONS)}")
    plan = declare(study)
    if not study.solve.timing and "all" not in left_out:
        for name, reduction in REDUCTIONS.items():
            if name not in left_out:
                plan = reduction(plan)
                plan = replace(plan, used=plan.used | {name})
    if any(solve.goal is not None and solve.case.way.in_time and not solve.axisymmetric for solve in plan.solves):
        raise StudyError(study.file, [Problem("probe.history", None, STEPS_IN_SPACE)])
    plan = _seeking(plan) if study.seeks_depths else ask_for_exact(plan)
    plan = take(first_attempts(plan), shard) if shard is not None else ask_for_ends(plan, without)
    plan = first_attempts(leave_out_stored(plan, stored, without))
    refuse_thin(plan.solves, study.file)
    return _told_of_friction(plan)


def _told_of_friction(plan: Plan) -> Plan:
    """Return the plan with a word on accuracies of which friction's own bar is expected to take most."""
    bars = [
        friction_bar(solve.case)
        for solve in plan.solves
        if solve.goal is not None and not solve.axisymmetric and takes_most(solve.case, solve.goal)
    ]
    if not bars:
        return plan
    return replace(plan, skipped=(*plan.skipped, Skipped("accuracy", 0, _RUBS.format(100 * max(bars), len(bars)))))


def _seeking(plan: Plan) -> Plan:
    """Return the plan of the first trials of depths at given forces. F_exact follows, at the depths that are found."""
    return replace(plan, skipped=(*plan.skipped, Skipped("depths", 0, _SEEKS)))


def leave_out_stored(plan: Plan, stored: Collection[str], without: Collection[str] = ()) -> Plan:
    """Return ``plan`` without the solves whose records are ``stored``, unless ``without`` or the study keeps them."""
    kept = {"stored", "all"} & {*without, *plan.study.planning.without}
    return plan if kept else skip_stored(plan, frozenset(stored))


def first_attempts(plan: Plan) -> Plan:
    """Return the plan in which every solve with an accuracy has its first mesh, and further ones to try later."""
    solves = tuple(map(_first_attempt, plan.solves))
    return plan if all(map(is_, solves, plan.solves)) else replace(plan, solves=solves)


def _first_attempt(solve: Solve) -> Solve:
    if solve.goal is None or not isnan(solve.expected):
        return solve
    return replace(solve, later=rungs_for(solve.case, solve.goal)).again()


def ask_for_exact(plan: Plan) -> Plan:
    """Add F_exact of every scene, once for all meshes, Young's moduli and depths, which F is proportional to.

    It is left out at large displacements, beside `mesh.accuracy` unless the study has `exact = true`, and where places
    of a path are interpolated.
    """
    study = plan.study
    if not study.solve.exact or plan.place_paths:
        return plan
    accuracy = min([EXACT, *(solve.goal * _EXACT_SHARE for solve in plan.solves if solve.goal)])
    found: dict[str, Solve] = {}
    unasked: dict[str, Solve] = {}
    first: dict[str, Solve] = {}
    keys, without = [], Counter[str]()
    # Meshes of a scene share F_exact, and what keeps it from the scene.
    of_scenes: dict[Hashable, tuple[str, Solve | None]] = {}
    for index in study.indices():
        source = place.of if (place := plan.equivalent.get(index)) and place.of_scene else index
        source = deeper.of if (deeper := plan.proportional.get(source)) else source
        scenes = study.scene(index), study.scene(source)
        if scenes not in of_scenes:
            reason, solve = _exact_of(study, index, source, accuracy)
            of_scenes[scenes] = reason, solve and first.setdefault(solve.key, solve)
        reason, solve = of_scenes[scenes]
        if solve is None:
            keys.append(NO_RECORD)
            without[reason] += bool(reason)
            continue
        is_wanted = study.solve.wants_exact(study.mesh(index))
        keys.append(solve.key if is_wanted else NO_RECORD)
        (found if is_wanted else unasked).setdefault(solve.key, solve)
    for reason, count in without.items():
        plan = plan.skipping("exact", count, f"F_exact is not computed: {reason}.")
    plan = replace(plan, unasked=tuple(unasked.values()))
    if not any(keys):
        return plan
    return replace(plan, solves=(*plan.solves, *map(of_unit_scene, found.values())), reference_keys=tuple(keys))


def _exact_of(
    study: Study, index: tuple[int, ...], source: tuple[int, ...], accuracy: float
) -> tuple[str, Solve | None]:
    """Return the solve for F_exact of the case at ``index``, whose force is that of ``source``; or why there is none.

    There is no reason to report where the tool does not touch the body.
    """
    case = study.case(index)
    if case.no_contact or (reason := obstacle("F_exact", case)):
        return "" if case.no_contact else reason, None
    case = study.case(source)
    enough = max(accuracy, EXACT_OF_SLIT) if case.way.motion is Motion.SLIT else accuracy
    return "", Solve(reference_key(case, enough), case, goal=enough, is_reference=True)


def of_unit_scene(solve: Solve) -> Solve:
    """Return the solve for F_exact with the scene for E = 1 and depth = 1, in three dimensions or on the meridian."""
    mesh = Mesh.model_construct({"accuracy"}, accuracy=solve.goal)
    solve = replace(solve, case=replace(normalised(solve.case), mesh=mesh, solve=Solving(), outputs=()))
    if is_round(solve.case):
        return replace(solve, axisymmetric=True)
    return replace(solve, mirrors=model_planes(solve.case))


def ask_for_ends(plan: Plan, without: Collection[str] = ()) -> Plan:
    """Add the cases with each identified parameter, and what an image leaves open, at the ends of its bar."""
    ends = []
    solves = {solve.key: solve for solve in plan.solves}
    for end in ends_of(plan.study):
        low, high = (make_plan(study, without=without) if study else None for study in (end.low, end.high))
        ends.append(EndPlans(end.unknown, low, high, end.of_image))
        for found in (low, high):
            for solve in found.solves if found else ():
                solves.setdefault(solve.key, replace(solve, serves=(), end_of=end.unknown))
    return replace(plan, solves=tuple(solves.values()), ends=tuple(ends)) if ends else plan
