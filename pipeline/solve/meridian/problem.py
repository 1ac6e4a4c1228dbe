"""Round scenes in the half plane (r, z): the same elasticity, two dimensions, and F to about 1e-7.

Lengths are in units of the footprint's radius a, stresses in units of μ and displacements in units of the depth d:
nothing depends on the unit of anything. The force is the reaction: the residual of the unmodified operator on the
probe's dofs, times 2π.
"""

from math import pi

import numpy as np

from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import Grading, Meridian, meridian_mesh
from pipeline.solve.krylov import SolveError
from pipeline.solve.meridian.forms import MeridianForms
from pipeline.solve.meridian.refine import DEGREE, Answer, MeridianSolver, error_bar
from pipeline.solve.meridian.system import HalfPlane, Pressed, System, max_strain, meshes_of
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.spaces import Conditions
from pipeline.stages import stage


class MeridianProblem(MeridianSolver):
    """The meridian of a round scene, which a probe presses along its axis."""

    def __init__(self, meridian: HalfPlane, conditions: Conditions, *, accuracy: float = 1e-5, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``; ``degree`` is 3 at least."""
        super().__init__(meridian, accuracy=accuracy, degree=degree)
        self._bonded = conditions.bonded

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        return self._best(lambda grading: self._solve_on(grading, law, depth))

    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float) -> Answer:
        """Solve with degrees p - 1 and p on one mesh: the answer is that of p, its error bar comes from the difference.

        Raises:
            SolveError: if a solve fails a check.
        """
        with stage("meshing"):
            arrays = self._meridian.mesh(grading)
            meshes = meshes_of(arrays)
        found: list[tuple[System, Pressed, float]] = []
        for degree in (self._degree - 1, self._degree):
            with stage("assembly"):
                system = System(meshes, degree, law, bonded=self._bonded)
            with system.factors(system.probe) as solve:
                pressed = solve(np.full(len(system.probe), -1.0))
            on_probe = 2 * pi * float(pressed.residual[system.probe].sum())
            if on_probe >= 0:
                raise SolveError("the tissue pulls at the probe that presses it")
            found.append((system, pressed, on_probe))
        (_, coarse, coarse_force), (system, fine, force) = found
        with stage("solve"):
            strain = max_strain(system.forms, arrays)
        return Answer(
            stiffness=fine.twice_energy,
            on_probe=force,
            balance=fine.balance,
            error=error_bar(coarse_force, force, self._degree, max(coarse.balance, fine.balance)),
            unit=arrays.unit,
            max_strain=abs(depth) / arrays.unit * strain,
            dofs=system.forms.dofs,
            cells=len(arrays.cells),
            iterations=fine.steps,
        )


def compile_axisymmetric(degree: int = DEGREE, *, curved: bool = False, lowest: int = 0) -> None:
    """Compile every form that a :class:`MeridianProblem` needs, on this process; call it within ``compiling()``.

    Those from the degree ``lowest`` on, if it is given.
    """
    example: HalfPlane = EllipticMeridian(2.0, 2.0, 1.0, 0.0) if curved else Meridian(2.0, 1.0, 1.0)
    mesh = meridian_mesh(example.mesh(Grading(1.0)))
    for poisson in (0.0, 0.5):
        for p in range(lowest or degree - 1, degree + 1):
            MeridianForms({0: mesh}, p, MaterialLaw.of_moduli(1.0, poisson))
