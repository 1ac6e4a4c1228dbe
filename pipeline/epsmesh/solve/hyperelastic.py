"""A hyperelastic body on the elements of linear elasticity: energy, nodal forces, and linear systems of its tangent."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Protocol

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import assemble, global_sum
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.elements.fields import Fields
from epsmesh.solve.elements.tangent import Prestress, Tangent
from epsmesh.solve.kernels.tangent import TangentCells
from epsmesh.solve.krylov import INDEFINITE, explain, has_converged, is_nearly_converged, solver_of
from epsmesh.solve.loads import Applied
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.solve.terms import DeadLoads, Term


class Preconditioner(Protocol):
    """A preconditioner of the tangent: linear elasticity."""

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply it; PETSc calls this."""

    def refine_eigenvalues(self) -> bool:
        """Repair it if it is indefinite; return whether it was repaired."""


class Imposed:
    """The work H : E of a prestress, E Green's strain, or ε in regions of a linear law: see :class:`.terms.Term`.

    It is ½ (x + u)·K (x + u) − ½ x·K x, with K its part of the tangent; in linear regions the force is K x. The tangent
    has K at its quadrature points.
    """

    def __init__(self, space: ElasticSpace, tangent: Tangent, stress: list[FloatArray], unit: float):
        """Set up for a ``stress`` in a ``unit`` (Pa); collective. ``moduli`` are its part of the tangent."""
        whole = tangent.cells.geometric(stress)
        self.moduli = tangent.of_large_strain(whole)
        self._stiffness, self._space, self._unit = tangent.operator(self.moduli), space, unit
        self._constant = tangent.operator(whole).whole(space.places)

    @property
    def _u(self) -> FloatArray:
        return self._space.forms.displacement.x.array[: self._space.owned]

    def forces(self) -> FloatArray:
        """Return the nodal forces (N), owned dofs; collective."""
        return self._unit * (self._constant + self._stiffness.whole(self._u))

    def energy(self) -> float:
        """Return this rank's part of the work (J); collective."""
        u = self._u
        return self._unit * (float(u @ self._constant) + float(u @ self._stiffness.whole(u)) / 2)

    def operator(self, into: PETSc.Mat | None = None) -> None:
        """Return None: see above."""


