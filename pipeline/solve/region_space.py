"""Pressures that are continuous within each region of a body and jump from one to the next.

The pressure of a mixed element is λ₁ div u: where λ jumps, so does it, and a continuous one would smear the jump over
the cells on either side. Masses and Schur complements then weigh the dofs of each region, and nothing couples two.
"""

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.compiled import scalar_space
from pipeline.solve.vectors import add_from_ghosts, vector


def region_wise_space(body: BodyMesh, degree: int) -> tuple[Any, Int32Array]:
    """Return the space of scalars of ``degree``, and the region of each owned dof; collective.

    On a mesh of one region it is the continuous space.
    """
    space = scalar_space(body.mesh, degree)
    owned = space.dofmap.index_map.size_local
    if body.regions is None:
        return space, np.zeros(owned, dtype=np.int32)
    count = 1 + body.comm.allreduce(int(body.regions.max(initial=0)), op=MPI.MAX)
    # A dof has a copy for each region that it is in; the copies of one follow each other.
    has_copy = _copies(space, body.regions, count)
    copies = int(has_copy[:owned].sum())
    first = body.mesh.comm.scan(copies) - copies
    begins = _first_copies(space, first + np.cumsum(has_copy[:owned].sum(axis=1)) - has_copy[:owned].sum(axis=1))
    ghosts = (begins[owned:, None] + np.cumsum(has_copy[owned:], axis=1) - 1)[has_copy[owned:]]
    owners = np.repeat(np.asarray(space.dofmap.index_map.owners), has_copy[owned:].sum(axis=1))
    number = np.cumsum(has_copy.reshape(-1)).reshape(has_copy.shape) - 1
    dofs = number[compat.cell_dofs(space), body.regions[:, None]]
    renumbered = compat.renumbered_space(space, dofs, copies, ghosts, owners)
    return renumbered, np.nonzero(has_copy[:owned])[1].astype(np.int32)


def _copies(space: Any, regions: Int32Array, count: int) -> BoolArray:
    """Tell, for each local dof and region, whether a cell of any rank that has the dof is in the region."""
    dofs, columns = compat.cell_dofs(space), []
    with vector(space) as mark:
        for region in range(count):
            with mark.localForm() as local:
                local.array[:] = 0.0
                local.array[dofs[regions == region].reshape(-1)] = 1.0
            add_from_ghosts(mark)
            columns.append(_with_ghosts(mark) > 0)
    return np.column_stack(columns)


def _first_copies(space: Any, owned: IntArray) -> IntArray:
    """Return the global number of the first copy of each local dof, given those that this rank owns."""
    with vector(space) as numbers:
        numbers.array[:] = owned  # double precision holds them to the last digit
        return _with_ghosts(numbers).astype(np.int64)


def _with_ghosts(values: PETSc.Vec) -> FloatArray:
    values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    with values.localForm() as local:
        return np.array(local.array)
