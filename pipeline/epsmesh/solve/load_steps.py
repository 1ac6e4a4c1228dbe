"""Large displacements: load steps up to the depth, each solved by Newton's method.

The force is the reaction. It must be the derivative of the stored energy with respect to the depth: its integral over
the steps is compared with the energy.

The error bar comes from one degree more: :mod:`epsmesh.solve.large_estimate`.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.cell_values import plain_share
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.dead_loads import HeldTool, hold_tool
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate, Linearised, Products, Rate, Solver
from epsmesh.solve.elements.fields import Column, Fields
from epsmesh.solve.ended import ended
from epsmesh.solve.estimate import is_plain
from epsmesh.solve.held_body import equilibrate, move
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.large_estimate import Decrements, FinerResiduals, combine, force_again
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Motion, Movement
from epsmesh.solve.newton import EASY, LEFT, ON_THE_WAY, LargeError
from epsmesh.solve.path import Path, PathPoint, follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import LoadResponse, Response, whole_force

# Fewest load steps, and fewest where the check of the work needs more.
_FEWEST, _MANY = 3, 12
# Largest relative difference of work and energy, and rounding of energies where strains are tiny. An element at the
# edge may fold between its quadrature points: the energy then drops without work.
_WORK, _ROUNDING = 3e-4, 1e-13


@dataclass(eq=False)
class LoadPath(Path[PathPoint]):
    """A load path: how far a ``motion`` of the probe has proceeded in a body of a ``law``; amounts are depths (m).

    ``work`` has depth (m), force (N) and energy (J) of each point, of the modelled part, less that at the start. States
    have displacement, and in mixed elements pressure (owned dofs). Under dead loads, ``applied``, the path starts from
    the body that has sagged, and ``held`` is that with a tool that does not move, once it is known.
    """

    law: MaterialLaw = field(kw_only=True)
    motion: Motion = field(kw_only=True)
    applied: Applied | None = None
    held: HeldTool | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.restart()

    def restart(self) -> None:
        """Return to the start."""
        self.return_to(self.start)
        self.work = [(0.0, 0.0, 0.0)]

    def can_reach(self, law: MaterialLaw, movement: Movement, applied: Applied | None) -> bool:
        """Return whether this path can be continued to the movement under this law and these loads; collective."""
        is_same = applied is None if self.applied is None else self.applied.is_same(applied)
        return is_same and (self.law, (self.motion,)) == (law, movement.motions) and self.reached <= movement.amounts[0]


class LoadSteps(Solver):
    """A solver for a law of large displacements and one motion.

    ``stored`` is the energy (J) of the modelled part at the end. What is made is freed with the stack.
    """

    def __init__(self, elements: Elements, load_path: LoadPath, stack: ExitStack, *, direct: bool):
        """Set up for the law and motion of a load path, ``load_path``; collective.

        Raises:
            SolveError: if the preconditioner cannot be set up.
        """
        super().__init__(elements, load_path.law, is_exact=True)
        self._load_path, self._law = load_path, load_path.law
        self._space = elements.displacements
        self._linear = elements.linearised(self._law, stack, direct=direct)
        self._body = HyperelasticBody(elements, self._law, self._linear.preconditioner)
        stack.callback(self._body.close)
        if load_path.applied is not None:
            self._body.carry(load_path.applied)

    @property
    def linearised(self) -> Linearised:
        """Linear elasticity in place of the tangent."""
        return self._linear

    def lift(self, columns: Sequence[Column]) -> None:
        """Do nothing: each load step prescribes its own displacement."""

    def solve(self, columns: Sequence[Column], tolerance: float, target: float | None = None) -> int:
        """Continue the load path to the depth of the first column; return the iterations; collective.

        The column of loads is the state at the start of the path, the first one the change from there.
        ``tolerance`` and ``target`` are ignored: Newton's method ends where its gain is rounding.

        Raises:
            LargeError: if Newton's method does not converge, or the solution fails a check.
        """
        (column, *loaded), before, load_path = columns, self._body.iterations, self._load_path
        self.elements.set_law(self._law)
        with self._body.state() as state:
            path = self._checked_path(state, column)
            self.elements.put(
                column, self._body.split(state.array - load_path.start.state, column.unknown), column.amount
            )
            self.stored = float(path[-1, 2])
            if load_path.applied is not None and load_path.held is None:
                self._put_unit(column, state)
                slope = float(path[-1, 1]) / column.amount
                load_path.held = hold_tool(self.elements, self._body, load_path.applied, state, slope)
            for of_loads in loaded:
                state.array[:] = load_path.start.state
                self._body.show(state)
                values = self._space.forms.displacement.x.array
                of_loads.prescribed[self._space.prescribed] = values[self._space.prescribed]
                self.elements.put(of_loads, self._body.split(load_path.start.state, of_loads.unknown))
        return self._body.iterations - before

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Raise an error: Newton's method has already converged to rounding."""
        raise LargeError("forces do not balance")

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residual and work of the first column as secants, per unit of the motion."""
        column, space, start = columns[0], self._space, self._load_path.start.state
        with self._body.state() as state, self._body.state() as forces, self._body.state() as before:
            state.array[:] = start
            self._body.forces(state, before)
            on_terms = self._body.on_terms(state)[0]
            self._at(column, state)
            self._body.forces(state, forces)
            on_terms = (self._body.on_terms(state)[0] - on_terms) / column.amount
            residual, moved = (
                self._body.split(part / column.amount, column.unknown)[0]
                for part in (forces.array - before.array, state.array - start)
            )
        held = space.prescribed_owned
        work = global_sum(space.comm, np.array([residual[held] @ column.prescribed[held]]))
        return Products(space, [moved], [residual], work[None], work, on_terms[None])

    def rate(self, columns: Sequence[Column], movement: Movement) -> Rate:
        """Return the linearised rate."""
        return Rate([column.amount for column in columns], lambda: self._show_rate(columns[0]))

    def _show_rate(self, column: Column) -> None:
        with self._body.state() as state, self._body.state() as unit, self._body.state() as rate:
            self._at(column, state)
            self._put_unit(column, unit)
            move(self._body, state, unit, rate)
            self._body.show(rate)

    def load_response(self, response: Response) -> LoadResponse | None:
        """Return the effect of loads on the whole body, None without loads; ``response`` is that to the motion."""
        held, mirrored = self._load_path.held, self.elements.body.mirrored
        if held is None:
            return None
        whole = 2.0 ** len(mirrored)
        form = np.array([[response.stiffness[0, 0], whole * held.force], [whole * held.force, 2 * whole * held.energy]])
        on_probe = -whole_force(held.on_probe, mirrored)
        return LoadResponse(response.movement, form, on_probe, stored=whole * held.stored, sag=held.sag)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate, from the residuals of the solution and of its rate; collective.

        Raises:
            LargeError: if the elements of one degree more fail.
        """
        column, held, finer = columns[0], self._load_path.held, self._linear.finer()
        if held is None and is_plain(plain_share(self.elements.body)):
            force = self._force_again(finer, column, movement, stack)
            decrement = (self._load_path.work[-1][1] - force) / column.amount
            return HierarchicalEstimate(finer, [], decrements=np.array([[decrement]]), is_solved=True)
        residuals = FinerResiduals(self.elements, self._body, finer, self._law, movement.loads, stack)
        state, unit, rate = (stack.enter_context(self._body.state()) for _ in range(3))
        self._put_unit(column, unit)

        def at() -> tuple[Fields, Fields]:
            move(self._body, state, unit, rate)
            return residuals.of_rate(state, rate), residuals.at(state)

        self._at(column, state)
        found = [*at()]
        if held is not None:
            state.array[:] = self._load_path.start.state
            rate_at_end, at_end = at()
            changes = combine(1.0, found[1], -1.0, at_end), combine(-1.0, rate_at_end, 1.0, found[0])
            found = [found[0], *changes, at_end]
            state.array[:] = held.state
            found.append(residuals.at(state))
        estimate = Decrements(self._linear, found)
        decrement, rest = estimate.between(0, 1)
        if held is not None:
            held_rest = estimate.between(2, 3)
            decrement, rest = (float(np.add(a, b)) for a, b in zip((decrement, rest), held_rest, strict=True))
        decrement, rest = decrement / column.amount, rest / column.amount
        if not abs(decrement) < self.products(columns).stationary[0, 0]:
            raise LargeError(
                f"no error bar: it needs elements of degree {finer.degree}, which fail at the probe's edge; "
                "use a smaller depth, a larger rim, or degree 2"
            )
        decrements, unseen = np.array([[decrement]]), np.array([rest])
        if held is not None:
            mixed, (own, own_rest) = estimate.products[0, 4], estimate.between(4, 4)
            decrements, unseen = np.array([[decrement, mixed], [mixed, own]]), np.array([rest, own_rest])
        return HierarchicalEstimate(
            finer,
            [],
            decrements=decrements,
            unseen=None if estimate.is_bound else unseen,
        )

    def _force_again(self, finer: Elements, column: Column, movement: Movement, stack: ExitStack) -> float:
        """Return the force (N) on the modelled part in elements of one degree more.

        Where terms act before the tool does, those elements have a force at the start of the path already.
        """
        (above,) = finer.columns(movement, stack)
        with self._body.state() as state:
            again = partial(
                force_again,
                self.elements,
                self._body,
                state,
                finer,
                self._law,
                above,
                self._linear.finer_preconditioner(),
            )
            try:
                state.array[:] = self._load_path.start.state
                at_start = again() if self._space.is_loaded else 0.0
                self._at(column, state)
                return again() - at_start
            except LargeError as error:
                raise LargeError(
                    f"no error bar: elements of degree {finer.degree} fail at the probe's edge ({error}); "
                    "use a larger rim, or a smaller depth"
                ) from error

    def _at(self, column: Column, state: PETSc.Vec) -> None:
        """Write the solution at the depth of a column into ``state``."""
        with self.elements.fields() as parts:
            self.elements.total(column, parts)
            state.array[:] = np.concatenate([part.array for part in parts])
        state.scale(column.amount)
        state.array[:] += self._load_path.start.state

    def _put_unit(self, column: Column, state: PETSc.Vec) -> None:
        """Write the prescribed displacement per unit of the motion into ``state``."""
        state.array[: self._space.owned] = column.prescribed[: self._space.owned]

    def _checked_path(self, state: PETSc.Vec, column: Column) -> FloatArray:
        """Continue ``state`` as :meth:`_reach`, in many exact steps if the force of a few does not tell the work.

        Where terms act before the tool does, they may load the support by far more than F: steps are then rough.
        """
        with self._body.state() as start:
            start.array[:] = self._load_path.start.state
            size = max(self._law.lame_mu) * self._volume() + abs(self._body.energy(start))
        path = self._reach(state, column, _FEWEST)
        try:
            check_path(path, _ROUNDING * size)
        except LargeError:
            self._load_path.restart()
            path = self._reach(state, column, _MANY, LEFT)
            check_path(path, _ROUNDING * size)
        return path

    def _reach(self, state: PETSc.Vec, column: Column, fewest: int, on_the_way: float = ON_THE_WAY) -> FloatArray:
        """Continue ``state`` along the load path to the depth of a column, in at least ``fewest`` steps from its start.

        Return the path: depth, force and energy of each step. A step is halved where Newton's method does not converge.

        Raises:
            LargeError: if a step becomes too small; the path keeps the steps that converged.
        """
        load_path, depth, body = self._load_path, column.amount, self._body
        state.array[:] = load_path.start.state
        begun, base = body.energy(state), body.held_of(state)
        with body.state() as unit, body.state() as forces:
            self._put_unit(column, unit)
            held = body.held_of(unit)

            def solve_at(amount: float) -> tuple[PathPoint, bool]:
                state.array[:] = load_path.continued(amount)
                if not np.isfinite(body.energy(state)):
                    state.array[:] = load_path.last.state  # the first step of Newton's method then brings it there
                left = LEFT if amount == depth else on_the_way
                iterations = equilibrate(body, state, base + amount * held, left)
                body.forces(state, forces)
                load_path.work.append((amount, forces.dot(unit), body.energy(state) - begun))
                return PathPoint(amount, state.array.copy()), iterations <= EASY

            try:
                follow(load_path, solve_at, depth, fewest=fewest)
            except LargeError as error:
                raise self._stopped(load_path, depth, error) from error
        state.array[:] = load_path.last.state
        return np.array(load_path.work)

    def _stopped(self, load_path: LoadPath, depth: float, why: LargeError) -> LargeError:
        """Return the error of a path that ends before ``depth`` (m)."""
        reached, force, _ = load_path.work[-1]
        whole = 2.0 ** len(self.elements.body.mirrored) * force
        return ended(why, self._law, (reached, whole), depth, is_found=False)

    def _volume(self) -> float:
        body = self.elements.body
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
