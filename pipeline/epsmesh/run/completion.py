"""What a study needs beyond its first plan, since earlier results decide it; and what follows without a solve.

Insertions need further states; paths further places, until F at the others can be interpolated; and given forces
further depths.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from epsmesh.plan.interpolation import together
from epsmesh.plan.plan import Plan, first_attempts
from epsmesh.plan.steps import Solve
from epsmesh.run import given_force
from epsmesh.run.record import Record
from epsmesh.states import OK

# A smaller `path_error` solves more places; without one, all are solved.
_EXCEEDS = (
    "interpolated: its error bar exceeds the accuracy of solved places, {:.2g} %, to which [plan] path_error adds"
)


def complete(
    plan: Plan, records: dict[str, Record], get: Callable[[Collection[str]], Mapping[str, Record]]
) -> Plan | None:
    """Return the plan of what is to be solved besides, of which ``get`` has no records by keys; None at the end.

    Stored records are added to ``records``, and at the end those of interpolated places.
    """
    if plan.study.is_insertion:
        from epsmesh.insertion.paths import complete as complete_insertions  # noqa: PLC0415 (it loads scipy)

        return complete_insertions(plan, records, get)
    while further := lacking(plan, records):
        found = {key: record for key, record in get(further.all_keys).items() if key not in records}
        if not found:
            return further
        records |= found
    for path in (path for one in _with_ends(plan) for path in one.place_paths):
        found_there = path.interpolated(records)
        records |= {
            solve.key: _record(solve, *found_there[solve.key]) for solve in path.solves if solve.key in found_there
        }
    return None


def lacking(plan: Plan, records: Mapping[str, Record]) -> Plan | None:
    """Return the plan of the places to solve next along paths, or of the next depths; None if there are none."""
    if plan.study.seeks_depths:
        return given_force.lacking(plan, records)
    solves: dict[str, Solve] = {}
    for one in _with_ends(plan):
        error = one.study.planning.path_error or 0.0
        wanted = [solve for path in one.place_paths for solve in path.missing(records, error)]
        solves |= {solve.key: solve for solve in together(one.place_paths, wanted) if solve.key not in records}
    return _plan_of(plan, solves)


def possible(plan: Plan, records: Mapping[str, Record]) -> Plan | None:
    """Return the plan of all that may have to be solved besides ``plan``; None if that is nothing, or unknown."""
    if plan.study.seeks_depths:
        return None
    if plan.study.is_insertion:
        from epsmesh.insertion.paths import possible as possible_states  # noqa: PLC0415 (it loads scipy)

        return possible_states(plan, records)
    planned = {solve.key for solve in plan.solves}
    if not planned and lacking(plan, records) is None:
        return None
    solves = [solve for one in _with_ends(plan) for path in one.place_paths for solve in path.solves]
    return _plan_of(plan, {solve.key: solve for solve in solves if solve.key not in planned | records.keys()})


def _with_ends(plan: Plan) -> list[Plan]:
    return [plan, *(one for end in plan.ends for one in (end.low, end.high) if one)]


def _plan_of(plan: Plan, solves: Mapping[str, Solve]) -> Plan | None:
    if not solves:
        return None
    bare = replace(plan, solves=tuple(solves.values()), keys=tuple(solves), place_paths=(), ends=(), unasked=())
    return first_attempts(bare)


def _record(solve: Solve, force: float, error: float) -> Record:
    """Return the record of an interpolated place: F (N) with its relative error bar, and nothing else.

    A message says if the bar is larger than the accuracy, which is that of solved places.
    """
    scale, goal = solve.case.scale, solve.goal
    exceeds = goal is not None and error > goal
    return Record(
        solve.key,
        OK,
        _EXCEEDS.format(100 * (goal or 0.0)) if exceeds else "",
        origin="interpolated",
        young=scale.stress,
        depth=scale.length,
        force=force,
        force_error=error,
        dofs=-1,
        cells=-1,
        iterations=-1,
    )
