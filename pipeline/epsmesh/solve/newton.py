"""Newton's method for the equilibrium of a hyperelastic body with prescribed displacements.

The first step may also bring prescribed dofs to their goal: it is then the response of the tangent. Linear systems are
solved by conjugate gradients, in mixed elements by generalised conjugate residuals. The tangent is matrix-free. The
preconditioner is that of linear elasticity, which is set up once: at moderate strain the tangent is close to it.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from math import inf
from typing import Protocol

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import assemble, global_sum
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.elements.fields import Fields
from epsmesh.solve.elements.tangent import Prestress, Tangent
from epsmesh.solve.kernels.tangent import TangentCells
from epsmesh.solve.krylov import INDEFINITE, INDEFINITE_MATRIX, explain, solver_of
from epsmesh.solve.loads import Applied
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.solve.terms import DeadLoads, Term
from epsmesh.stages import stage

# Tolerance on the residual, relative to the forces at prescribed dofs, and most Newton iterations.
LEFT, _MOST = 1e-9, 25
# The same for load steps before the last: the work of F has fewer digits.
ON_THE_WAY = 1e-4
# At most so many Newton iterations of a load step were easy: the next one may be longer.
EASY = 4
# A residual has stalled if an iteration leaves this share of it; then rounding of gradients by this may be all of it.
_STALLS, _ROUNDED = 0.5, float(np.finfo(float).eps) / 2
# Tolerances of linear solves: the first one and the least, and the share of the gain that is needed to the end.
_ROUGH, _FINE, _SPARE = 1e-1, 1e-4, 0.1
# Most halvings of a step that turns tissue inside out.
_HALVINGS = 12
# Sufficient decrease: least gain of energy, as a share of that predicted by the slope.
_GAIN = 1e-4


class Preconditioner(Protocol):
    """A preconditioner of the tangent: linear elasticity."""

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply it; PETSc calls this."""

    def refine_eigenvalues(self) -> bool:
        """Repair it if it is indefinite; return whether it was repaired."""


