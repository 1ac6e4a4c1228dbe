"""The reduced basis: what it gives is the Galerkin solution, and asking it costs nothing that stays."""

import numpy as np
import psutil
import pytest
from mpi4py import MPI

from pipeline.run.basis import ReducedBasis
from pipeline.solve.elasticity import ElasticBody
from pipeline.solve.spaces import Spaces
from tests.solve.test_mixed import DEPTH, contact, make_mesh

TRAVEL = (0.0, 0.0, -DEPTH)
RATIOS = (0.1, 0.3, 0.45)


def t_of(poisson: float) -> float:
    """λ/μ."""
    return 2 * poisson / (1 - 2 * poisson)


@pytest.mark.mpi
def test_energy_falls_towards_that_of_a_solve_with_each_solution():
    """A combination of more solutions has less energy, never less than the solution itself."""
    with ElasticBody(Spaces(make_mesh(MPI.COMM_WORLD)), 2, contact()) as body:
        wanted = 2 * body.solve((t_of(0.4), 1.0)).energy
        found = []
        with ReducedBasis(body, TRAVEL, t_of(0.0), "auto") as basis:
            for poisson in RATIOS:
                body.solve((t_of(poisson), 1.0))
                basis.add(body.correction)
                reduced = basis.evaluate(t_of(0.4))
                found.append(reduced.twice_energy / wanted - 1)
                assert -1e-9 < found[-1] <= 1.001 * reduced.bound
                assert -reduced.reaction @ np.array(TRAVEL) == pytest.approx(reduced.twice_energy)
                np.testing.assert_allclose(basis.evaluate(t_of(0.4)).reaction, reduced.reaction)
    assert found[0] > 10 * found[1] > 100 * found[2]
    assert found[2] < 1e-3


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="looks at the memory of one process")
def test_many_evaluations_keep_no_memory():
    mesh = make_mesh(mesh={"fine": "2 mm", "rim": "0.5 mm"})
    with (
        ElasticBody(Spaces(mesh), 2, contact()) as body, ReducedBasis(body, TRAVEL, t_of(0.0), "auto") as basis,
    ):  # fmt: skip
        body.solve((t_of(0.3), 1.0))
        basis.add(body.correction)
        basis.displacement(basis.evaluate(0.5))
        before = psutil.Process().memory_info().rss
        for number in range(300):
            basis.displacement(basis.evaluate(0.01 * number))
        # A vector each would be this many bytes.
        assert psutil.Process().memory_info().rss - before < 0.2 * 300 * 8 * body.dofs
