"""From a case to its distributed mesh: a symmetric part is meshed, and reflected where the whole is wanted."""

from collections.abc import Callable
from math import inf
from typing import TypeVar

from mpi4py import MPI

from pipeline.mesh.curve import curve
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays, MeshError, generate
from pipeline.mesh.meridian import Meridian
from pipeline.mesh.reflect import reflect
from pipeline.mesh.size import Sizes
from pipeline.plan.symmetry import mirror_planes
from pipeline.scene.model import Scene
from pipeline.solve.linear import SolveError
from pipeline.study.schema import Below, Cylinder, Disc
from pipeline.study.sweep import Case

T = TypeVar("T")


def mesh_case(case: Case, mirrors: tuple[str, ...], comm: MPI.Comm) -> tuple[BodyMesh, float]:
    """Return the mesh of a case, of the part that ``mirrors`` leave of it, and the seconds it took; collective.

    Raises:
        MeshError: on every rank.
    """
    start = MPI.Wtime()
    arrays = on_first_rank(comm, lambda: mesh_arrays(case, mirrors))
    mesh = distribute(comm, arrays)
    return mesh, comm.allreduce(MPI.Wtime() - start, op=MPI.MAX)


def mesh_arrays(case: Case, mirrors: tuple[str, ...]) -> MeshArrays:
    """Return the mesh of a case as arrays, of the part that ``mirrors`` leave of it."""
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
    return reflect(arrays, tuple(plane for plane in planes if plane not in mirrors))


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
