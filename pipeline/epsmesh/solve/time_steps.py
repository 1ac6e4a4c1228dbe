"""Time steps of relaxing tissue, each solved by Newton's method: see :mod:`epsmesh.solve.relaxing`.

What presses is a footprint whose displacement is prescribed, or a tool whose contact is found at each time.

The elastic stress is taken to be linear in time over a step. Its error falls with the square of the step. A second set
of history variables follows every other time: the work of the difference of both stresses in the displacement gives
what that changes of the force, about four times the error.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from math import ceil
from typing import ClassVar, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve.balance import sums
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.dead_loads import start_under_loads
from epsmesh.solve.elements.base import Elements, Linearised
from epsmesh.solve.elements.tangent import Prestress
from epsmesh.solve.ended import ended
from epsmesh.solve.held_body import equilibrate, move
from epsmesh.solve.history import Course, History, between
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.movement import Movement
from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import Path, PathPoint, follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.relaxing import HistoryVariables, Points
from epsmesh.solve.response import whole_force
from epsmesh.stages import stage

# Fewest steps of the whole movement, without friction and with it.
_FEWEST, _FEWEST_WITH_FRICTION = 3, 8
# How often all steps are halved for an accuracy.
_MOST_REFINEMENTS = 3


@dataclass
class _Place:
    """How far the steps have come: time (s), fraction of the movement, its last change, and energies (J)."""

    time: float = 0.0
    fraction: float = 0.0
    changed: float = 0.0
    rate: float = 0.0  # work per fraction
    work: float = 0.0
    has_moved: bool = False


class Body(Protocol):
    """A body whose energy is that of its law, changed by a prestress. Methods are collective on ``comm``.

    ``unit`` (J) is that of stress times the volumes of the ``points``; ``iterations`` counts linear solves.
    """

    iterations: int

    @property
    def comm(self) -> MPI.Comm: ...  # noqa: D102
    @property
    def unit(self) -> float: ...  # noqa: D102
    @property
    def points(self) -> Points: ...  # noqa: D102

    def state(self) -> AbstractContextManager[PETSc.Vec]:
        """Lend a zero state."""

    def impose(self, prestress: Prestress | None, factors: tuple[float, ...] = ()) -> None:
        """Change the energy from now on; None leaves only ``factors``, by region."""

    def stresses(self, state: PETSc.Vec) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return stress (of the unchanged energy, in the law's unit) and strain at the points."""

    def force_of(self, stress: list[FloatArray], state: PETSc.Vec, direction: FloatArray) -> float:
        """Return the work (J) that a change of the prestress by ``stress`` does in a ``direction``."""

    def energy(self, state: PETSc.Vec) -> float:
        """Return the energy (J)."""


class Indentation(ABC):
    """A relaxing ``body`` and what presses it, in equilibrium at a fraction of the movement. Methods are collective.

    ``force`` (3), N, is that of the tool on the modelled part, ``rate`` (J) the work per fraction, and ``area`` (m²)
    the contact of the whole body, NaN unless it ``is_found``. ``rough`` is the relative error of the force by
    the distance of nodes at the edge of contact, where that of the mesh does not have it. A tool that ``rubs`` has
    friction, which has turned ``rubbed`` (J) into heat. ``sag`` (m) and ``load_energy`` (J, of the modelled part)
    are those of loads.
    """

    is_found: ClassVar[bool]

    body: Body
    force: FloatArray
    rate: float
    area: float = np.nan
    rough: float = 0.0
    rubs: bool = False
    rubbed: float = 0.0
    sag: float = np.nan
    load_energy: float = np.nan

    def start(self) -> FloatArray | None:
        """Return the state before the movement under loads, which have acted for long; None at rest.

        Raises:
            SolveError: if there is none.
        """
        return None

    @abstractmethod
    def equilibrate(self, state: PETSc.Vec, fraction: float) -> None:
        """Find the equilibrium at a ``fraction`` from an initial guess, ``state``.

        Raises:
            LargeError: if Newton's method does not converge; ``state`` is then undefined.
        """

    @abstractmethod
    def guess(self, state: PETSc.Vec) -> FloatArray | None:
        """Return the change of a state per fraction by the tangent there, None if there is no such guess."""

    @abstractmethod
    def unit(self, state: PETSc.Vec, fraction: float) -> FloatArray:
        """Return the displacement, a state, per metre of the tool in which stresses do the work of the force."""


