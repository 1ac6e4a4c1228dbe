"""The reduced basis: it gives the Galerkin solution, and evaluations keep no memory."""

import numpy as np
import psutil
import pytest
from mpi4py import MPI

from epsmesh.solve.conditions import Conditions
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.reduced_basis import ReducedBasis
from epsmesh.solve.spaces import Spaces
from tests.solve.test_mixed import DEPTH, PRESS, make_mesh

RATIOS = (0.1, 0.3, 0.45)


def t_of(poisson: float) -> float:
    """λ/μ."""
    return 2 * poisson / (1 - 2 * poisson)


def law_of(poisson: float) -> MaterialLaw:
    """μ = 1 Pa."""
    return MaterialLaw.of(t_of(poisson), 1.0)


@pytest.mark.mpi
def test_energy_falls_towards_that_of_a_solve_with_each_solution():
    """A larger basis gives less energy, never less than the solution itself."""
    with QuasiStaticProblem(Spaces(make_mesh(MPI.COMM_WORLD)), 2, Conditions()) as problem:
        wanted = problem.solve(law_of(0.4), PRESS).energy
        found = []
        with (
            problem.solver(law_of(0.0)) as solver,
            ReducedBasis(problem.elements.displacements, solver, PRESS) as basis,
        ):
            for poisson in RATIOS:
                problem.solve(law_of(poisson), PRESS)
                ((correction,),) = problem.corrections.values()
                basis.add(correction)
                reduced = basis.evaluate(t_of(0.4))
                found.append(reduced.response.energy / wanted - 1)
                assert -1e-9 < found[-1] <= 1.001 * reduced.bound
                assert reduced.response.force[2] * DEPTH == pytest.approx(2 * reduced.response.energy)
                np.testing.assert_allclose(basis.evaluate(t_of(0.4)).response.force, reduced.response.force)
    assert found[0] > 10 * found[1] > 100 * found[2]
    assert found[2] < 1e-3


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="looks at the memory of one process")
def test_many_evaluations_keep_no_memory():
    mesh = make_mesh(mesh={"fine": "2 mm", "rim": "0.5 mm"})
    with (
        QuasiStaticProblem(Spaces(mesh), 2, Conditions()) as problem,
        problem.solver(law_of(0.0)) as solver,
        ReducedBasis(problem.elements.displacements, solver, PRESS) as basis,
    ):
        problem.solve(law_of(0.3), PRESS)
        ((correction,),) = problem.corrections.values()
        basis.add(correction)
        basis.displacement(basis.evaluate(0.5))
        before = psutil.Process().memory_info().rss
        for number in range(300):
            basis.displacement(basis.evaluate(0.01 * number))
        # A vector each would be this many bytes.
        assert psutil.Process().memory_info().rss - before < 0.2 * 300 * 8 * problem.dofs
