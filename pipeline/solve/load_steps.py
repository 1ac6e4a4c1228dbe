"""Large displacements: load steps up to the depth, each solved by Newton's method.

The force is the reaction. It must be the derivative of the stored energy with respect to the depth: its integral over
the steps is compared with the energy.

The error bar comes from one degree more, as in linear elasticity. With the residual r of the solution u there, and r'
that of v = ∂u/∂d under the tangent K,

    F_p - F_{p+1} = r'·K⁻¹ r,    of second order in the change that degree p + 1 makes.

(r'·K⁻¹ r' · r·K⁻¹ r)^½ is an upper bound of it that cannot vanish by chance, and is used instead. K is replaced by the
operator of linear elasticity. At moderate depths this agrees within a few per cent; at larger ones the tangent of one
degree more is not positive definite at the probe's edge.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import inf

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.compiled import assemble, global_sum, vector
from pipeline.solve.elements.base import Column, HierarchicalEstimate, Products, Solver
from pipeline.solve.elements.displacement import DisplacementElements
from pipeline.solve.forms import HyperelasticForms
from pipeline.solve.hierarchical_estimate import energy_decrements
from pipeline.solve.linear_solver import LinearSolver
from pipeline.solve.movement import Motion, Movement
from pipeline.solve.newton import HyperelasticBody, LargeError, tangent_product
from pipeline.solve.physics import MaterialLaw

# Fewest load steps, and the smallest step as a share of the depth.
_FEWEST, _SMALLEST = 3, 1 / 50
# A step that would leave less than this share of the depth goes to the end.
_SLIVER = 1e-6
# The next load step is longer if this one took at most so many Newton iterations.
_EASY = 4
# Largest relative difference of work and energy, and rounding of energies where strains are tiny. An element at the
# edge may fold between its quadrature points: the energy then drops without work.
_WORK, _ROUNDING = 3e-4, 1e-13


@dataclass
class LoadPath:
    """A load path: how far a ``motion`` of the probe has proceeded in a body of a ``law``.

    ``path`` has depth (m), force (N) and energy (J) of each step, of the modelled part. ``displacement`` (owned dofs)
    is that of the last step. The first step of the next depth is at most as long as the last one, ``step`` (m).
    """

    law: MaterialLaw
    motion: Motion
    displacement: FloatArray
    path: list[tuple[float, float, float]] = field(default_factory=lambda: [(0.0, 0.0, 0.0)])
    step: float = inf

    @property
    def reached(self) -> float:
        """The depth (m) of the last step."""
        return self.path[-1][0]

    def can_reach(self, law: MaterialLaw, movement: Movement) -> bool:
        """Return whether this path can be continued to the movement under this law."""
        return (self.law, (self.motion,)) == (law, movement.motions) and self.reached <= movement.amounts[0]


class LoadSteps(Solver):
    """A solver of displacement elements for a law of large displacements and one motion.

    ``stored`` is the energy (J) of the modelled part at the end. What is made is freed with the stack.
    """

    def __init__(self, elements: DisplacementElements, load_path: LoadPath, stack: ExitStack, *, direct: bool):
        """Set up for the law and motion of a load path, ``load_path``; collective.

        Raises:
            SolveError: if the preconditioner cannot be set up.
        """
        super().__init__(elements, load_path.law, is_exact=True)
        self._elements, self._load_path, self._law = elements, load_path, load_path.law
        law = load_path.law
        self._space = elements.displacements
        self._levels = elements.levels(law, stack, direct=direct)
        solver = stack.enter_context(LinearSolver(self._levels, direct=direct))
        self._forms = HyperelasticForms(self._space.space, self._space.forms, law.names)
        self._body = HyperelasticBody(self._space, self._forms, solver)
        stack.callback(self._body.close)

    def lift(self, columns: Sequence[Column]) -> None:
        """Do nothing: each load step prescribes its own displacement."""

    def solve(self, columns: Sequence[Column], tolerance: float, target: float | None = None) -> int:
        """Continue the load path to the depth of the single column; return the iterations; collective.

        ``tolerance`` and ``target`` are ignored: Newton's method ends where its gain is rounding.

        Raises:
            LargeError: if Newton's method does not converge, or the solution fails a check.
        """
        (column,), before = columns, self._body.iterations
        self._space.forms.set_law(self._law)
        owned = self._space.owned
        with vector(self._space.space) as displacement:
            path = self._press(displacement, column)
            column.unknown[0].array[:] = displacement.array / column.amount - column.prescribed[:owned]
            column.unknown[0].array[self._space.prescribed_owned] = 0.0
        check_path(path, _ROUNDING * max(self._law.lame_mu) * self._volume())
        self.stored = float(path[-1, 2])
        return self._body.iterations - before

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Raise an error: Newton's method has already converged to rounding."""
        raise LargeError("forces do not balance")

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residual and work of the solution as secants, per unit of the motion."""
        (column,), space = columns, self._space
        with vector(space.space) as displacement, vector(space.space) as forces:
            self._at(column, displacement)
            self._body.forces(displacement, forces)
            residual, moved = forces.array / column.amount, displacement.array / column.amount
        held = space.prescribed_owned
        work = global_sum(space.comm, np.array([residual[held] @ column.prescribed[held]]))
        return Products(space, [moved], [residual], work[None], work)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate, from the residuals of the solution and of its rate; collective.

        Raises:
            LargeError: if the elements of one degree more fail.
        """
        (column,), space = columns, self._space
        displacement, rate, unit = (stack.enter_context(vector(space.space)) for _ in range(3))
        self._at(column, displacement)
        unit.array[:] = column.prescribed[: space.owned]
        self._body.move(displacement, unit, rate)
        elements, solver = self._elements.finer(self._law, self._levels, stack)
        finer = elements.displacements
        forms = HyperelasticForms(finer.space, finer.forms, self._law.names)
        finer.forms.set_law(self._law)
        residuals = [stack.enter_context(vector(finer.space)) for _ in range(2)]
        with vector(finer.space) as there:
            space.set_displacement(rate)
            finer.forms.displacement.interpolate(space.forms.displacement)
            there.array[:] = finer.forms.displacement.x.array[: finer.owned]
            space.set_displacement(displacement)
            finer.forms.displacement.interpolate(space.forms.displacement)
            assemble(forms.residual, residuals[0])
            tangent_product(forms, there, residuals[1])
        for residual in residuals:
            residual.scale(-1.0)
            residual.array[finer.prescribed_owned] = 0.0
        if not all(np.isfinite(residual.norm()) for residual in residuals):
            raise LargeError("no error bar: elements of one degree more turn tissue inside out")
        found, _, iterations = energy_decrements(solver, residuals)
        taken = float(np.sqrt(found[0, 0] * found[1, 1])) / column.amount
        if not taken < self.products(columns).stationary[0, 0]:
            raise LargeError(
                f"no error bar: it needs elements of degree {finer.degree}, which fail at the probe's edge; "
                "use a smaller depth, a larger rim, or degree 2"
            )
        return HierarchicalEstimate(elements, [], iterations, decrements=np.array([[taken]]))

    def _at(self, column: Column, displacement: PETSc.Vec) -> None:
        """Write the solution at the depth of a column into ``displacement``."""
        self._elements.total(column, (displacement,))
        displacement.scale(column.amount)

    def _press(self, displacement: PETSc.Vec, column: Column) -> FloatArray:
        """Continue ``displacement`` along the load path to the depth of a column.

        Return the path: depth, force and energy of each step. The tangent gives the initial guess of each step. A step
        is halved where Newton's method does not converge.

        Raises:
            LargeError: if a step becomes too small; the path keeps the steps that converged.
        """
        load_path, depth, space = self._load_path, column.amount, self._space.space
        displacement.array[:] = load_path.displacement
        longest = depth / _FEWEST
        step = min(load_path.step, longest)
        with ExitStack() as stack:
            unit, rate, trial, forces = (stack.enter_context(vector(space)) for _ in range(4))
            unit.array[:] = column.prescribed[: self._space.owned]
            while (reached := load_path.reached) < depth:
                self._body.move(displacement, unit, rate)
                step, steps = self._step(displacement, rate, trial, load_path, step, depth)
                displacement.array[:] = trial.array
                energy = self._body.energy(displacement)
                self._body.forces(displacement, forces)
                there = depth if step >= depth - reached else reached + step
                load_path.path.append((there, forces.dot(unit), energy))
                load_path.displacement[:] = displacement.array
                load_path.step = step = min(step * (2 if steps <= _EASY else 1), longest)
        return np.array(load_path.path)

    def _step(
        self, displacement: PETSc.Vec, rate: PETSc.Vec, trial: PETSc.Vec, load_path: LoadPath, step: float, depth: float
    ) -> tuple[float, int]:
        """Write the equilibrium a ``step`` (m) farther into ``trial``; return the step and its Newton iterations.

        ``rate`` is the tangent at ``displacement``, per metre; the path ends at ``depth`` (m).
        """
        reached = load_path.reached
        if step > (1 - _SLIVER) * (depth - reached):
            step = depth - reached  # no further step for a rounding error
        with vector(self._space.space) as forces:
            while True:
                trial.array[:] = displacement.array + step * rate.array
                try:
                    if not np.isfinite(self._body.energy(trial)):
                        raise LargeError("tissue is turned inside out")
                    self._body.forces(trial, forces)
                    return step, self._body.settle(trial, self._norm_on_held(forces))
                except LargeError as error:
                    step /= 2
                    if step < _SMALLEST * depth:
                        raise self._stopped(load_path, depth, error) from error

    def _stopped(self, load_path: LoadPath, depth: float, why: LargeError) -> LargeError:
        """Return the error of a path that ends before ``depth`` (m)."""
        reached, force, _ = load_path.path[-1]
        whole = 2.0 ** len(self._elements.body.mirrored) * force
        message = (
            f"load steps reached {reached * 1e3:.3g} mm of {depth * 1e3:.3g} mm, where F is {whole:.4g} N "
            f"(Newton's method: {why}); the tissue becomes unstable, or elements at the probe's edge are flattened; "
            "use a smaller depth, or a larger rim"
        )
        return LargeError(message, (reached, whole) if reached else None)

    def _norm_on_held(self, forces: PETSc.Vec) -> float:
        on_held = forces.array[self._space.prescribed_owned]
        return float(np.sqrt(self._space.comm.allreduce(float(on_held @ on_held))))

    def _volume(self) -> float:
        body = self._elements.body
        return float(body.comm.allreduce(float(np.ptp(np.asarray(body.mesh.geometry.x), axis=0).prod())))


def check_path(path: FloatArray, rounding: float) -> None:
    """Check that the force is the derivative of the energy by the depth; ``path`` has depth, force, energy in rows.

    ``rounding`` is the rounding error of energies (J).

    Raises:
        LargeError: if it is not.
    """
    depth, force, energy = path.T
    depths = depth / depth[-1]
    through = np.polynomial.Polynomial.fit(depths, force, min(len(path) - 1, 4)).integ(lbnd=0.0)
    wrong = abs(float(through(1.0)) * depth[-1] / energy[-1] - 1)
    if not wrong <= _WORK + rounding / energy[-1]:
        raise LargeError(
            f"the force is not the derivative of the energy: they differ by {wrong:.1e}, because an element at "
            "the probe's edge folds; use a smaller depth, a larger rim, or degree 2"
        )
