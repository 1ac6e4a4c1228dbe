"""Prescribed motion of a footprint: one column for each motion, one for loads, and the response from their solutions.

Loads f add the column w with K w = f, w = 0 on footprint and support (:mod:`epsmesh.solve.response`). A far field on
the cut face (:mod:`epsmesh.solve.far_field`) adds one column per unit. Let K be the stiffness of the tool's movement
(index 0) and that unit (index 1), with the body beyond the cut added to K₁₁. The energy is stationary for the amplitude
-K₁₀ / K₁₁. The tool's work is the energy on both sides of the cut, F d = 2 (U within + U beyond).
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.balance import MOST_ROUNDS, check_balance, rest, sums
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.dead_loads import start_under_loads
from epsmesh.solve.elements.base import Elements, Equilibrium, Products, Solver
from epsmesh.solve.elements.fields import Column, close_far
from epsmesh.solve.load_steps import LoadPath, LoadSteps
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Motion, Movement
from epsmesh.solve.path import PathPoint
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import LoadResponse, Response, load_response_of, reaction
from epsmesh.solve.solution import Request
from epsmesh.solve.time_steps import FootprintIndentation
from epsmesh.stages import stage

# Tolerance of each motion's own balance for the balance of both sides of a cut, as a share of the limit.
TWO_SIDED = 0.1


class PrescribedMotion:
    """Solver for each motion of a footprint, with one set-up of the elements.

    ``corrections`` are the last solutions per unit of each motion, less the prescribed displacements, owned dofs.
    """

    def __init__(self, elements: Elements, *, reuse: bool = False):
        """With ``reuse`` the last solution is the initial guess: depths of a nonlinear law share one load path."""
        self._elements = elements
        self._reuse, self._shares_path = reuse and elements.element == "displacement", reuse
        self.corrections: dict[Motion, tuple[FloatArray, ...]] = {}
        self._law: MaterialLaw | None = None  # of the corrections
        self._load_path: LoadPath | None = None  # load path to the last depth, for a nonlinear law

    def close(self) -> None:
        """Free what is kept between solves."""
        self.corrections.clear()

    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Solve for each motion of the movement and for its loads; the ``stack`` frees what is made; collective.

        Raises:
            SolveError: if the elements do not support the law, the solver does not converge, or the solution fails a
                check.
        """
        law, movement, direct = asked.law, asked.movement, self._elements.is_direct(asked.method)
        # A tool at many places: operator and motion stay the same, the far field differs.
        keep = self._reuse and movement.far is not None and not direct
        with stage("assembly"):
            columns = self._elements.columns(movement, stack)
        solver = self._set_up(asked, columns[-1].applied, stack, direct=direct, keep=keep)
        with stage("assembly"):
            solver.lift(columns)
        with stage("solve"):
            guessed = self._guess(columns, movement)
            todo = [column for column in columns if not (keep and self._law == law and column in guessed)]
            iterations, response, load_response = self._iterate(solver, columns, todo, movement, asked.tolerance)
            self._law, self.corrections = (
                law,
                {
                    motion: tuple(part.array.copy() for part in column.unknown)
                    for motion, column in zip(movement.motions, columns, strict=False)
                },
            )
            if movement.far is not None:
                movement = close_far(columns, movement, -float(response.stiffness[1, 0] / response.stiffness[1, 1]))
                response = _balanced(respond(solver.products(columns), columns, law, movement)[0])
        return Equilibrium(solver, columns, movement, iterations, response, load_response)

    def in_time(self, asked: Request, found: Equilibrium, stack: ExitStack) -> FootprintIndentation:
        """Return the body whose footprint is pressed in time steps; the ``stack`` frees it; collective."""
        elements, solver = self._elements, found.solver
        if isinstance(solver, LoadSteps):
            linear = solver.linearised
        else:
            linear = elements.linearised(asked.law, stack, direct=elements.is_direct(asked.method))
        return FootprintIndentation(elements, asked.law, linear, found.movement, stack)

    def _iterate(
        self, solver: Solver, columns: list[Column], todo: list[Column], movement: Movement, tolerance: float
    ) -> tuple[int, Response, LoadResponse | None]:
        """Solve ``todo`` of the ``columns`` until forces balance; return the iterations, and the responses.

        Raises:
            SolveError: if forces do not balance.
        """
        aim = tolerance * min(self._elements.stricter, TWO_SIDED if movement.far is not None else 1.0)
        iterations = solver.solve(todo, aim)
        for further in range(MOST_ROUNDS + 1):
            response, load_response = _respond(solver, columns, movement)
            share = rest(response.balance, tolerance)
            if solver.is_exact or share == 1.0 or further == MOST_ROUNDS:
                break
            iterations += solver.improve(columns, share)
        check_balance(response.balance)
        return iterations, response, load_response

    def _guess(self, columns: Sequence[Column], movement: Movement) -> list[Column]:
        """Set the initial guess of each motion to its last solution, if there is one; return these columns."""
        guessed = []
        for motion, column in zip(movement.motions, columns, strict=False):
            if self._reuse and motion in self.corrections:
                for part, values in zip(column.unknown, self.corrections[motion], strict=True):
                    part.array[:] = values
                guessed.append(column)
        return guessed

    def _set_up(self, asked: Request, applied: Applied | None, stack: ExitStack, *, direct: bool, keep: bool) -> Solver:
        """Return a solver for a request; the ``stack`` frees it unless it is to be kept (``keep``); collective.

        Raises:
            SolveError: if it cannot be set up, the elements do not support the law, or do not carry the loads.
        """
        law, movement = asked.law, asked.movement
        if law.is_linear and not self._elements.displacements.terms:
            return self._elements.set_up(law, stack, direct=direct, keep=keep)
        load_path = self._load_path
        if load_path is None or not load_path.can_reach(law, movement, applied):
            start = start_under_loads(self._elements, law, movement.loads)
            load_path = LoadPath(PathPoint(0.0, start), law=law, motion=movement.motions[0], applied=applied)
        self._load_path = load_path if self._shares_path else None
        return LoadSteps(self._elements, load_path, stack, direct=direct)


