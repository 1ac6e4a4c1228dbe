"""Taylor–Hood spaces: displacements of degree k with their conditions, pressures of degree k − 1.

Pressures are continuous, but from one region of the body to the next.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.forms import MixedForms
from pipeline.solve.kernels.pressure import CellPressures, Coupling, Mass
from pipeline.solve.krylov import keep
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.region_space import region_wise_space
from pipeline.solve.saddle import Pair
from pipeline.solve.spaces import ElasticSpace, whole_points
from pipeline.solve.vectors import add_from_ghosts, fill, vector
from pipeline.stages import stage


class MixedSpace:
    """Displacements and pressures on a mesh, and what couples them.

    Pressures are counted in units of ``unit`` × μ, ``unit`` (1/m) being about one over the element size: the blocks
    of the saddle point are then of like magnitude in any unit of length. What couples them is multiplied cell by cell
    (:meth:`blocks`), and assembled where entries are asked for.
    """

    def __init__(self, body: BodyMesh, displacements: ElasticSpace):
        """Add the pressures to the ``displacements`` on a mesh; collective."""
        self.comm, self.degree = body.comm, displacements.degree
        self.displacements = displacements
        self.pressures, self._region = region_wise_space(body, displacements.degree - 1)
        self._has_regions = body.regions is not None
        self.forms = MixedForms(displacements.forms.displacement, self.pressures)
        index_map = self.pressures.dofmap.index_map
        self._owned = index_map.size_local
        self.dofs = displacements.dofs.dofs + index_map.size_global
        self.whole_dofs = displacements.dofs.whole_dofs + whole_points(self.pressures, body)
        self._body, self._stack = body, ExitStack()
        with stage("assembly"):
            self._products = CellPressures(self.pressures, displacements.operators.cells)
            self.unit = self._products.unit

    def close(self) -> None:
        """Free the matrices that pressures take part in."""
        self._stack.close()

    def blocks(self, *, entries: bool) -> tuple[PETSc.Mat, PETSc.Mat]:
        """Return B and M, which are the space's: with ``entries``, or maybe as products; collective."""
        if entries:
            return self.coupling, self.mass
        return self._shells

    @cached_property
    def mass(self) -> PETSc.Mat:
        """M, with entries, assembled when first asked for; collective."""
        return self._assembled[0]

    @cached_property
    def coupling(self) -> PETSc.Mat:
        """B, with entries, and columns of zeros for what is prescribed, assembled when first asked for; collective."""
        return self._assembled[1]

    def weigh(self, pressure: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write M p into ``result``; collective."""
        self.blocks(entries=False)[1].mult(pressure, result)

    def by_region(self, values: tuple[float, ...]) -> float | FloatArray:
        """Return what a pressure dof has of a value by region: one for all, or an array for this rank's dofs."""
        return np.array(values)[self._region] if self._has_regions else values[0]

    @contextmanager
    def pair(self) -> Iterator[Pair]:
        """Lend ghosted vectors of zeros for displacement and pressure."""
        with vector(self.displacements.dofs.space) as u, vector(self.pressures) as p:
            yield u, p

    def lift(self, rhs: Pair, held: FloatArray, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put the loads of the prescribed displacements ``held`` into ``rhs``, the law being K₀'s; collective."""
        self.displacements.lift(rhs[0], held, law, checked=checked)
        self._dilate(rhs[1], checked=checked)
        rhs[1].scale(-1.0)

    def set_fields(self, unknown: Pair) -> None:
        """Make ``unknown`` the displacement and the pressure that ``apply`` acts on; collective."""
        self.displacements.set_displacement(unknown[0])
        fill(self.forms.pressure, unknown[1], self.unit)

    def apply(
        self, elastic: PETSc.Vec, pull: PETSc.Vec, dilation: PETSc.Vec, law: MaterialLaw, *, checked: bool = True
    ) -> None:
        """Add K₀ u, Bᵀ p and B u, all with the unmodified operator, to the three vectors; collective.

        ``checked``: see :meth:`ElasticSpace.apply`.
        """
        self.displacements.apply(elastic, law, checked=checked)
        if not checked:
            pressure = self.forms.pressure.x.array[: self._owned] / self.unit
            pull.array[:] += self._products.pull(pressure, whole=True)
        else:
            fem_petsc.assemble_vector(pull, self.forms.pull)
            add_from_ghosts(pull)
        self._dilate(dilation, checked=checked)

    def start_from(self, coarse: "MixedSpace", unknown: Pair, held: FloatArray) -> None:
        """Put the fields of ``coarse``, less the displacements ``held``, into ``unknown``; collective."""
        displacement, pressure = self.displacements.forms.displacement, self.forms.pressure
        displacement.interpolate(coarse.displacements.forms.displacement)
        pressure.interpolate(coarse.forms.pressure)
        dofs = self.displacements.dofs
        unknown[0].array[:] = displacement.x.array[: dofs.owned] - held[: dofs.owned]
        unknown[0].array[dofs.prescribed_owned] = 0.0
        unknown[1].array[:] = pressure.x.array[: self._owned] / self.unit

    @cached_property
    def _shells(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        matrices = Coupling(self._products).matrix(), Mass(self._products).matrix()
        for matrix in matrices:
            self._stack.callback(matrix.destroy)
        return matrices

    @cached_property
    @stage("assembly")
    def _assembled(self) -> tuple[PETSc.Mat, PETSc.Mat]:
        """M and B; collective."""
        mass, coupling = (keep(self._stack, _assemble(form)) for form in (self.forms.mass, self.forms.coupling))
        free = coupling.createVecRight()
        free.set(1.0)
        free.array[self.displacements.dofs.prescribed_owned] = 0.0
        coupling.diagonalScale(None, free)
        free.destroy()
        mass.scale(self.unit**2)
        coupling.scale(self.unit)
        return mass, coupling

    def _dilate(self, result: PETSc.Vec, *, checked: bool) -> None:
        if not checked:
            displacement = self.displacements.forms.displacement.x.array[: self.displacements.dofs.owned]
            result.array[:] += self._products.dilation(displacement, whole=True)
            return
        fem_petsc.assemble_vector(result, self.forms.dilation)
        add_from_ghosts(result)
        result.scale(self.unit)


def _assemble(form: object) -> PETSc.Mat:
    return compat.assemble_matrix(form, [], 1.0)
