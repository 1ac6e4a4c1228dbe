"""What stands for MPI's communicator where MPI is not loaded: one process, and nobody to talk to."""

from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


class Alone:
    """A communicator of one rank, as far as what needs no solver asks of it; arguments are those of mpi4py."""

    rank = 0
    size = 1

    def bcast(self, sent: T, root: int = 0) -> T:
        """Return what is sent."""
        return sent

    def allreduce(self, sent: T, op: Any = None) -> T:
        """Return what is sent: there is nothing to reduce it with."""
        return sent

    def allgather(self, sent: T) -> list[T]:
        """Return what is sent, in a list."""
        return [sent]

    def gather(self, sent: T, root: int = 0) -> list[T]:
        """Return what is sent, in a list."""
        return [sent]

    def barrier(self) -> None:
        """Wait for nobody."""


@dataclass(frozen=True)
class Jobs(Alone):
    """The communicator of a run that solves in ``count`` further processes, which have MPI each for itself."""

    count: int