def _respond(solver: Solver, columns: Sequence[Column], movement: Movement) -> tuple[Response, LoadResponse | None]:
    """Return the response of the solution of a ``solver`` to motions and loads; collective."""
    if isinstance(solver, LoadSteps):
        response, _ = respond(solver.products(columns), columns[:1], solver.law, movement)
        return response, solver.load_response(response)
    return respond(solver.products(columns), columns, solver.law, movement)


def respond(
    found: Products, columns: Sequence[Column], law: MaterialLaw, movement: Movement
) -> tuple[Response, LoadResponse | None]:
    """Return the response to the motions, and to dead loads, whose column is the last one; collective."""
    count, mirrored = len(movement.motions), found.space.body.mirrored
    motions, loaded = columns[:count], columns[count:]
    residuals = [
        residual if column.applied is None else residual - column.applied.forces
        for residual, column in zip(found.residuals, columns, strict=True)
    ]
    total = sums(found.space, residuals, [column.prescribed for column in motions], found.on_terms)
    beyond = _energy_beyond(movement, law.lame_mu[0], mirrored)
    response = reaction(movement, found.stationary[:count, :count] + beyond, total.on_probe[:count], mirrored)
    balance = total.imbalance(found.energies[:count], movement, mirrored)
    if not loaded:
        return replace(response, balance=balance), None
    (applied,) = (column.applied for column in loaded)
    assert applied is not None
    works = global_sum(found.space.comm, np.array([u @ applied.forces for u in found.moved]))
    balance = max(balance, total.imbalance_of_loads(found.energies, works, applied, movement, mirrored))
    load_response = load_response_of(movement, found.stationary, works, total.on_probe[-1], mirrored)
    return replace(response, balance=balance), load_response


def _energy_beyond(movement: Movement, mu: float, mirrored: Sequence[int]) -> FloatArray | float:
    """Return twice the strain energies (n, n), by pairs of motions, beyond the cut face of the modelled part."""
    if movement.far is None:
        return 0.0
    return np.outer(movement.shares, movement.shares) * movement.far.stiffness(mu) / 2.0 ** len(mirrored)


def _balanced(response: Response) -> Response:
    """Return the response of tool and far field together, with its balance, F d = 2 (U within + U beyond).

    Raises:
        SolveError: if forces do not balance.
    """
    force, stiffness = float(response.forces[0, 2]), float(response.stiffness[0, 0])
    balance = max(response.balance, abs(force - stiffness) / stiffness)
    check_balance(balance)
    return replace(response, balance=balance)
