"""Decide on a computed record: keep it, fail it, or, with an accuracy, try the next mesh."""

from dataclasses import replace
from math import isfinite, nan

from epsmesh import fitted
from epsmesh.plan.steps import Solve
from epsmesh.run.measure import add_times, least_bar, size_at_contact
from epsmesh.run.record import Record
from epsmesh.states import FAILED

# With a larger error bar the force is unknown: it may be more than twice the true one.
_WORST_BAR = 1.0


class Attempts:
    """Judges records of solves; keeps the earlier attempts of solves with an accuracy."""

    def __init__(self) -> None:
        self._earlier: dict[str, list[Record]] = {}
        self._again: dict[str, Solve] = {}

    def judge(self, solve: Solve, record: Record) -> Record | None:
        """Return the record to keep of a solve, or None to try its next mesh: see :meth:`take_again`."""
        record = _checked(solve, record)
        if solve.goal is None:
            return record
        # A meridian has chosen among its own meshes.
        has_next = bool(solve.later) and not solve.axisymmetric
        if record.is_ok and record.proven > solve.goal and has_next:
            bar = record.proven, record.friction_error
            if not solve.is_out_of_reach(*bar):
                self._earlier.setdefault(solve.key, []).append(record)
                self._again[solve.key] = solve.again(*bar)
                return None
            record = replace(record, message="; ".join(filter(None, (record.message, _kept(record)))))
        return _concluded(solve, record, self._earlier.pop(solve.key, []))

    def has_next(self, solve: Solve) -> bool:
        """Return whether the next mesh of a solve is to be tried."""
        return solve.key in self._again

    def take_again(self) -> tuple[Solve, ...]:
        """Return the solves whose next mesh is to be tried, and forget them."""
        again, self._again = tuple(self._again.values()), {}
        return again


def failed(record: Record, message: str) -> Record:
    """Return ``record`` with the status of a failure."""
    return replace(record, status=FAILED, message=message)


def _checked(solve: Solve, record: Record) -> Record:
    """Return ``record``, as a failure if its force is unknown.

    A force without error bar for want of memory is valid, with a message; an accuracy needs the error bar.
    """
    if record.status != "ok":
        return record
    bar = record.force_error
    if not isfinite(record.force):
        return failed(record, f"the computed force is {record.force}")
    if not isfinite(bar) and (solve.goal is not None or not record.message):
        return failed(record, f"the computed error bar is {bar}")
    if solve.goal is None and (why := _unproved(solve, bar)):
        return failed(record, f"{why}: F is not proved on this mesh; use a smaller `rim` or `fine`")
    return failed(record, f"the computed error bar is {bar:.2g}") if bar < 0 else _without_wide_release(record)


def _unproved(solve: Solve, bar: float) -> str:
    """Return why a mesh does not prove a force of the relative ``bar``; empty if it does."""
    if bar > _WORST_BAR:
        return f"error bar {100 * bar:.0f} % of F, above {100 * _WORST_BAR:.0f} %"
    if least_bar(solve) <= fitted.MOST_UNRESOLVED:
        return ""
    return f"elements are {size_at_contact(solve.case):.2g} times as large as the contact's half width"


def _without_wide_release(record: Record) -> Record:
    """Return ``record`` without the energy release rate of a slit, if its error bar exceeds 100 %."""
    if not record.energy_release_error > _WORST_BAR:
        return record
    unknown = f"energy_release is unknown: error bar {100 * record.energy_release_error:.0f} %; use a finer mesh"
    message = "; ".join(filter(None, (record.message, unknown)))
    return replace(record, energy_release=nan, energy_release_error=nan, message=message)


def _concluded(solve: Solve, last: Record, earlier: list[Record]) -> Record:
    """Return the record of a solve with an accuracy after its ``last`` attempt.

    F_exact gets its best attempt, with that one's error bar.
    """
    assert solve.goal is not None
    known = [record for record in (*earlier, last) if record.is_ok]
    if not known:
        unmet = f"the accuracy {_percent(solve.goal)} is not reached: {last.message}"
        return replace(last, message=unmet) if last.status == "partial" else last
    best = min(known, key=lambda record: record.proven)
    # The time of several meshes must not enter the cost model.
    record = replace(add_times(best, [r for r in known if r is not best]), kind="")
    if best.proven <= solve.goal:
        return record
    if solve.is_reference and best.proven <= _WORST_BAR:
        return record
    why = last.message or "this is the finest mesh tried"
    bar, goal = _percent(best.proven), _percent(solve.goal)
    return failed(record, f"error bar {bar} exceeds the accuracy {goal}: {why}")


def _kept(record: Record) -> str:
    return f"{_percent(record.friction_error)} of it is that of friction, which finer meshes keep"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
