"""Pressures of mixed elements, one degree below the displacements, and the coupling between both.

Pressures are continuous within each region of a body and jump between regions. The pressure is λ₁ div u, which jumps
where λ does: a continuous pressure would smear the jump over the cells on both sides. Masses and Schur complements then
weigh the dofs of each region separately.
"""

from contextlib import ExitStack
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve.compiled import add_from_ghosts, assemble, fill, scalar_space, vector
from epsmesh.solve.forms import MixedForms
from epsmesh.solve.kernels.pressure import CellPressures, Coupling, Mass
from epsmesh.solve.krylov import keep
from epsmesh.solve.spaces import ElasticSpace, whole_points
from epsmesh.stages import stage


class Pressures:
    """Pressures on a mesh, with B(q, u) = ∫ q div u and M(p, q) = ∫ p q. Methods are collective.

    Pressures are in units of ``unit`` × μ, with ``unit`` (1/m) about one over the element size. The blocks of the
    saddle point then have similar magnitude in any unit of length. B and M act cell by cell (:meth:`blocks`), and are
    assembled where entries are needed. ``owned``, ``dofs`` and ``whole_dofs`` count those of this rank, of the modelled
    part and of the whole body.
    """

    def __init__(self, body: BodyMesh, displacements: ElasticSpace):
        """Add pressures to ``displacements`` on a mesh."""
        self._displacements = displacements
        self.space, self._region = region_wise_space(body, displacements.degree - 1)
        self._has_regions = body.regions is not None
        self.forms = MixedForms(displacements.forms, self.space)
        index_map = self.space.dofmap.index_map
        self.owned, self.dofs = index_map.size_local, index_map.size_global
        self.whole_dofs = whole_points(self.space, body)
        self._stack = ExitStack()
        with stage("assembly"):
            self.cells = CellPressures(self.space, displacements.cells)
            self.unit = self.cells.unit

    def close(self) -> None:
        """Free the matrices."""
        self._stack.close()

    def blocks(self, *, entries: bool) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Return B and M: assembled with ``entries``, otherwise matrix-free.

        B has zero columns for prescribed displacements. Both matrices are kept here, and freed with the pressures.
        """
        return self._assembled if entries else self._shells

    def holding(self, held: Int32Array, *, entries: bool) -> PETSc.Mat:
        """Return B with zero columns for the owned dofs ``held``, too; the caller destroys it."""
        coupling, _ = self.blocks(entries=entries)
        if not entries:
            return coupling.getPythonContext().holding(held).matrix()
        coupling = coupling.copy()
        without_columns(coupling, held)
        return coupling

    def by_region(self, values: tuple[float, ...]) -> float | FloatArray:
        """Return a value by region on pressure dofs: one number for all, or an array for this rank's dofs."""
        return np.array(values)[self._region] if self._has_regions else values[0]

    @property
    def values(self) -> FloatArray:
        """The pressure of the forms, owned dofs."""
        return np.asarray(self.forms.pressure.x.array[: self.owned] / self.unit)

    def set(self, pressure: PETSc.Vec) -> None:
        """Set the pressure of the forms."""
        fill(self.forms.pressure, pressure, self.unit)

    def weighed(self) -> FloatArray:
        """Return M p for the pressure of the forms, owned dofs."""
        return self.cells.weigh(self.values)

    def pull(self, result: PETSc.Vec, *, checked: bool) -> None:
        """Add Bᵀ p, for all displacement dofs, to ``result``. ``checked``: see :meth:`ElasticSpace.apply`."""
        if not checked:
            result.array[:] += self.cells.pull(self.values, whole=True)
            return
        with vector(self._displacements.space) as pull:
            assemble(self.forms.pull, pull)
            result.axpy(1.0, pull)

    def dilate(self, result: PETSc.Vec, *, checked: bool) -> None:
        """Write B u, for all displacement dofs, into ``result``. ``checked``: see :meth:`ElasticSpace.apply`."""
        if not checked:
            displacement = self._displacements.forms.displacement.x.array[: self._displacements.owned]
            result.array[:] = self.cells.dilation(displacement, whole=True)
            return
        assemble(self.forms.dilation, result)
        result.scale(self.unit)

    @cached_property
    def _shells(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        coupling, mass = (keep(self._stack, kind(self.cells).matrix()) for kind in (Coupling, Mass))
        return coupling, mass

    @cached_property
    @stage("assembly")
    def _assembled(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        coupling, mass = (
            keep(self._stack, compat.assemble_matrix(form, [], 1.0)) for form in (self.forms.coupling, self.forms.mass)
        )
        without_columns(coupling, self._displacements.prescribed_owned)
        coupling.scale(self.unit)
        mass.scale(self.unit**2)
        return coupling, mass


def region_wise_space(body: BodyMesh, degree: int) -> tuple[Any, Int32Array]:
    """Return the space of scalars of ``degree``, and the region of each owned dof; collective.

    On a mesh of one region the space is continuous everywhere.
    """
    space = scalar_space(body.mesh, degree)
    owned = space.dofmap.index_map.size_local
    if body.regions is None:
        return space, np.zeros(owned, dtype=np.int32)
    count = 1 + body.comm.allreduce(int(body.regions.max(initial=0)), op=MPI.MAX)
    # A dof has one copy for each of its regions; the copies of a dof have consecutive numbers.
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


def without_columns(matrix: PETSc.Mat, dofs: Int32Array) -> None:
    """Make the columns of owned ``dofs`` zero; collective."""
    free = matrix.createVecRight()
    free.set(1.0)
    free.array[dofs] = 0.0
    matrix.diagonalScale(None, free)
    free.destroy()


def _copies(space: Any, regions: Int32Array, count: int) -> BoolArray:
    """Return a mask by local dof and region: whether a cell of any rank in this region has the dof."""
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
    """Return the global number of the first copy of each local dof; ``owned`` are those of the owned dofs."""
    with vector(space) as numbers:
        numbers.array[:] = owned  # integers of this size are exact in double precision
        return _with_ghosts(numbers).astype(np.int64)


def _with_ghosts(values: PETSc.Vec) -> FloatArray:
    values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    with values.localForm() as local:
        return np.array(local.array)
