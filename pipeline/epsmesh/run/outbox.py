"""Records on their way to the store: those of one mesh are written in one transaction.

A synchronised write takes up to tens of milliseconds on a network file system, as long as a small case. Meanwhile the
records are in files of the processes that made them (``epsmesh.run.begun``), so that a killed process loses none.
"""

import time
from collections import Counter
from types import TracebackType

from epsmesh.plan.plan import Plan
from epsmesh.run.record import Record
from epsmesh.run.store import Store

# Longest time (s) that a record waits for others, unless a case takes longer: so much is lost if the machine stops.
_LONGEST = 2.0


class Outbox:
    """Writes records to a ``store``, those of each mesh step of ``plan`` together; a context manager.

    On leaving, also after an exception, everything is written.
    """

    def __init__(self, store: Store, plan: Plan):
        steps = plan.meshes
        self._store = store
        self._step = {solve.key: number for number, step in enumerate(steps) for solve in step.solves}
        self._left = Counter(self._step.values())
        self._waiting: list[Record] = []
        self._since = 0.0

    def __enter__(self) -> "Outbox":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._flush()

    def put(self, record: Record) -> None:
        """Take a record; write all that wait if it is the last one of its step, or if one waits too long.

        Raises:
            StoreError: if they cannot be written.
        """
        if not self._waiting:
            self._since = time.monotonic()
        self._waiting.append(record)
        step = self._step[record.key]
        self._left[step] -= 1
        if self._left[step] <= 0 or time.monotonic() - self._since > _LONGEST:
            self._flush()

    def _flush(self) -> None:
        if self._waiting:
            self._store.put_all(self._waiting)
            self._waiting = []  # not before: a signal may raise an exception at any line
