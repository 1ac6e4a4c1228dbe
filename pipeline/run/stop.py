"""An early stop along ε: once F stays near F_exact, larger ε are not run."""

from collections.abc import Callable, Collection, Mapping

from pipeline.plan.plan import Plan
from pipeline.plan.steps import Solve
from pipeline.quantities import write
from pipeline.run.record import Record

SKIPPED = "skipped"
# F "stays" near F_exact if it is at this many values of ε in a row.
_IN_A_ROW = 2


def waves(plan: Plan, todo: Collection[Solve]) -> list[tuple[Solve, ...]]:
    """Return the solves in the order in which they must be known: all at once, or F_exact first and then by ε."""
    if plan.study.planning.stop_when is None:
        return [tuple(todo)]
    exact = tuple(solve for solve in todo if solve.is_reference)
    rest = [solve for solve in todo if not solve.is_reference]
    epsilons = sorted({solve.case.mesh.epsilon for solve in rest})
    return [exact, *(tuple(s for s in rest if s.case.mesh.epsilon == epsilon) for epsilon in epsilons)]


def reason_to_skip(plan: Plan, solve: Solve, find: Callable[[str], Record | None]) -> str:
    """Return why a solve need not be run: what smaller ε of the same case, and F_exact, are found to give."""
    limit, case = plan.study.planning.stop_when, solve.case
    if limit is None or solve.is_reference or not plan.reference_keys:
        return ""
    near = []
    for other, key, exact_key in _smaller(plan, solve):
        record, exact = find(key), find(exact_key)
        if record is not None and record.status == SKIPPED:
            return record.message
        if record is None or exact is None or not (record.is_ok and exact.is_ok):
            return ""
        ratio = record.scaled(case.scale).force / exact.scaled(case.scale).force
        # What F_exact itself may be wrong by counts: near to a doubtful one is not near.
        near.append((abs(ratio - 1) + exact.force_error <= limit, other))
    near.sort(key=lambda pair: pair[1])
    last = [is_near for is_near, _ in near[-_IN_A_ROW:]]
    if len(last) < _IN_A_ROW or not all(last):
        return ""
    return f"F is within {100 * limit:g} % of F_exact up to ε = {write('epsilon', near[-1][1])}: larger ε are not run"


def skipped(plan: Plan, records: Mapping[str, Record]) -> dict[str, Record]:
    """Return, by key, what is to be known of the solves that need not be run, given the ``records`` of others."""
    known = dict(records)
    for solve in (solve for wave in waves(plan, plan.solves) for solve in wave if solve.key not in records):
        if reason := reason_to_skip(plan, solve, known.get):
            known[solve.key] = Record(solve.key, SKIPPED, reason)
    return {key: record for key, record in known.items() if key not in records}


def _smaller(plan: Plan, solve: Solve) -> list[tuple[float, str, str]]:
    """Return ε and keys of the cases that differ from a solve's in a smaller ε only, skipped ones left out."""
    axes = plan.study.axes
    position = next((i for i, axis in enumerate(axes) if axis.path == "mesh.epsilon"), None)
    if position is None:
        return []
    found = []
    for number, epsilon in enumerate(axes[position].labels):
        if float(epsilon) < solve.case.mesh.epsilon:
            index = (*solve.case.index[:position], number, *solve.case.index[position + 1 :])
            flat = _flat(plan, index)
            found.append((float(epsilon), plan.keys[flat], plan.reference_keys[flat]))
    return found


def _flat(plan: Plan, index: tuple[int, ...]) -> int:
    flat = 0
    for i, length in zip(index, plan.study.shape, strict=True):
        flat = flat * length + i
    return flat
