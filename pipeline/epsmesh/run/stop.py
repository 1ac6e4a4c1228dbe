"""What is skipped once others are solved: larger ε near F_exact, and slits in tissue that is whole."""

from collections.abc import Callable, Collection, Mapping
from math import inf

import numpy as np

from epsmesh.plan.plan import Plan
from epsmesh.plan.steps import Solve
from epsmesh.quantities import write
from epsmesh.run.record import Record
from epsmesh.states import SKIPPED
from epsmesh.study.case import Case
from epsmesh.study.way import Motion

# F stays close to F_exact if it is close at this many values of ε in a row.
_IN_A_ROW = 2


def waves(plan: Plan, todo: Collection[Solve]) -> list[tuple[Solve, ...]]:
    """Return the solves in groups, each of which needs the earlier ones: one group, or F_exact first and then by ε.

    Of insertions, intact bodies are first.
    """
    if plan.study.is_insertion:
        slits = tuple(solve for solve in todo if solve.way.motion is Motion.SLIT)
        return [tuple(solve for solve in todo if solve.way.motion is not Motion.SLIT), slits]
    if plan.study.planning.stop_near_exact is None:
        return [tuple(todo)]
    exact = tuple(solve for solve in todo if solve.is_reference)
    rest = [solve for solve in todo if not solve.is_reference]
    epsilons = sorted({solve.case.mesh.epsilon for solve in rest})
    return [exact, *(tuple(s for s in rest if s.case.mesh.epsilon == epsilon) for epsilon in epsilons)]


def reason_to_skip(plan: Plan, solve: Solve, find: Callable[[str], Record | None]) -> str:
    """Return why a solve is skipped, by F_exact and the smaller ε of all its cases; "" if it is needed.

    The full order belongs to every `outside`, and is solved if one of them needs it.
    """
    if plan.study.is_insertion:
        from epsmesh.insertion.paths import needs  # noqa: PLC0415 (it loads scipy)

        is_needed = solve.way.motion is not Motion.SLIT or any(needs(plan, index, find) for index in solve.serves)
        return "" if is_needed else "the intact body stores less than the work of fracture of a slit"
    limit = plan.study.planning.stop_near_exact
    if limit is None or solve.is_reference or not plan.reference_keys:
        return ""
    reasons = [_reason(solve.case, row, limit, find) for row in _rows(plan, solve)]
    return reasons[0] if reasons and all(reasons) else ""


def _reason(case: Case, row: list[tuple[float, str, str]], limit: float, find: Callable[[str], Record | None]) -> str:
    near = []
    for other, key, exact_key in row:
        record, exact = find(key), find(exact_key)
        if record is not None and record.status == SKIPPED:
            return record.message
        if record is None or exact is None or not (record.is_ok and exact.is_ok):
            return ""
        ratio = record.scaled(case.scale).force / exact.scaled(case.scale).force
        # The error of F_exact itself counts, too.
        near.append((abs(ratio - 1) + exact.force_error <= limit, other))
    near.sort(key=lambda pair: pair[1])
    last = [is_near for is_near, _ in near[-_IN_A_ROW:]]
    if len(last) < _IN_A_ROW or not all(last):
        return ""
    return f"F is within {100 * limit:g} % of F_exact up to ε = {write('epsilon', near[-1][1])}: larger ε are skipped"


def skipped(plan: Plan, records: Mapping[str, Record]) -> dict[str, Record]:
    """Return, by key, the records of skipped solves, given the ``records`` of others."""
    known = dict(records)
    for solve in (solve for wave in waves(plan, plan.solves) for solve in wave if solve.key not in records):
        if reason := reason_to_skip(plan, solve, known.get):
            known[solve.key] = Record(solve.key, SKIPPED, reason)
    return {key: record for key, record in known.items() if key not in records}


def _rows(plan: Plan, solve: Solve) -> list[list[tuple[float, str, str]]]:
    """Return, for each case of a solve, the smaller ε with the keys of those cases and of their F_exact."""
    axes = plan.study.axes
    position = next((i for i, axis in enumerate(axes) if axis.path == "mesh.epsilon"), None)
    if position is None:
        return []
    labels = [float(label) for label in axes[position].labels]
    least: dict[tuple[tuple[int, ...], tuple[int, ...]], float] = {}
    for index in solve.serves or (solve.case.index,):
        row = index[:position], index[position + 1 :]
        least[row] = min(labels[index[position]], least.get(row, inf))
    found = []
    for (before, after), most in least.items():
        flats = [
            (epsilon, int(np.ravel_multi_index((*before, i, *after), plan.study.shape)))
            for i, epsilon in enumerate(labels)
            if epsilon < most
        ]
        found.append([(epsilon, plan.keys[flat], plan.reference_keys[flat]) for epsilon, flat in flats])
    return found
