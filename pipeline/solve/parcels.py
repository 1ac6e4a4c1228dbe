"""Items that ranks send each other again and again, and values of points that other ranks own.

Point to point, between ranks that have something for each other only; numpy arrays of any kind of number.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline.arrays import Int32Array, IntArray

_TAG = 4711


class Parcels:
    """Items of each rank that always go to the same ranks, and what comes of it.

    ``going`` counts the items, ``came`` what comes to this rank.
    """

    def __init__(self, comm: MPI.Comm, destinations: IntArray):
        """``destinations`` are the ranks that items go to; collective."""
        self._comm = comm
        counts = np.bincount(destinations, minlength=comm.size)
        came = np.array(comm.alltoall(counts.tolist()))
        self.going, self.came = len(destinations), int(came.sum())
        self._goes, self._comes = _parts(counts), _parts(came)
        order = np.argsort(destinations, kind="stable")
        self._order = None if np.array_equal(order, np.arange(len(order))) else order

    @property
    def sources(self) -> list[slice]:
        """Where the items of each other rank are among those that came."""
        return [part for _, part in self._comes]

    def send(self, items: np.ndarray) -> np.ndarray:
        """Return what came of ``items`` (n, …), rank by rank; collective."""
        ordered = items if self._order is None else items[self._order]
        return self._finish(self._begin(np.ascontiguousarray(ordered), self._goes, self._comes, self.came))

    def begin_return(self, items: np.ndarray) -> tuple[Any, ...]:
        """Begin to send back what came, changed to ``items`` (n, …), which must not change meanwhile; collective."""
        return self._begin(np.ascontiguousarray(items), self._comes, self._goes, self.going)

    def end_return(self, begun: tuple[Any, ...]) -> np.ndarray:
        """Return what came back, in the order of the items that were sent; collective."""
        found = self._finish(begun)
        if self._order is None:
            return found
        result = np.empty_like(found)
        result[self._order] = found
        return result

    def _begin(
        self, items: np.ndarray, goes: list[tuple[int, slice]], comes: list[tuple[int, slice]], count: int
    ) -> tuple[Any, ...]:
        found = np.empty((count, *items.shape[1:]), dtype=items.dtype)
        requests = [self._comm.Irecv(found[part], rank, _TAG) for rank, part in comes]
        requests += [self._comm.Isend(items[part], rank, _TAG) for rank, part in goes]
        return found, requests, items

    @staticmethod
    def _finish(begun: tuple[Any, ...]) -> np.ndarray:
        found, requests, _ = begun
        MPI.Request.Waitall(requests)
        return np.asarray(found)


class Shared:
    """Points that other ranks own and this one reads, or adds to."""

    def __init__(self, comm: MPI.Comm, owned: tuple[int, int], wanted: IntArray):
        """``owned`` is the range of the points of this rank in all, ``wanted`` the numbers of others; collective."""
        self._parcels = Parcels(comm, owners(comm, owned, wanted))
        self._given: Int32Array = (self._parcels.send(wanted) - owned[0]).astype(np.int32)

    def begin_read(self, values: np.ndarray) -> tuple[Any, ...]:
        """Begin to give the ``values`` (points, …) of this rank to those who want them; collective."""
        return self._parcels.begin_return(values[self._given])

    def end_read(self, begun: tuple[Any, ...]) -> np.ndarray:
        """Return the values of the points that are wanted (n, …); collective."""
        return self._parcels.end_return(begun)

    def read(self, values: np.ndarray) -> np.ndarray:
        """Return the values of the points that are wanted (n, …), given those of this rank's own; collective."""
        return self.end_read(self.begin_read(values))

    def extend(self, x: np.ndarray, size: int = 3) -> np.ndarray:
        """Return ``x``, ``size`` numbers for each point of this rank, and behind it the points wanted; collective."""
        return np.concatenate([x, self.read(x.reshape(-1, size)).reshape(-1)])

    def fold(self, whole: np.ndarray, y: np.ndarray, size: int = 3) -> None:
        """Add ``whole``, which goes on behind this rank's points as :meth:`extend` has it, to all ``y``; collective."""
        y += whole[: len(y)]
        self.add(whole[len(y) :].reshape(-1, size), y.reshape(-1, size))

    def add(self, more: np.ndarray, values: np.ndarray) -> None:
        """Add ``more`` (n, …) for the points that are wanted to the ``values`` of their owners; collective."""
        came = self._parcels.send(more)
        for part in self._parcels.sources:  # a rank sends no point twice
            values[self._given[part]] += came[part]


def ghosts_of(space: Any) -> Shared | None:
    """Return the points of a space that other ranks own and this one's cells have, None on one process; collective."""
    comm, index_map = space.mesh.comm, space.dofmap.index_map
    if comm.size == 1:
        return None
    return Shared(comm, index_map.local_range, np.asarray(index_map.ghosts, dtype=np.int64))


def owners(comm: MPI.Comm, owned: tuple[int, int], points: IntArray) -> IntArray:
    """Return the ranks that own ``points``, given the range of those of this rank; collective."""
    # Of ranks that own nothing, the next one's start is the same.
    starts = np.array(comm.allgather(int(owned[0])))
    return np.searchsorted(starts, points, side="right") - 1


def _parts(counts: IntArray) -> list[tuple[int, slice]]:
    ends = np.cumsum(counts)
    return [(int(rank), slice(int(ends[rank] - counts[rank]), int(ends[rank]))) for rank in np.flatnonzero(counts)]
