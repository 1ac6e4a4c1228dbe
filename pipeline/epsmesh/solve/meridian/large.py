"""Large displacements in the half plane (r, z): a bonded disc presses on a body of any isotropic law.

Newton's method with direct solves. The path to the depth has the steps of :mod:`epsmesh.solve.load_steps` and its
check of the work, in elements of degree p - 1; those of degree p begin at its end.

At the disc's edge tissue folds, the sooner the smaller its elements are. Meshes are refined at the edge until the error
bar is small enough, or until a finer mesh does not reach the depth.

Lengths are in units of the disc's radius a, stresses in units of μ of region 0.
"""

from abc import abstractmethod
from functools import cached_property
from math import pi
from typing import Any

import numpy as np
from petsc4py import PETSc

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.mesh.meridian import Grading, MeridianArrays
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.ended import ended
from epsmesh.solve.load_steps import check_path
from epsmesh.solve.meridian.in_time import RelaxingHalfPlane
from epsmesh.solve.meridian.problem import Answer, MeridianSolver, best_of, error_bar
from epsmesh.solve.meridian.system import HalfPlane, System, max_strain, meshes_of
from epsmesh.solve.meridian.tissue import HeldNodes, MeridianTissue
from epsmesh.solve.newton import LargeError, hold
from epsmesh.solve.path import SHORTEST, Path, PathPoint, follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.time_steps import Indentation
from epsmesh.stages import stage

DEGREE = 4
# Meshes, tried in this order until the error bar is below the required accuracy.
GRADINGS = tuple(Grading(floor, 1.0, 4.0) for floor in (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3))
# Tolerance on the residual, relative to the forces at the probe; most Newton iterations, and lengths of a step.
_LEFT, _MOST_ITERATIONS, _HALVINGS = 1e-9, 14, 6
# Fewest load steps.
_FEWEST = 3
# Steps of a mesh after the first, which must reach the depth with ease, are halved once at most.
_SHORTEST_OF_FINER = 1 / 7
# Largest error bar of a result.
_WORST_ERROR = 2e-2
_ROUNDING = 1e-13


class LargeSystem(System):
    """A system of laws of large displacements.

    A state is the vector of all dofs, with the values prescribed at the probe.
    """

    def forces(self, state: FloatArray) -> tuple[float, float, float]:
        """Return F of the tissue on the probe and on the support, and the strain energy of a ``state``."""
        residual = self.forms.residual(state)
        on_probe, on_support = (2 * pi * float(residual[dofs].sum()) for dofs in (self.probe, self.support))
        return on_probe, on_support, 2 * pi * self.forms.energy(state)

    def reach(self, depth: float, shortest: float = SHORTEST) -> tuple[FloatArray, FloatArray]:
        """Return the state at a ``depth``, and the path to it: depth, force and energy of each step.

        The ``shortest`` step is in units of the depth.

        Raises:
            LargeError: if a step becomes too short; ``reached`` are the depth and force of the last one.
        """
        path, work = Path(PathPoint(0.0, np.zeros(self.forms.dofs))), [(0.0, 0.0, 0.0)]

        def solve_at(amount: float) -> tuple[PathPoint, bool]:
            state = self.equilibrate(path.last.state, amount)
            on_probe, _, energy = self.forces(state)
            work.append((amount, -on_probe, energy))
            return PathPoint(amount, state), True

        try:
            follow(path, solve_at, depth, fewest=_FEWEST, shortest=shortest)
        except LargeError as error:
            raise LargeError(str(error), work[-1][:2] if path.reached else None) from error
        return path.last.state, np.array(work)

    def equilibrate(self, state: FloatArray, depth: float) -> FloatArray:
        """Return the equilibrium with the probe at a ``depth``, from an initial guess ``state``.

        Raises:
            LargeError: if Newton's method does not converge.
        """
        tissue = self._tissue
        tissue.state, pressed = state, np.zeros(tissue.fixed.shape, dtype=bool)
        pressed[:, -1] = True
        hold(HeldNodes(tissue, pressed, tissue.places - [0.0, depth]), _LEFT, _MOST_ITERATIONS, _HALVINGS)
        return tissue.state

    @cached_property
    def _tissue(self) -> MeridianTissue:
        places = np.column_stack([self.radii, np.zeros_like(self.radii)])
        return MeridianTissue(self, np.column_stack([self.slide, self.probe]), places)

    @property
    def iterations(self) -> int:
        """Linear solves so far."""
        return self._tissue.iterations