class HyperelasticBody:
    """A hyperelastic body on the elements of linear elasticity; ``close`` frees it.

    ``held`` are the prescribed dofs. Its state is one vector of owned dofs: displacement, and in mixed elements
    pressure.
    """

    def __init__(
        self,
        elements: Elements,
        law: MaterialLaw,
        solver: Preconditioner | None = None,
        *,
        prestressed: bool = False,
    ):
        """Set up; collective. ``solver`` is a preconditioner, which :meth:`respond` needs.

        ``prestressed``: :meth:`impose` may change the energy.
        """
        self._elements, self._preconditioner = elements, solver
        self._space, self._unit = elements.displacements, elements.unit(law)
        self.held = self._space.prescribed_owned
        self._forms = elements.large_forms(law, scaled=prestressed)
        self._share, self._share_of_loads = 1.0, 1.0  # of terms, and of dead loads
        self._loads: list[Term] = []
        self._imposed: list[Imposed] = []
        self._stack = ExitStack()
        self._tangent = elements.tangent(law)
        self._stack.callback(self._tangent.close)
        self.tangent = self._tangent.matrix
        self.iterations = 0

    def close(self) -> None:
        """Free the tangent."""
        self._stack.close()

    @contextmanager
    def state(self) -> Iterator[PETSc.Vec]:
        """Lend a zero state."""
        with self._elements.fields() as parts:
            size = sum(part.getLocalSize() for part in parts)
        found = PETSc.Vec().createMPI((size, None), comm=self._space.comm)
        try:
            yield found
        finally:
            found.destroy()

    def show(self, state: PETSc.Vec) -> None:
        """Set the fields of the forms."""
        with self._elements.fields() as parts:
            for part, values in zip(parts, self.split(state.getArray(readonly=True), parts), strict=True):
                part.array[:] = values
            self._elements.set_fields(parts)

    def split(self, values: FloatArray, parts: Fields) -> list[FloatArray]:
        """Return the values of a state by field."""
        return np.split(values, np.cumsum([part.getLocalSize() for part in parts])[:-1])

    def energy(self, state: PETSc.Vec) -> float:
        """Return the energy (J) of the modelled part, NaN if tissue is inside out; collective.

        It is the stored one, less the work of dead loads.
        """
        self.show(state)
        own = fem.assemble_scalar(self._forms.energy)
        for share, term in self._terms:
            own += share / self._unit * term.energy()
        return self._unit * float(self._space.comm.allreduce(own, op=MPI.SUM))

    @property
    def _terms(self) -> list[tuple[float, Term]]:
        """All terms besides the law, each with its share."""
        shared = [(self._share, term) for term in self._space.terms]
        shared += [(self._share_of_loads, term) for term in self._loads]
        return [*shared, *((1.0, term) for term in self._imposed)]

    def carry(self, applied: Applied | None, share: float = 1.0, *, of_terms: float | None = None) -> None:
        """Let a ``share`` of dead loads act on the body from now on, and one of the terms of the space: the same."""
        self._loads = [] if applied is None else [DeadLoads(applied.forces, self._space.forms.displacement)]
        self._share_of_loads, self._share = share, share if of_terms is None else of_terms
        self._tangent.share = self._share

    def on_terms(self, state: PETSc.Vec) -> tuple[FloatArray, float]:
        """Return the sum (3) of the nodal forces (N) of all terms besides the law, and of their sizes; collective."""
        self.show(state)
        forces = [(share * term.forces()).reshape(-1, 3) for share, term in self._terms]
        own = [np.append(part.sum(axis=0), np.linalg.norm(part, axis=1).sum()) for part in forces]
        *resultant, size = global_sum(self._space.comm, sum(own, np.zeros(4)))
        return np.array(resultant), float(size)

    def held_of(self, state: PETSc.Vec) -> FloatArray:
        """Return the prescribed dofs (m) of a state."""
        return np.array(state.array_r[self.held])

    def impose(self, prestress: Prestress | None, factors: tuple[float, ...] = ()) -> None:
        """Change the energy from now on; None leaves only ``factors``, by region; collective."""
        self._forms.set_factors(factors if prestress is None else prestress.factors)
        self._imposed = []
        if prestress is not None:
            imposed = Imposed(self._space, self._tangent, prestress.stress, self._unit)
            self._imposed = [imposed]
            self._tangent.impose(prestress.factors, imposed.moduli)

    def stresses(self, state: PETSc.Vec) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return stress (of the unchanged energy, in the law's unit) and strain: see ``Tangent``; collective."""
        self.show(state)
        return self._tangent.stresses()

    def force_of(self, stress: list[FloatArray], state: PETSc.Vec, direction: FloatArray) -> float:
        """Return the work (J) that a change of the prestress by ``stress`` does in a ``direction``, a state."""
        self.show(state)
        forces = Imposed(self._space, self._tangent, stress, self._unit).forces()
        own = float(forces @ direction[: self._space.owned])
        return float(self._space.comm.allreduce(own, op=MPI.SUM))

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        return self._space.comm

    @property
    def points(self) -> TangentCells:
        """The cells, laid out for values at quadrature points."""
        return self._tangent.cells

    @property
    def unit(self) -> float:
        """The unit of stresses (Pa)."""
        return self._unit

    def forces(self, state: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the residual (N), nodal forces at prescribed dofs included, into ``result``; collective."""
        self.residual(state, result)
        result.scale(self._unit)

    def norm_on_held(self, forces: PETSc.Vec) -> float:
        """Return the norm of ``forces`` (N) at prescribed dofs; collective."""
        on_held = forces.array[self.held]
        return float(np.sqrt(self._space.comm.allreduce(float(on_held @ on_held))))

    @property
    def is_mixed(self) -> bool:
        """Whether elements have displacement and pressure."""
        return len(self._forms.residuals) > 1

    @property
    def displaced(self) -> int:
        """The number of owned dofs of the displacement, which come first in a state."""
        return self._space.owned

    @property
    def mean_size(self) -> float:
        """The mean size (m) of elements."""
        return self._elements.body.mean_size

    def residual(self, state: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the derivative of the energy, in the unit of the law, prescribed dofs included; collective."""
        self.show(state)
        with self._elements.fields() as parts:
            for residual, part in zip(self._forms.residuals, parts, strict=True):
                assemble(residual, part)
            for share, term in self._terms:
                parts[0].array[:] += share / self._unit * term.forces()
            self._elements.weigh(parts)
            result.array[:] = np.concatenate([part.array for part in parts])

    def assemble(self, state: PETSc.Vec) -> None:
        """Evaluate the tangent at a state; collective."""
        self.show(state)
        self._tangent.update()
        self.tangent.assemble()

    def solver(self, stack: ExitStack) -> PETSc.KSP:
        """Return a solver of the tangent's systems, freed with the ``stack``."""
        return solver_of("tangent, mixed" if self.is_mixed else "tangent", self.tangent, stack, self._preconditioner)

    def respond(
        self, ksp: PETSc.KSP, state: PETSc.Vec, residual: PETSc.Vec, prescribed: FloatArray, result: PETSc.Vec
    ) -> None:
        """Write the increment from a ``state`` that takes away a ``residual`` into ``result``; collective.

        ``prescribed`` are its values at prescribed dofs, where the residual is zero. If the preconditioner proves
        indefinite, it is repaired and the solver continues.

        Raises:
            LargeError: if the solver does not converge.
        """
        self.assemble(state)
        with self.state() as load:
            # Prescribed values are in the initial guess: the preconditioner may ignore these dofs.
            result.set(0.0)
            result.array[self.held] = prescribed
            load.array[:] = -residual.array - self._tangent.whole(result.array[: self._space.owned])
            load.array[self.held] = prescribed
            self._run(ksp, load, result)

    def _run(self, ksp: PETSc.KSP, load: PETSc.Vec, found: PETSc.Vec) -> None:
        repair = self._preconditioner
        try:
            self._counted(ksp, load, found)
            if ksp.getConvergedReason() == INDEFINITE and repair and repair.refine_eigenvalues():
                self._counted(ksp, load, found)
        except PETSc.Error as error:
            raise LargeError(explain(error)) from error
        if not (has_converged(ksp) or is_nearly_converged(ksp)):
            raise LargeError(f"reason {ksp.getConvergedReason()}")

    def _counted(self, ksp: PETSc.KSP, load: PETSc.Vec, found: PETSc.Vec) -> None:
        ksp.solve(load, found)
        self.iterations += ksp.its