class FootprintIndentation(Indentation):
    """A body whose footprint has a prescribed ``movement``; under loads, from where it has sagged on."""

    is_found = False
    body: HyperelasticBody

    def __init__(
        self, elements: Elements, law: MaterialLaw, linearised: Linearised, movement: Movement, stack: ExitStack
    ):
        """Set up; what is made is freed with the ``stack``."""
        self._elements, self._law, self._loads = elements, law, movement.loads
        self._space, self._amount = elements.displacements, movement.amounts[0]
        self.body = HyperelasticBody(elements, law, linearised.preconditioner, prestressed=True)
        stack.callback(self.body.close)
        self._forces, self._unit = (stack.enter_context(self.body.state()) for _ in range(2))
        owned = self._space.owned
        for motion, amount in zip(movement.motions, movement.amounts, strict=True):
            self._unit.array[:owned] += amount * self._space.held(motion)[:owned]
        self._start: FloatArray = np.zeros(elements.unknowns)
        self.force, self.rate = np.zeros(3), 0.0

    def start(self) -> FloatArray | None:
        """Return the sagged state, in which the tool has no force; None without loads."""
        if self._loads is None and not self._space.is_loaded:
            return None
        self._start = start_under_loads(self._elements, self._law, self._loads, has_crept=True)
        self.body.carry(None if self._loads is None else self._space.applied(self._loads))
        return self._start

    def equilibrate(self, state: PETSc.Vec, fraction: float) -> None:
        """Find the equilibrium at a fraction."""
        held = self._start[self._space.prescribed_owned] + fraction * self.body.held_of(self._unit)
        state.array[self._space.prescribed_owned] = held
        equilibrate(self.body, state, held)
        self.body.forces(state, self._forces)
        residual = self._forces.array[: self._space.owned]
        (self.force,) = sums(self._space, [residual], [self._unit.array[: self._space.owned]]).on_probe
        self.rate = float(self._forces.dot(self._unit))

    def guess(self, state: PETSc.Vec) -> FloatArray:
        """Return the change of a state per fraction by the tangent there."""
        with self.body.state() as rate:
            move(self.body, state, self._unit, rate)
            return np.array(rate.array)

    def unit(self, state: PETSc.Vec, fraction: float) -> FloatArray:
        """Return the displacement per metre, as a secant."""
        return np.asarray((state.array_r - self._start) / (fraction * self._amount))


def follow_course(begin: Callable[[], "TimeSteps"], course: Course) -> tuple[History, int]:
    """Return the history of a ``course``, in steps that are halved for its accuracy, and the iterations of all.

    ``begin`` returns a body at rest.

    Raises:
        LargeError: see :meth:`TimeSteps.follow`.
    """
    course, iterations = course.with_halves(), 0
    for refinements in range(_MOST_REFINEMENTS + 1):
        steps = begin()
        found = steps.follow(course)
        iterations += steps.iterations
        if steps.rubs:
            half = begin()
            half.fewest /= 2
            found = found.with_half_the_steps(half.follow(course.coarse()), sorted(course.halves()))
            iterations += half.iterations
        if found.bar <= course.accuracy or refinements == _MOST_REFINEMENTS:
            break
        course = course.refined()
    return found, iterations


