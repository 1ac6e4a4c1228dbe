"""The outcome of a study: counts of its cases by state, failures, and cases without contact."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from epsmesh.plan.plan import Plan
from epsmesh.quantities import LARGEST
from epsmesh.run.given_force import at_force, with_depths
from epsmesh.run.record import Record
from epsmesh.states import FAILED, FAILURES, NO_CONTACT, OK, PARTIAL, PENDING, SKIPPED, worst
from epsmesh.study.case import Case
from epsmesh.study.place import CLEAR

if TYPE_CHECKING:
    from epsmesh.insertion.path import Path


def without_contact(case: Case) -> Record | None:
    """Return the record of a case without contact: force 0 if the tool is clear of the body; None with contact.

    A tool over an edge touches the body, and its force is unknown: the case is skipped.
    """
    if not (why := case.no_contact):
        return None
    if why != CLEAR:
        return Record("", SKIPPED, why)
    none = (0.0, 0.0, 0.0)
    return Record(
        "",
        NO_CONTACT,
        why,
        force=0.0,
        force_error=0.0,
        force_vector=none,
        force_vector_error=none,
        energy=0.0,
        largest=dict.fromkeys(LARGEST, 0.0),
        contact_area=0.0,
        contact_radius=0.0,
        contact_area_error=0.0,
        contact_radius_error=0.0,
        slip_area=0.0,
        slip_area_error=0.0,
        friction_force=0.0,
        friction_force_error=0.0,
        torque=0.0,
        torque_error=0.0,
    )


def count_states(plan: Plan, records: Mapping[str, Record]) -> dict[str, int]:
    """Return the number of a plan's cases in each state; for a shard, only its own cases count.

    The stages of a history are one case, and so is an insertion, the path through them.
    """
    plan = with_depths(plan, records)
    if plan.study.is_insertion and plan.part is None:
        return _counted([path.status for path in _paths(plan, records)])
    own = [None if plan.part is not None and key not in plan.part else key for key in plan.keys]
    each = [
        None if key is None else _status(at_force(plan, case, records.get(key)) or without_contact(case))
        for key, case in zip(own, plan.study.cases(), strict=True)
    ]
    grouped = [[state for state in stages if state is not None] for stages in plan.study.by_case(each)]
    return _counted([worst(found) for found in grouped if found])


def _counted(states: Sequence[str]) -> dict[str, int]:
    counts = {state: states.count(state) for state in (OK, SKIPPED, FAILED, PENDING)}
    return counts | {state: states.count(state) for state in (PARTIAL, NO_CONTACT) if state in states}


def failures(plan: Plan, records: Mapping[str, Record]) -> tuple[tuple[str, str], ...]:
    """Return (case, message) of failed cases, and of failed F_exact, which fail no case."""
    plan = with_depths(plan, records)
    each = [(case, at_force(plan, case, records.get(key))) for key, case in _cases(plan)]
    failed = [(str(case), record.message) for case, record in each if record and record.has_failed]
    if plan.study.is_insertion:
        whole = [case for _, case in plan.study.whole_cases()]
        ended = zip(whole, _paths(plan, records), strict=True)
        return tuple((case.whole, path.message) for case, path in ended if path.status in FAILURES)
    exact = {key: records[key].message for key in plan.reference_keys if key in records and not records[key].is_ok}
    return (*failed, *((f"F_exact ({key[:6]})", message) for key, message in exact.items()))


def _paths(plan: Plan, records: Mapping[str, Record]) -> "list[Path]":
    from epsmesh.insertion.paths import paths  # noqa: PLC0415 (it loads scipy)

    return paths(plan, records)


def _status(record: Record | None) -> str:
    return record.status if record else PENDING


def _cases(plan: Plan) -> Iterator[tuple[str, Case]]:
    for key, case in zip(plan.keys, plan.study.cases(), strict=True):
        if plan.part is None or key in plan.part:
            yield key, case
