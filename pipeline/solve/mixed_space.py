"""Taylor–Hood spaces: displacements of degree k with their conditions, pressures of degree k − 1.

Pressures are continuous, but from one region of the body to the next.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.conditions import whole_points
from pipeline.solve.forms import curved_cells
from pipeline.solve.material import MaterialLaw
from pipeline.solve.mixed_forms import MixedForms
from pipeline.solve.region_space import region_wise_space
from pipeline.solve.saddle import Pair
from pipeline.solve.spaces import ElasticSpace
from pipeline.solve.straight import assembles
from pipeline.solve.straight import mixed as straight
from pipeline.solve.vectors import add_from_ghosts, fill, vector


class MixedSpace:
    """Displacements and pressures on a mesh, and what couples them.

    Pressures are counted in units of ``unit`` × μ, ``unit`` (1/m) being about one over the element size: the blocks
    of the saddle point are then of like magnitude in any unit of length.
    """

    def __init__(self, body: BodyMesh, displacements: ElasticSpace):
        """Add the pressures to the ``displacements`` on a mesh; collective."""
        self.comm, self.degree = body.comm, displacements.degree
        self.displacements = displacements
        self.pressures, self._region = region_wise_space(body, displacements.degree - 1)
        self._has_regions = body.regions is not None
        self.forms = MixedForms(displacements.forms.displacement, self.pressures)
        index_map = self.pressures.dofmap.index_map
        self._owned, self._size = index_map.size_local, index_map.size_global
        self.dofs = displacements.dofs.dofs + index_map.size_global
        self.whole_dofs = displacements.dofs.whole_dofs + whole_points(self.pressures, body)
        with ExitStack() as stack:
            start = time.perf_counter()
            self.mass, self.coupling = self._matrices(body)
            stack.callback(self.mass.destroy)
            stack.callback(self.coupling.destroy)
            self._mask_coupling()
            diagonal = self.mass.getDiagonal()
            self.unit = (diagonal.sum() / self._size) ** (-1 / 3)
            diagonal.destroy()
            self.mass.scale(self.unit**2)
            self.coupling.scale(self.unit)
            self.assembly_seconds = time.perf_counter() - start
            self._stack = stack.pop_all()

    def close(self) -> None:
        """Free the matrices that pressures take part in."""
        self._stack.close()

    def by_region(self, values: tuple[float, ...]) -> float | FloatArray:
        """Return what a pressure dof has of a value by region: one for all, or an array for this rank's dofs."""
        return np.array(values)[self._region] if self._has_regions else values[0]

    @contextmanager
    def pair(self) -> Iterator[Pair]:
        """Lend ghosted vectors of zeros for displacement and pressure."""
        with vector(self.displacements.dofs.space) as u, vector(self.pressures) as p:
            yield u, p

    def lift(self, rhs: Pair, held: FloatArray, law: MaterialLaw) -> None:
        """Put the loads of the prescribed displacements ``held`` into ``rhs``, the law being K₀'s; collective."""
        self.displacements.lift(rhs[0], held, law)
        self._dilate(rhs[1])
        rhs[1].scale(-1.0)

    def set_fields(self, unknown: Pair) -> None:
        """Make ``unknown`` the displacement and the pressure that ``apply`` acts on; collective."""
        self.displacements.set_displacement(unknown[0])
        fill(self.forms.pressure, unknown[1], self.unit)

    def apply(self, elastic: PETSc.Vec, pull: PETSc.Vec, dilation: PETSc.Vec, law: MaterialLaw) -> None:
        """Add K₀ u, Bᵀ p and B u, all with the unmodified operator, to the three vectors; collective."""
        self.displacements.apply(elastic, law)
        fem_petsc.assemble_vector(pull, self.forms.pull)
        add_from_ghosts(pull)
        self._dilate(dilation)

    def start_from(self, coarse: "MixedSpace", unknown: Pair, held: FloatArray) -> None:
        """Put the fields of ``coarse``, less the displacements ``held``, into ``unknown``; collective."""
        displacement, pressure = self.displacements.forms.displacement, self.forms.pressure
        displacement.interpolate(coarse.displacements.forms.displacement)
        pressure.interpolate(coarse.forms.pressure)
        dofs = self.displacements.dofs
        unknown[0].array[:] = displacement.x.array[: dofs.owned] - held[: dofs.owned]
        unknown[0].array[dofs.prescribed_owned] = 0.0
        unknown[1].array[:] = pressure.x.array[: self._owned] / self.unit

    def _matrices(self, body: BodyMesh) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Return M and B, without conditions; collective."""
        if not assembles(self.displacements.dofs.space):
            return _assemble(self.forms.mass), _assemble(self.forms.coupling)
        curved = curved_cells(body.mesh)
        is_curved = self.comm.allreduce(curved is not None and bool(curved.any()), op=MPI.LOR)
        mass = straight.mass(self.pressures, curved)
        coupling = straight.coupling(self.pressures, self.displacements.dofs.space, curved)
        if is_curved:
            compat.add_matrix(mass, self.forms.curved_mass, [], 1.0)
            compat.add_matrix(coupling, self.forms.curved_coupling, [], 1.0)
        return mass, coupling

    def _dilate(self, result: PETSc.Vec) -> None:
        fem_petsc.assemble_vector(result, self.forms.dilation)
        add_from_ghosts(result)
        result.scale(self.unit)

    def _mask_coupling(self) -> None:
        free = self.coupling.createVecRight()
        free.set(1.0)
        free.array[self.displacements.dofs.prescribed_owned] = 0.0
        self.coupling.diagonalScale(None, free)
        free.destroy()


def _assemble(form: object) -> PETSc.Mat:
    return compat.assemble_matrix(form, [], 1.0, "aij")
