"""From a case to its distributed mesh: a symmetric part is meshed, and reflected where the whole is wanted."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import TypeVar

from mpi4py import MPI

from pipeline.mesh.curve import curve
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays, MeshError, generate
from pipeline.mesh.meridian import Meridian
from pipeline.mesh.reflect import reflect
from pipeline.mesh.size import Sizes
from pipeline.plan.symmetry import mirror_planes
from pipeline.run.mesh_cache import MeshCache
from pipeline.scene.model import Scene
from pipeline.solve.linear import SolveError
from pipeline.study.schema import Below, Cylinder, Disc
from pipeline.study.sweep import Case

T = TypeVar("T")


def mesh_case(
    case: Case, mirrors: tuple[str, ...], comm: MPI.Comm, cache: MeshCache | None = None
) -> tuple[BodyMesh, float]:
    """Return the mesh of a case, of the part that ``mirrors`` leave of it, and the seconds it takes; collective.

    A mesh from the ``cache`` counts with the seconds that it took to make.

    Raises:
        MeshError: on every rank.
    """
    arrays = on_first_rank(comm, lambda: cached_arrays(case, mirrors, cache))
    start = MPI.Wtime()
    mesh = distribute(comm, arrays)
    making = comm.bcast(arrays.seconds if arrays is not None else 0.0)
    return mesh, making + comm.allreduce(MPI.Wtime() - start, op=MPI.MAX)


def cached_arrays(case: Case, mirrors: tuple[str, ...], cache: MeshCache | None) -> MeshArrays:
    """Return the mesh of a case from the cache, or made and put there."""
    if cache is None:
        return mesh_arrays(case, mirrors)
    path = cache.path(case, mirrors)
    found = cache.get(path)
    if found is None:
        found = mesh_arrays(case, mirrors)
        cache.put(path, found)
    return found


def mesh_arrays(case: Case, mirrors: tuple[str, ...]) -> MeshArrays:
    """Return the mesh of a case as arrays, of the part that ``mirrors`` leave of it."""
    start = perf_counter()
    mesh, probe = case.mesh, case.probe
    epsilon = inf if case.is_full else mesh.epsilon
    column = inf if mesh.outside == "coarse" else epsilon
    # A round side is resolved all along, the body's as well as the column's.
    side = min(column, case.body.radius) if isinstance(case.body, Cylinder) else column
    sizes = Sizes(epsilon, mesh.fine, mesh.coarse, mesh.rim_size(probe.half_width), mesh.growth, side)
    straight = mesh.degree == 1
    planes = mirror_planes(probe)
    scene = Scene(case.body, probe, column, mesh.outside == "fixed", sizes.rim_segments(probe), straight, planes)
    arrays = generate(scene, sizes)
    arrays = arrays if straight else curve(arrays, scene)
    whole = reflect(arrays, tuple(plane for plane in planes if plane not in mirrors))
    return replace(whole, seconds=perf_counter() - start)


def meridian_of(case: Case) -> Meridian:
    """Return the half plane of a round case."""
    body, probe, mesh = case.body, case.probe, case.mesh
    assert isinstance(body, Cylinder)
    assert isinstance(probe, Disc)
    fixed = body.fixed.below if isinstance(body.fixed, Below) else body.fixed
    column, held = (mesh.epsilon, mesh.outside == "fixed") if case.is_truncated else (inf, False)
    return Meridian(body.radius, body.height, probe.radius, fixed, column, held)


def on_first_rank(comm: MPI.Comm, compute: Callable[[], T]) -> T | None:
    """Return what ``compute`` gives on rank 0, None elsewhere; its failure is raised on every rank."""
    result, message = None, None
    if comm.rank == 0:
        try:
            result = compute()
        except (MeshError, SolveError) as error:
            message = str(error)
        except (MemoryError, RuntimeError) as error:
            message = f"{type(error).__name__}: {error}"
    message = comm.bcast(message)
    if message is not None:
        raise MeshError(message)
    return result
