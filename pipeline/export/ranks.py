"""Independent work of an export, shared out to the ranks there are: each does some, and all have what came of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from mpi4py import MPI

from pipeline.run.groups import Counter

Item = TypeVar("Item")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Ranks:
    """The ranks of a communicator, which all ask for the same work in the same order; every method is collective.

    What fails on one of them is raised there, and on the others as a RuntimeError of the same text.
    """

    comm: MPI.Comm
    note: Callable[[str], None] = lambda text: None  # told, on the first rank, what is being worked on

    def on_first(self, make: Callable[[], Found]) -> Found:
        """Return on every rank what ``make`` gives on the first one."""
        return self.together([None], lambda _: [make()])[0]

    def together(self, items: Sequence[Item], work: Callable[[Sequence[Item]], Sequence[Found]]) -> list[Found]:
        """Return what ``work`` makes of all ``items``, of which each rank gives it every so many at once.

        That is for work which has much to set up, whatever the number of items.
        """
        own = list(range(self.comm.rank, len(items), self.comm.size))
        try:
            found, wrong = dict(zip(own, work([items[n] for n in own]) if own else (), strict=True)), None
        except Exception as error:
            found, wrong = {}, error
        return self._gathered(len(items), found, wrong)

    def in_turn(self, items: Sequence[Item], work: Callable[[Item], Found], what: str) -> list[Found]:
        """Return what ``work`` makes of each of ``items``, called ``what``: a free rank takes the next one."""
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
        # Not every exception survives being sent.
        every: list[Any] = self.comm.allgather((count, found, None if wrong is None else str(wrong)))
        if wrong is not None:
            raise wrong
        for _, _, message in every:
            if message is not None:
                raise RuntimeError(message)
        if any(other != count for other, _, _ in every):
            raise RuntimeError("the ranks do not agree on what is to be solved for")
        parts = {number: value for _, part, _ in every for number, value in part.items()}
        return [parts[number] for number in range(count)]


ALONE = Ranks(MPI.COMM_SELF)
