"""Ghost exchange: values at points that another rank owns and this one's cells have, by dolfinx's own vectors."""

from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline import compat


class Ghosts:
    """The points of a space: owned ones first, then ghosts. All methods are collective, but not on one process.

    Arrays hold ``size`` numbers a point, in single or double precision.
    """

    def __init__(self, space: Any):
        self._index_map, self._is_alone = space.dofmap.index_map, space.mesh.comm.size == 1
        self.owned: int = self._index_map.size_local
        self.local: int = self.owned + self._index_map.num_ghosts
        self._vectors: dict[tuple[str, int], Any] = {}

    def extended(self, x: np.ndarray, size: int) -> np.ndarray:
        """Return the values at all local points, given those of the owned ones; good until the next call."""
        if self._is_alone:
            return x
        vector = self._vector(x.dtype, size)
        vector.array[: len(x)] = x
        vector.scatter_forward()
        return np.asarray(vector.array)

    def folded(self, x: np.ndarray, size: int) -> np.ndarray:
        """Return the sums over ranks at the owned points, given what this rank has at all; good until the next call."""
        if self._is_alone:
            return x
        vector = self._vector(x.dtype, size)
        vector.array[:] = x
        compat.add_from_ghosts(vector)
        return np.asarray(vector.array)[: size * self.owned]

    def _vector(self, kind: np.dtype[Any], size: int) -> Any:
        key = kind.name, size
        if key not in self._vectors:
            self._vectors[key] = compat.ghosted_vector(self._index_map, size, kind)
        return self._vectors[key]


def summed(comm: MPI.Comm, value: float, how: MPI.Op = MPI.SUM) -> float:
    """Return the sum of all ranks' values, or what ``how`` makes of them; collective."""
    if comm.size == 1:
        return value
    result = np.empty(1)
    comm.Allreduce(np.array([value], dtype=np.float64), result, op=how)  # numbers alone: allreduce sends objects
    return float(result[0])
