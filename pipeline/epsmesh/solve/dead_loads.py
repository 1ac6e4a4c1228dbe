"""Dead loads at large displacements: the equilibrium of a hyperelastic body under them, before a tool presses.

Loads keep magnitude and direction, and act on the undeformed body: a potential -f·u besides the stored energy.

The body sags without a tool. A tool that is bonded to the sagged surface then presses; without a movement its force is
zero. As for linear laws, what the loads add to the force, and the sag of the tool, are those of a tool that is bonded
to the body before the loads act.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import nan

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.balance import check_balance
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.held_body import equilibrate
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Loads
from epsmesh.solve.newton import EASY, LEFT, ON_THE_WAY, LargeError
from epsmesh.solve.path import Path, PathPoint, follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.relaxing import crept
from epsmesh.solve.response import whole_force
from epsmesh.solve.spaces import Spaces
from epsmesh.stages import stage

# The sag of a tool: most steps of the secant method, most halvings of one, and the change (relative) and the force (in
# units of the loads) at which it ends.
_MOST_SECANTS, _HALVINGS, _SMALL, _NO_FORCE = 20, 6, 1e-6, 1e-9


def load_in_steps(body: HyperelasticBody, applied: Applied | None, state: PETSc.Vec) -> None:
    """Bring ``state`` to the equilibrium under loads, at its prescribed dofs, in as many steps as needed; collective.

    The loads, and all terms, then act on the ``body``.

    Raises:
        LargeError: if a load step becomes too small.
    """
    path, goal = Path(PathPoint(0.0, state.array.copy())), body.held_of(state)

    def solve_at(amount: float) -> tuple[PathPoint, bool]:
        state.array[:] = path.last.state
        body.carry(applied, amount)
        iterations = equilibrate(body, state, goal, LEFT if amount == 1.0 else ON_THE_WAY)
        return PathPoint(amount, state.array.copy()), iterations <= EASY

    try:
        follow(path, solve_at, 1.0)
    except LargeError as error:
        raise LargeError(
            f"the tissue carries {100 * path.reached:.0f} % of its loads, and becomes unstable beyond (Newton's "
            f"method: {error}); use smaller loads, or a support that holds more of the body"
        ) from error


@contextmanager
def without_tool(elements: Elements) -> Iterator[Elements]:
    """Lend the elements of the same mesh, degree and kind on which no tool acts; collective."""
    conditions = elements.displacements.conditions.without_footprint
    with Spaces(elements.body) as spaces, ExitStack() as stack:
        found = elements_of(spaces, elements.degree, conditions, elements.element)
        stack.callback(found.close)
        yield found


@stage("loads")
def sag(
    elements: Elements,
    law: MaterialLaw,
    loads: Loads | None,
    guess: FloatArray | None = None,
    *,
    has_crept: bool = False,
) -> FloatArray:
    """Return the state (owned dofs) of ``elements`` without a tool under ``loads`` and terms; collective.

    ``guess`` is an initial guess of it. The forms' fields are then that state. ``has_crept``: relaxing tissue has
    carried them for long.

    Raises:
        LargeError: if there is no equilibrium.
        SolveError: if the forces on support and body do not balance.
    """
    space = elements.displacements
    applied = None if loads is None else space.applied(loads)
    with ExitStack() as stack:
        linear = elements.linearised(law, stack, direct=elements.is_direct("auto"))
        body = HyperelasticBody(elements, law, linear.preconditioner, prestressed=has_crept)
        stack.callback(body.close)
        if has_crept:
            body.impose(crept(body.points, law))
        state, forces = (stack.enter_context(body.state()) for _ in range(2))
        elements.set_law(law)
        if guess is None:
            load_in_steps(body, applied, state)
        else:
            state.array[:] = guess
            body.carry(applied)
            equilibrate(body, state, body.held_of(state))
        body.forces(state, forces)
        own = forces.array[: space.owned].reshape(-1, 3)[space.fixed_owned].sum(axis=0)
        resultant, size = body.on_terms(state)
        left = whole_force(global_sum(space.comm, own) - resultant, elements.body.mirrored)
        check_balance(float(np.linalg.norm(left)) / (2.0 ** len(elements.body.mirrored) * size))
        return np.array(state.array)


def start_under_loads(
    elements: Elements, law: MaterialLaw, loads: Loads | None, *, has_crept: bool = False
) -> FloatArray:
    """Return the state (owned dofs) of ``elements`` with a bonded tool at which the tool has no force; collective.

    Without loads, and terms that act like them, it is zero. ``has_crept``: see :func:`sag`.

    Raises:
        SolveError: see :func:`sag`.
    """
    if loads is None and not elements.displacements.is_loaded:
        return np.zeros(elements.unknowns)
    with without_tool(elements) as free:
        sag(free, law, loads, has_crept=has_crept)
        elements.interpolate(free)
    return elements.values


@dataclass(frozen=True, eq=False)
class HeldTool:
    """Equilibrium under loads with a tool that was bonded to the body before, and does not move.

    Of the modelled part: the ``state``, ``on_probe`` (3), N, the sum of the residual on the probe's dofs, the ``force``
    (N) conjugate to the motion, the ``stored`` and the total ``energy`` (J). ``sag`` (m) is the amount of the motion at
    which that force is zero, NaN if it is not found.
    """

    state: FloatArray
    on_probe: FloatArray
    force: float
    stored: float
    energy: float
    sag: float


@stage("loads")
def hold_tool(
    elements: Elements, body: HyperelasticBody, applied: Applied, unit: PETSc.Vec, stiffness: float
) -> HeldTool:
    """Return the equilibrium of a ``body`` under loads with a tool that is held; collective.

    ``unit`` is the prescribed displacement per unit of the motion, ``stiffness`` (N/m) an estimate of that motion's.

    Raises:
        LargeError: if there is no equilibrium of a tool that is held.
    """
    space = elements.displacements
    with body.state() as state, body.state() as forces:
        load_in_steps(body, applied, state)
        body.forces(state, forces)
        residual, held = forces.array[: space.owned], state.array.copy()
        on_probe, work = residual.reshape(-1, 3)[space.probe_owned].sum(axis=0), held[: space.owned] @ applied.forces
        *on_probe, work = global_sum(space.comm, np.array([*on_probe, work]))
        force, energy = forces.dot(unit), body.energy(state)
        try:
            found = _sag_of_tool(body, state, unit, -force / stiffness, _NO_FORCE * applied.size)
        except LargeError:
            found = nan
        return HeldTool(held, np.array(on_probe), force, energy + work, energy, found)


def _sag_of_tool(body: HyperelasticBody, state: PETSc.Vec, unit: PETSc.Vec, step: float, no_force: float) -> float:
    """Return the amount (m) of the motion ``unit`` at which the force (N) is at most ``no_force``; collective.

    It is found by the secant method from an equilibrium, ``state``, and a first ``step`` (m). Steps are halved where
    Newton's method does not converge.

    Raises:
        LargeError: if it is not found.
    """
    motion, here = body.held_of(unit), 0.0
    with body.state() as forces, body.state() as last:
        body.forces(state, forces)
        force = forces.dot(unit)
        for _ in range(_MOST_SECANTS):
            state.copy(last)
            for _ in range(_HALVINGS):
                try:
                    equilibrate(body, state, (here + step) * motion)
                    break
                except LargeError:
                    last.copy(state)
                    step /= 2
            else:
                break
            here += step
            body.forces(state, forces)
            before, force = force, forces.dot(unit)
            if abs(step) <= _SMALL * abs(here) or abs(force) <= no_force:
                return here
            step *= -force / (force - before)
    raise LargeError("no sag of the tool was found under the loads")