class LargeError(SolveError):
    """Newton's method does not converge at the prescribed displacement.

    ``reached`` are the depth (m) and the force (N) of the whole body at the end of the load path, if it has one.
    """

    def __init__(self, message: str, reached: tuple[float, float] | None = None):
        super().__init__(message)
        self.reached = reached


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
    """A hyperelastic body on the elements of linear elasticity, and Newton's method for it; ``close`` frees it.

    Its state is one vector of owned dofs: displacement, and in mixed elements pressure.
    """

    def __init__(
        self,
        elements: Elements,
        law: MaterialLaw,
        solver: Preconditioner | None = None,
        *,
        prestressed: bool = False,
    ):
        """Set up; collective. ``solver`` is a preconditioner, which :meth:`move` and :meth:`equilibrate` need.

        ``prestressed``: :meth:`impose` may change the energy.
        """
        self._elements, self._solver = elements, solver
        self._space, self._unit = elements.displacements, elements.unit(law)
        self._held = self._space.prescribed_owned
        self._forms = elements.large_forms(law, scaled=prestressed)
        self._share = 1.0  # of terms and dead loads
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
        shared = [(self._share, term) for term in (*self._space.terms, *self._loads)]
        return [*shared, *((1.0, term) for term in self._imposed)]

    def carry(self, applied: Applied | None, share: float = 1.0) -> None:
        """Let a ``share`` of dead loads, and of the terms of the space, act on the body from now on."""
        self._loads = [] if applied is None else [DeadLoads(applied.forces, self._space.forms.displacement)]
        self._share = self._tangent.share = share

    def on_terms(self, state: PETSc.Vec) -> tuple[FloatArray, float]:
        """Return the sum (3) of the nodal forces (N) of all terms besides the law, and of their sizes; collective."""
        self.show(state)
        forces = [(share * term.forces()).reshape(-1, 3) for share, term in self._terms]
        own = [np.append(part.sum(axis=0), np.linalg.norm(part, axis=1).sum()) for part in forces]
        *resultant, size = global_sum(self._space.comm, sum(own, np.zeros(4)))
        return np.array(resultant), float(size)

    def held_of(self, state: PETSc.Vec) -> FloatArray:
        """Return the prescribed dofs (m) of a state."""
        return np.array(state.array_r[self._held])

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
        self._residual(state, result)
        result.scale(self._unit)

    def norm_on_held(self, forces: PETSc.Vec) -> float:
        """Return the norm of ``forces`` (N) at prescribed dofs; collective."""
        on_held = forces.array[self._held]
        return float(np.sqrt(self._space.comm.allreduce(float(on_held @ on_held))))

    @stage("tangent solves")
    def move(self, state: PETSc.Vec, prescribed: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the linearised response to a small change of the ``prescribed`` dofs into ``result``; collective.

        Raises:
            LargeError: if the tangent is not positive definite: the tissue is unstable.
        """
        with ExitStack() as stack, self.state() as load:
            self.assemble(state)
            load.array[:] = -self._tangent.whole(prescribed.array[: self._space.owned])
            load.array[self._held] = prescribed.array[self._held]
            # Prescribed values are in the initial guess: the preconditioner may ignore these dofs.
            result.set(0.0)
            result.array[self._held] = prescribed.array[self._held]
            ksp = solver_of(self._kind("tangent"), self.tangent, stack, self._solver)
            ksp.setTolerances(rtol=_FINE)
            self._run(ksp, lambda: ksp.solve(load, result))

    @stage("Newton's method")
    def equilibrate(self, state: PETSc.Vec, goal: FloatArray, left: float = LEFT) -> int:
        """Find the equilibrium from the initial guess ``state``; collective.

        ``goal`` (m) are the prescribed dofs there, ``left`` is the residual at the end in units of the forces at these
        dofs. Return Newton's iterations.

        Raises:
            LargeError: if Newton's method does not converge.
        """
        with ExitStack() as stack:
            residual, step, there = (stack.enter_context(self.state()) for _ in range(3))
            ksp = solver_of(self._kind("tangent"), self.tangent, stack, self._solver)
            stored = self.energy(state) / self._unit
            if not np.isfinite(stored):
                raise LargeError("tissue is turned inside out")
            before = inf
            for iteration in range(_MOST):
                self._residual(state, residual)
                scale, todo = self.norm_on_held(residual), goal - state.array[self._held]
                residual.array[self._held] = 0.0
                norm, is_there = residual.norm(), not self._space.comm.allreduce(bool(todo.any()), op=MPI.LOR)
                if is_there and norm <= left * scale:
                    return iteration
                if is_there and norm > _STALLS * before and norm <= self._rounding(state):
                    return iteration  # loads, or a depth, next to nothing
                ksp.setTolerances(rtol=forcing(norm / before, left * scale / norm) if is_there else _ROUGH)
                before = norm if is_there else inf
                self._newton_step(ksp, state, residual, todo, step, is_there=is_there)
                stored = self._advance(state, stored, residual, step, there, is_there=is_there)
        raise LargeError(f"no equilibrium after {_MOST} iterations")

    def _rounding(self, state: PETSc.Vec) -> float:
        """Return the residual (in units of the law) that rounding of the displacement's gradient may leave; collective.

        Beside 1, a gradient has the error ε, which is that of nodes displaced by ε times the element size.
        """
        with self.state() as noise, self.state() as forces:
            displaced = self._space.owned
            noise.array[:displaced] = _ROUNDED * self._elements.body.mean_size * np.cos(np.arange(displaced))
            self.assemble(state)
            self.tangent.mult(noise, forces)
            forces.array[self._held] = 0.0
            return float(forces.norm())

    def _newton_step(
        self,
        ksp: PETSc.KSP,
        state: PETSc.Vec,
        residual: PETSc.Vec,
        todo: FloatArray,
        step: PETSc.Vec,
        *,
        is_there: bool,
    ) -> None:
        """Write the step from ``state``, with the change ``todo`` of prescribed dofs, into ``step``.

        Where prescribed dofs are at their goal (``is_there``) and the tangent is indefinite, the step ends at the first
        direction of negative curvature. What conjugate gradients found before reduces the energy (R. S. Dembo and
        T. Steihaug, Math. Program. 26, 190, 1983).
        """
        self.assemble(state)
        with self.state() as load:
            step.set(0.0)
            step.array[self._held] = todo
            load.array[:] = -residual.array - self._tangent.whole(step.array[: self._space.owned])
            load.array[self._held] = todo
            try:
                self._run(ksp, lambda: ksp.solve(load, step))
            except LargeError:
                is_truncated = is_there and ksp.getConvergedReason() == INDEFINITE_MATRIX
                if not (is_truncated and step.norm() > 0):
                    raise

    def _advance(
        self, state: PETSc.Vec, stored: float, residual: PETSc.Vec, step: PETSc.Vec, there: PETSc.Vec, *, is_there: bool
    ) -> float:
        """Add the step to ``state``, halved until no tissue is inside out and less energy is stored; return the energy.

        Where rounding hides the decrease of the energy, and in mixed elements, whose energy is stationary and no
        minimum, the residual must fall. A step that moves prescribed dofs (not ``is_there``) is taken whole.

        Raises:
            LargeError: if no step is short enough.
        """
        left, slope = residual.norm(), -residual.dot(step)
        for halvings in range(_HALVINGS):
            share = 0.5**halvings
            there.waxpy(share, step, state)
            energy = self.energy(there) / self._unit
            if not np.isfinite(energy):
                if not is_there:
                    break
                continue
            falls = not is_there or (not self._is_mixed and energy <= stored - _GAIN * share * slope)
            if not falls:
                self._function(there, residual)
                falls = residual.norm() <= (1 - _GAIN * share) * left
            if falls:
                there.copy(state)
                return energy
        raise LargeError("tissue is turned inside out")

    @property
    def _is_mixed(self) -> bool:
        return len(self._forms.residuals) > 1

    def _kind(self, solver: str) -> str:
        return f"{solver}, mixed" if self._is_mixed else solver

    def _residual(self, state: PETSc.Vec, result: PETSc.Vec) -> None:
        self.show(state)
        with self._elements.fields() as parts:
            for residual, part in zip(self._forms.residuals, parts, strict=True):
                assemble(residual, part)
            for share, term in self._terms:
                parts[0].array[:] += share / self._unit * term.forces()
            self._elements.weigh(parts)
            result.array[:] = np.concatenate([part.array for part in parts])

    def _function(self, state: PETSc.Vec, result: PETSc.Vec) -> None:
        self._residual(state, result)
        result.array[self._held] = 0.0

    def assemble(self, state: PETSc.Vec) -> None:
        """Evaluate the tangent at a state; collective."""
        self.show(state)
        self._tangent.update()
        self.tangent.assemble()

    def _run(self, ksp: PETSc.KSP, solve: Callable[[], None]) -> None:
        """Solve a linear system, and check that it converges; collective.

        If the preconditioner proves indefinite, it is repaired and the solver continues.

        Raises:
            LargeError: if the solver does not converge.
        """
        try:
            self._counted(ksp, solve)
            if ksp.getConvergedReason() == INDEFINITE and self._solver and self._solver.refine_eigenvalues():
                self._counted(ksp, solve)
        except PETSc.Error as error:
            raise LargeError(explain(error)) from error
        if ksp.getConvergedReason() <= 0:
            raise LargeError(f"reason {ksp.getConvergedReason()}")

    def _counted(self, ksp: PETSc.KSP, solve: Callable[[], None]) -> None:
        solve()
        self.iterations += ksp.its


def forcing(gained: float, needed: float = 0.0) -> float:
    """Return the tolerance of a linear solve, from the last gain of the residual and the gain ``needed`` to the end.

    The square of the last gain is what a step of Newton's method can gain (S. C. Eisenstat and H. F. Walker, SIAM J.
    Sci. Comput. 17, 16, 1996).
    """
    return min(_ROUGH, max(_FINE, gained**2, _SPARE * needed))
