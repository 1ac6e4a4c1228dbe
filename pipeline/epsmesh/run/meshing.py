"""From a case to its distributed mesh: made on the first rank, or read from the cache."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from mpi4py import MPI

from epsmesh.launcher import is_interrupt
from epsmesh.mesh.distribute import BodyMesh, distribute, distribute_parts
from epsmesh.mesh.generate import MeshArrays, MeshError
from epsmesh.mesh.of_case import coarse_arrays, refined_arrays, refined_part, unrefined_arrays, upright
from epsmesh.mesh.parts import split
from epsmesh.plan.refinement import is_refined, refinements
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.run.failure import describe
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.problem import CaseFailure
from epsmesh.stages import Times, recharge, stage
from epsmesh.study.case import Case

T = TypeVar("T")


@stage("meshing")
def mesh_case(case: Case, mirrors: tuple[str, ...], comm: MPI.Comm, cache: MeshCache | None = None) -> BodyMesh:
    """Return the mesh of a case, of the part bounded by the planes ``mirrors``; collective.

    The mesh is turned so that the probe presses along -z.

    A mesh that cannot be refined is made as a whole.

    Raises:
        MeshError: on every rank.
        CaseFailure: on every rank, if it failed for another reason, as for want of memory.
    """
    if is_refined(case):
        with suppress(MeshError):
            twice = refinements(case) > 1
            parts = on_first_rank(comm, lambda: split(_cached_coarse(case, cache), comm.size, is_refined=twice))
            part = refined_part(case, mirrors, comm.scatter(parts or ()), comm)
            return distribute_parts(comm, replace(part, mesh=upright(case, part.mesh)))
    arrays = on_first_rank(comm, lambda: _cached_unrefined(case, mirrors, cache))
    return distribute(comm, arrays and upright(case, arrays))


def cached_arrays(case: Case, mirrors: tuple[str, ...], cache: MeshCache | None) -> MeshArrays:
    """Return the mesh of a case from the cache, with the time of its making, or make and cache it."""
    if is_refined(case):
        with suppress(MeshError):
            return refined_arrays(case, mirrors, _cached_coarse(case, cache))
    return _cached_unrefined(case, mirrors, cache)


def _cached_coarse(case: Case, cache: MeshCache | None) -> MeshArrays:
    return _cached(case, mirror_planes(case), cache, coarse_arrays, is_coarse=True)


def _cached_unrefined(case: Case, mirrors: tuple[str, ...], cache: MeshCache | None) -> MeshArrays:
    return _cached(case, mirrors, cache, lambda case: unrefined_arrays(case, mirrors, cache))


def _cached(
    case: Case,
    mirrors: tuple[str, ...],
    cache: MeshCache | None,
    make: Callable[[Case], MeshArrays],
    *,
    is_coarse: bool = False,
) -> MeshArrays:
    if cache is None:
        return make(case)
    path = cache.path(case, mirrors, is_coarse=is_coarse)
    found = cache.get(path)
    if found is None:
        found = make(case)
        cache.put(path, found)
    else:
        recharge(Times(mesh=found.seconds))
    return found


def on_first_rank(comm: MPI.Comm, compute: Callable[[], T]) -> T | None:
    """Return the result of ``compute`` on rank 0, None elsewhere; collective.

    Raises:
        MeshError: on every rank, if rank 0 raised it.
        CaseFailure: on every rank, if it raised another exception.
    """
    result: T | None = None
    message: str | None = None
    kind: type[Exception] = MeshError
    if comm.rank == 0:
        try:
            result = compute()
        except Exception as error:
            if is_interrupt(error):
                raise
            message, kind = describe(error), MeshError if isinstance(error, MeshError) else CaseFailure
    message, kind = comm.bcast((message, kind))
    if message is not None:
        raise kind(message)
    return result