class TimeSteps:
    """Time steps of a body of a ``law`` whose regions may relax, to a ``depth`` (m). Methods are collective.

    ``fewest`` is the least number of steps of the whole movement.
    """

    def __init__(
        self,
        law: MaterialLaw,
        indentation: Indentation,
        depth: float,
        stack: ExitStack,
        *,
        mirrored: Sequence[int] = (),
        has_own_mesh: bool = False,
    ):
        """Set up; what is made is freed with the ``stack``.

        The body is ``mirrored`` at planes normal to these axes. ``has_own_mesh``: the study does not choose the mesh.
        """
        self._law, self._depth, self._mirrored, self._has_own_mesh = law, depth, mirrored, has_own_mesh
        self._place, self._indentation, self._body = _Place(), indentation, indentation.body
        self._relaxes = any(each.relaxation for each in law.parameters)
        self._variables = HistoryVariables(self._body.points, [each.relaxation for each in law.parameters])
        self._state, self._before = (stack.enter_context(self._body.state()) for _ in range(2))
        self._at_start, self.fewest = 0.0, float(_FEWEST_WITH_FRICTION if indentation.rubs else _FEWEST)
        if (start := indentation.start()) is not None:
            self._state.array[:] = self._before.array[:] = start
            self._variables.begin(*self._body.stresses(self._state))
            self._at_start = self._elastic()

    @property
    def rubs(self) -> bool:
        """Whether there is friction: the force then depends on the path, and its error falls with the step."""
        return self._indentation.rubs

    @property
    def iterations(self) -> int:
        """Iterations of the linear solver so far."""
        return self._body.iterations

    @stage("time steps")
    def follow(self, course: Course) -> History:
        """Return the history of a course.

        Raises:
            LargeError: if Newton's method does not converge; it has the depth and the force that were reached.
        """
        halves, errors = course.halves(), dict[int, float]()
        forces, heat, imbalance, areas, rough = [], [], [], [], []
        for number, (time, fraction) in enumerate(zip(course.times, course.shares, strict=True)):
            self._reach(time, fraction, course)
            if number in halves:
                errors[number] = self._step_error()
            forces.append(self._force())
            dissipated, stored = self._energies()
            heat.append(dissipated)
            imbalance.append(self._place.work - stored - dissipated)
            areas.append(self._indentation.area)
            rough.append(self._indentation.rough * abs(forces[-1][2]))
        whole = 2.0 ** len(self._mirrored)
        return History(
            times=np.array(course.times),
            forces=np.array(forces),
            bars=fitted.STEPS * whole * between(errors, len(forces)) + np.maximum.accumulate(rough),
            dissipated=whole * np.array(heat),
            imbalance=whole * np.array(imbalance),
            areas=np.array(areas),
            sag=self._indentation.sag,
            load_energy=whole * self._indentation.load_energy,
        )

    def _reach(self, time: float, fraction: float, course: Course) -> None:
        """Continue to a time and a fraction of the movement; a step is halved if Newton's method does not converge."""
        place = self._place
        begun, rise = place.time, fraction - place.fraction
        if time == begun and not rise:
            return

        def solve_at(part: float) -> tuple[PathPoint, bool]:
            before = 1 - part
            try:
                self._step(time - before * (time - begun), fraction - before * rise)
            except LargeError:
                place.changed = 0.0  # the tangent is a better guess than the last step
                raise
            return PathPoint(part, self._state.array), True

        equal = max(1.0, ceil(self.fewest * abs(rise) - 1e-9))  # not three quarters and a quarter
        try:
            follow(Path(PathPoint(0.0, self._state.array)), solve_at, 1.0, fewest=equal)
        except LargeError as error:
            raise self._stopped(course, error) from error

    def _step(self, time: float, fraction: float) -> None:
        """Find the equilibrium at a later time (s) and fraction of the movement.

        Raises:
            LargeError: if Newton's method does not converge.
        """
        place, body = self._place, self._body
        step, change = time - place.time, fraction - place.fraction
        if not (change or self._relaxes) or not (
            place.has_moved or fraction
        ):  # elastic tissue that is held, or at rest
            place.time = time
            return
        self._body.impose(self._variables.prestress(step))
        with body.state() as trial:
            trial.array[:] = self._state.array
            if change and (rate := self._rate()) is not None:
                trial.array[:] += change * rate
            self._indentation.equilibrate(trial, fraction)
            self._before.array[:] = self._state.array
            self._state.array[:] = trial.array
        rate_of_work = self._indentation.rate
        place.work += change * (place.rate + rate_of_work) / 2
        self._variables.advance(step, *body.stresses(self._state))
        place.time, place.fraction, place.rate, place.has_moved = time, fraction, rate_of_work, True
        place.changed = change or place.changed
        if not change:
            self._before.array[:] = self._state.array
            place.changed = 0.0

    def _rate(self) -> FloatArray | None:
        """Return the change of the state per fraction of the movement: that of the last step, or by the tangent."""
        if self._place.changed:
            return np.asarray((self._state.array - self._before.array) / self._place.changed)
        return self._indentation.guess(self._state)

    def _step_error(self) -> float:
        """Return the change (N) of the modelled part's force along the first motion by steps of twice the length."""
        stress = self._variables.advance_coarse()
        if not self._place.fraction:
            return 0.0
        return abs(self._body.force_of(stress, self._state, self._indentation.unit(self._state, self._place.fraction)))

    def _force(self) -> FloatArray:
        """Return the force (N) of the tissue on the probe, of the whole body."""
        return -whole_force(self._indentation.force, self._mirrored)

    def _energies(self) -> tuple[float, float]:
        """Return what is dissipated and what is stored (J) of the modelled part."""
        if not self._place.has_moved:
            return 0.0, 0.0
        own = np.array([self._variables.heat, self._variables.stored])
        heat, stored = self._body.unit * global_sum(self._body.comm, own)
        return float(heat) + self._indentation.rubbed, self._elastic() - self._at_start + float(stored)

    def _elastic(self) -> float:
        """Return the energy (J) of the modelled part with what is left of the modulus after a long time."""
        self._body.impose(None, self._variables.rest)
        return self._body.energy(self._state)

    def _stopped(self, course: Course, why: LargeError) -> LargeError:
        """Return the error of steps that end before the end of the course."""
        place, (*_, force) = self._place, self._force()
        reached, times = (place.fraction * self._depth, float(force)), (place.time, course.times[-1])
        return ended(
            why,
            self._law,
            reached,
            self._depth,
            is_found=self._indentation.is_found,
            times=times,
            has_own_mesh=self._has_own_mesh,
        )
