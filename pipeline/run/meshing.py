"""From a case to its distributed mesh: made on the first rank, or found in the cache."""

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from pipeline.launcher import is_interrupt
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays, MeshError
from pipeline.mesh.of_case import mesh_arrays, upright
from pipeline.run.failure import describe
from pipeline.run.mesh_cache import MeshCache
from pipeline.study.sweep import Case

T = TypeVar("T")


def mesh_case(
    case: Case, mirrors: tuple[str, ...], comm: MPI.Comm, cache: MeshCache | None = None
) -> tuple[BodyMesh, float]:
    """Return the mesh of a case, of the part that ``mirrors`` leave of it, and the seconds it takes; collective.

    It is turned so that the probe presses along -z: that is how it is solved.

    A mesh from the ``cache`` counts with the seconds that it took to make.

    Raises:
        MeshError: on every rank.
    """
    arrays = on_first_rank(comm, lambda: cached_arrays(case, mirrors, cache))
    start = MPI.Wtime()
    mesh = distribute(comm, arrays and upright(case, arrays))
    making = comm.bcast(arrays.seconds if arrays is not None else 0.0)
    return mesh, making + comm.allreduce(MPI.Wtime() - start, op=MPI.MAX)


def cached_arrays(case: Case, mirrors: tuple[str, ...], cache: MeshCache | None) -> MeshArrays:
    """Return the mesh of a case from the cache, or made and put there."""
    if cache is None:
        return mesh_arrays(case, mirrors)
    path = cache.path(case, mirrors)
    found = cache.get(path)
    if found is None:
        found = mesh_arrays(case, mirrors, cache)
        cache.put(path, found)
    return found


def on_first_rank(comm: MPI.Comm, compute: Callable[[], T]) -> T | None:
    """Return what ``compute`` gives on rank 0, None elsewhere; its failure is raised on every rank."""
    result, message = None, None
    if comm.rank == 0:
        try:
            result = compute()
        except Exception as error:
            if is_interrupt(error):
                raise
            message = describe(error)
    message = comm.bcast(message)
    if message is not None:
        raise MeshError(message)
    return result
