"""Distribute an export's independent work over MPI ranks: each does some, and all get every result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from mpi4py import MPI

from pipeline.run.groups import Counter

Item = TypeVar("Item")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Ranks:
    """The ranks of a communicator. Every method is collective: all ranks call it with the same work.

    An error on one rank is raised there, and on the others as a RuntimeError with the same text.
    """

    comm: MPI.Comm
    note: Callable[[str], None] = lambda text: None  # prints progress, on the first rank

    def on_first(self, make: Callable[[], Found]) -> Found:
        """Return on every rank the result of ``make`` on the first one."""
        return self.together([None], lambda _: [make()])[0]

    def together(self, items: Sequence[Item], work: Callable[[Sequence[Item]], Sequence[Found]]) -> list[Found]:
        """Return the results of ``work`` for all ``items``. Each rank calls it once, with every n-th item.

        Use it for work with a set-up that costs the same for any number of items.
        """
        own = list(range(self.comm.rank, len(items), self.comm.size))
        try:
            found, wrong = dict(zip(own, work([items[n] for n in own]) if own else (), strict=True)), None
        except Exception as error:
            found, wrong = {}, error
        return self._gathered(len(items), found, wrong)

    def in_turn(self, items: Sequence[Item], work: Callable[[Item], Found], what: str) -> list[Found]:
        """Return the result of ``work`` for each of ``items``: a free rank does the next one. ``what`` names them."""
        found: dict[int, Found] = {}
        wrong = None
        with Counter(self.comm, self.comm.rank, self.comm.size) as counter:
            while wrong is None and (number := counter.next()) < len(items):
                self.note(f"{what}: {number + 1} of {len(items)}")
                try:
                    found[number] = work(items[number])
                except Exception as error:
                    wrong = error
        return self._gathered(len(items), found, wrong)

    def _gathered(self, count: int, found: Mapping[int, Found], wrong: Exception | None) -> list[Found]:
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