class MeridianIndentation(Indentation):
    """A ``system`` of relaxing tissue whose probe moves to a ``depth`` (units of the mesh, ``unit``, m)."""

    is_found = False

    def __init__(self, system: LargeSystem, law: MaterialLaw, depth: float, unit: float):
        self._system, self._depth, self._unit = system, depth, unit
        self.body = RelaxingHalfPlane.of(system.forms, law, unit)
        self.force, self.rate = np.zeros(3), 0.0

    def equilibrate(self, state: PETSc.Vec, fraction: float) -> None:
        """Find the equilibrium at a fraction."""
        system, before = self._system, self._system.iterations
        try:
            state.array[:] = system.equilibrate(state.array_r.copy(), fraction * self._depth)
        finally:
            self.body.iterations += system.iterations - before
        work = self.body.unit * float(system.forms.residual(state.array_r)[system.probe].sum())
        self.force, self.rate = np.array([0.0, 0.0, work / self._unit]), -work * self._depth

    def guess(self, state: PETSc.Vec) -> None:
        """Return nothing: Newton's first step is the guess by the tangent."""
        return

    def unit(self, state: PETSc.Vec, fraction: float) -> FloatArray:
        """Return the displacement per metre, as a secant."""
        return np.asarray(state.array_r / (fraction * self._depth * self._unit))


class LargeSolver(MeridianSolver):
    """The meridian of a body of a law of large displacements; meshes are tried in the order of ``gradings``."""

    gradings: tuple[Grading, ...]

    def __init__(self, meridian: HalfPlane, *, accuracy: float = 1e-4, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``; ``degree`` is 3 at least."""
        super().__init__(meridian, accuracy=accuracy, degree=degree)

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        return best_of(
            self.gradings,
            lambda grading, before: self._solve_on(grading, law, depth, before),
            self._accuracy,
            _WORST_ERROR,
            ends_with=SolveError,
        )

    @abstractmethod
    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float, before: Answer | None) -> Answer:
        """Return the result on a mesh; ``before`` is the best one of coarser meshes.

        Raises:
            SolveError: if the depth is not reached, or the result fails a check.
        """


class LargeMeridian(LargeSolver):
    """The meridian of a body of a law of large displacements, under a bonded disc."""

    gradings = GRADINGS

    def __init__(self, meridian: HalfPlane, conditions: Conditions, **how: Any):
        """Prepare, as :class:`LargeSolver`; ``how`` are its ``accuracy`` and ``degree``."""
        super().__init__(meridian, **how)
        self._bonded = conditions.bonded

    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float, before: Answer | None) -> Answer:
        with stage("meshing"):
            arrays = self._meridian.mesh(grading)
            meshes = meshes_of(arrays)
        deep = depth / arrays.unit
        with stage("assembly"):
            coarse, fine = (
                LargeSystem(meshes, degree, law, bonded=self._bonded) for degree in (self._degree - 1, self._degree)
            )
        try:
            state, path = coarse.reach(deep, SHORTEST if before is None else _SHORTEST_OF_FINER)
        except LargeError as stop:
            raise stopped(stop, arrays, law, depth, is_found=False) from stop
        check_path(path, _ROUNDING * float(np.ptp(arrays.points, axis=0).prod()))
        state = fine.equilibrate(fine.forms.interpolate(coarse.forms, state), deep)
        on_probe, on_support, energy = fine.forces(state)
        balance = abs(on_probe + on_support) / abs(on_probe)
        check_balance(balance)
        coarse_force, coarse_energy = path[-1, 1:]
        error = max(
            error_bar(coarse_force, -on_probe, self._degree, balance),
            error_bar(coarse_energy, energy, self._degree, balance),
        )
        error += fine.forms.unresolved(state)
        if before is None:
            error *= fitted.MERIDIAN_FIRST
        else:
            error = max(error, fitted.MERIDIAN_MESHES * abs(before.on_probe * deep / on_probe - 1))
        return Answer(
            stiffness=-on_probe / deep,
            on_probe=on_probe / deep,
            balance=balance,
            error=error,
            unit=arrays.unit,
            max_strain=max_strain(fine.forms, arrays),
            dofs=fine.forms.dofs,
            cells=len(arrays.cells),
            iterations=coarse.iterations + fine.iterations,
            energy=energy * arrays.unit**2,
            in_time=lambda: MeridianIndentation(fine, law, deep, arrays.unit),
        )


def stopped(
    error: LargeError, arrays: MeridianArrays, law: MaterialLaw, depth: float, *, is_found: bool, friction: float = 0.0
) -> LargeError:
    """Return the error of a path that ends before ``depth`` (m), in N and metres."""
    if error.reached is None:
        return error
    reached = error.reached[0] * arrays.unit, error.reached[1] * law.lame_mu[0] * arrays.unit**2
    return ended(error, law, reached, depth, is_found=is_found, friction=friction, has_own_mesh=True)
