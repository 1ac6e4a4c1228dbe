"""The desk of a run: where records arrive, and where it is decided which solves are not needed."""

from collections.abc import Callable, Collection, Sequence

from epsmesh.plan.plan import Plan
from epsmesh.plan.steps import MeshStep, Solve
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.stop import reason_to_skip
from epsmesh.states import SKIPPED

Keep = Callable[[Record], None]


class Desk:
    """Collects the records of a run: all on rank 0, those of earlier waves on every rank."""

    def __init__(self, plan: Plan, keep: Keep | None, progress: Progress, known: dict[str, Record]):
        self._plan, self._keep, self._progress = plan, keep, progress
        self._solves = {solve.key: solve for solve in plan.solves}
        self.records = known

    def take(self, record: Record) -> None:
        """Add a record; on rank 0, also keep and count it."""
        self.records[record.key] = record
        if self._keep is not None:
            self._keep(record)
            self._progress.done(self._solves[record.key].label, record.message if record.has_failed else "")

    def skips(self, solve: Solve) -> bool:
        """Return whether a solve is skipped, and record the reason; the same on every rank."""
        reason = reason_to_skip(self._plan, solve, self.records.get)
        if reason:
            self.take(Record(solve.key, SKIPPED, reason))
        return bool(reason)

    @property
    def failed(self) -> int:
        """The number of failed cases of the study."""
        records = self.records
        return sum(
            len(solve.serves) for key, solve in self._solves.items() if key not in records or records[key].has_failed
        )


def apart(steps: Sequence[MeshStep], delayed: Collection[str]) -> tuple[list[MeshStep], list[MeshStep]]:
    """Return the steps without keys in ``delayed``, and those with some."""
    late = [any(solve.key in delayed for solve in step.solves) for step in steps]
    first, second = ([s for s, is_late in zip(steps, late, strict=True) if is_late == which] for which in (False, True))
    return first, second
