"""Distribute an export's independent work over MPI ranks: each does some, and all get every result."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.run.groups import Counter
from epsmesh.run.remaining import format_seconds
from epsmesh_realtime.export.kept import NONE, Kept

# Seconds between two lines of progress of quick work.
_SILENCE = 5.0
Item = TypeVar("Item")
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Ranks:
    """The ranks of a communicator. Every method is collective: all ranks call it with the same work.

    An error on one rank is raised there, and on the others as a RuntimeError with the same text.
    """

    comm: MPI.Comm
    note: Callable[[str], None] = lambda text: None  # prints progress, on the first rank
    kept: Kept = NONE

    def on_first(self, make: Callable[[], Answer]) -> Answer:
        """Return on every rank the result of ``make`` on the first one."""
        return self.together([None], lambda _: [make()])[0]

    def together(self, items: Sequence[Item], work: Callable[[Sequence[Item]], Iterable[Answer]]) -> list[Answer]:
        """Return the results of ``work`` for all ``items``. Each rank calls it once, with every n-th item.

        Use it for work with a set-up that costs the same for any number of items.
        """
        own = range(self.comm.rank, len(items), self.comm.size)
        found: dict[int, Answer] = {}
        wrong = None
        try:
            found.update(zip(own, work([items[n] for n in own]) if own else (), strict=True))
        except Exception as error:
            wrong = error
        return self._gathered(len(items), found, wrong)

    def keeping(
        self, items: Sequence[Item], work: Callable[[Sequence[Item]], Iterable[FloatArray]], what: str, given: object
    ) -> list[FloatArray]:
        """Return the results of ``work`` as :meth:`together` does; those of earlier exports are read, new ones kept.

        ``what`` names the items. Results depend on the item and on what is ``given``.
        """
        known = {n: array for n, item in enumerate(items) if (array := self.kept.get((what, given, item))) is not None}
        # All ranks must agree on what is left: some may not see the files of others.
        known = self.comm.bcast(known)
        noted = start = time.monotonic()
        left = [item for n, item in enumerate(items) if n not in known]
        if len(left) < len(items):
            self.note(f"{what}: {len(items) - len(left)} of {len(items)} were solved by an earlier export")

        def kept(some: Sequence[Item]) -> Iterator[FloatArray]:
            nonlocal noted
            for number, (item, array) in enumerate(zip(some, work(some), strict=True), start=1):
                self.kept.put((what, given, item), array)
                if number in (1, len(some)) or time.monotonic() - noted > _SILENCE:
                    noted = time.monotonic()
                    self._tell(what, number * self.comm.size, len(left), start)
                yield array

        found = iter(self.together(left, kept))
        return [known[n] if n in known else next(found) for n in range(len(items))]

    def in_turn(self, items: Sequence[Item], work: Callable[[Item], Answer], what: str) -> list[Answer]:
        """Return the result of ``work`` for each of ``items``: a free rank does the next one. ``what`` names them."""
        found: dict[int, Answer] = {}
        wrong, start = None, time.monotonic()
        with Counter(self.comm, self.comm.rank, self.comm.size) as counter:
            while wrong is None and (number := counter.next()) < len(items):
                self._tell(what, number, len(items), start)
                try:
                    found[number] = work(items[number])
                except Exception as error:
                    wrong = error
        return self._gathered(len(items), found, wrong)

    def _tell(self, what: str, done: int, count: int, start: float) -> None:
        """Tell how many items are done, and how long the others take at the pace since the ``start`` (s)."""
        # The first item's time has the set-up.
        left = (time.monotonic() - start) / done * (count - done) if done > self.comm.size else 0.0
        self.note(
            f"{what}: {min(done, count)} of {count}" + (f", about {format_seconds(left)} left" if left > 0 else "")
        )

    def _gathered(self, count: int, found: Mapping[int, Answer], wrong: Exception | None) -> list[Answer]:
        # Some exceptions cannot be pickled, so only their text is sent.
        every: list[Any] = self.comm.allgather((count, found, None if wrong is None else str(wrong)))
        if wrong is not None:
            raise wrong
        for _, _, message in every:
            if message is not None:
                raise RuntimeError(message)
        if any(other != count for other, _, _ in every):
            raise RuntimeError("the ranks disagree on the number of solves")
        parts = {number: value for _, part, _ in every for number, value in part.items()}
        return [parts[number] for number in range(count)]


ALONE = Ranks(MPI.COMM_SELF)
