"""Vectors on the dofs of a space, distributed like it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray


@contextmanager
def vector(space: Any) -> Iterator[PETSc.Vec]:
    """Lend a ghosted vector of zeros on the dofs of ``space``; collective."""
    index_map, width = space.dofmap.index_map, space.dofmap.index_map_bs
    ghosts = np.asarray(index_map.ghosts, dtype=PETSc.IntType)
    size = width * index_map.size_local, None
    # Without blocks for scalars: PETSc's ghosted vectors of blocks of one are slower to make.
    blocks = {"bsize": width} if width > 1 else {}
    found = PETSc.Vec().createGhost(ghosts, size, comm=space.mesh.comm, **blocks)
    found.set(0.0)
    try:
        yield found
    finally:
        found.destroy()


def fill(function: Any, values: PETSc.Vec, factor: float = 1.0) -> None:
    """Make ``factor`` times ``values`` the dofs of ``function``, ghosts included; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    with values.localForm() as local:
        function.x.array[:] = factor * local.array if factor != 1.0 else local.array


def assemble(form: Any, result: PETSc.Vec) -> None:
    """Write the vector of a linear form into ``result``; collective."""
    with result.localForm() as local:
        local.set(0.0)
    fem_petsc.assemble_vector(result, form)
    add_from_ghosts(result)


def add_from_ghosts(values: PETSc.Vec) -> None:
    """Add what each rank has put on ghosts to their owners; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)


def global_sum(comm: MPI.Comm, values: FloatArray) -> FloatArray:
    """Return the sum of ``values`` over all ranks, entry by entry; collective."""
    total = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), total)
    return total
