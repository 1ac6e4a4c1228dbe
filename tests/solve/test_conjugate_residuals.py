"""GCR with stored vectors in single precision: exactness of its residual, restarts, breakdown."""

from dataclasses import dataclass

import numpy as np
import pytest
from petsc4py import PETSc

from epsmesh.solve import SolveError
from epsmesh.solve.conjugate_residuals import conjugate_residuals

N = 300


class Jacobi:
    """The inverse diagonal, times a number that differs between calls."""

    def __init__(self, diagonal, factor=1.0):
        self.diagonal, self.factor = diagonal, factor

    def apply(self, _, residual, result):
        self.factor = -self.factor
        result.array[:] = self.factor * residual.array / self.diagonal


@dataclass
class Solution:
    matrix: PETSc.Mat
    rhs: PETSc.Vec
    values: PETSc.Vec

    def residual(self, result, work):
        self.matrix.mult(self.values, result)
        result.aypx(-1.0, self.rhs)
        work.set(np.nan)

    def add(self, correction):
        self.values.axpy(1.0, correction)


def system(unit=1.0):
    """A nonsymmetric system with diagonal entries of four orders of magnitude, its solution and a preconditioner."""
    random = np.random.default_rng(3)
    diagonal = np.geomspace(1.0, 1e4, N)
    entries = np.diag(diagonal) + 0.02 * random.standard_normal((N, N)) * np.sqrt(np.outer(diagonal, diagonal))
    exact = unit * random.standard_normal(N)
    matrix = PETSc.Mat().createDense((N, N), array=entries, comm=PETSc.COMM_SELF)
    rhs, values = matrix.createVecs()
    rhs.array[:] = entries @ exact
    values.set(0.0)
    return Solution(matrix, rhs, values), exact, Jacobi(diagonal)


@pytest.mark.parametrize("restart", [40, 7])
@pytest.mark.parametrize("unit", [1.0, 1e-60])
def test_the_solution_has_the_residual_that_the_iteration_ended_with(restart, unit):
    solution, exact, jacobi = system(unit)
    norms = []

    def below(_, norm):
        norms.append(norm)
        return norm < 1e-9 * norms[0]

    iterations = conjugate_residuals(solution.matrix, jacobi, solution, below, restart)
    assert iterations == len(norms) - 1 > 7
    assert np.all(np.diff(norms) <= 0)
    residual, work = solution.rhs.duplicate(), solution.rhs.duplicate()
    solution.residual(residual, work)
    # Directions of single precision: the residual of the iteration and that of its solution differ by their rounding.
    assert residual.norm() < 1e-7 * norms[0]
    assert np.abs(solution.values.array - exact).max() < 1e-5 * unit


def test_it_continues_from_the_initial_guess():
    solution, exact, jacobi = system()
    solution.values.array[:] = exact
    assert conjugate_residuals(solution.matrix, jacobi, solution, lambda _, norm: norm < 1e-6, 40) == 0


def test_a_preconditioner_that_gives_nothing_is_an_error():
    solution, _, jacobi = system()
    jacobi.factor = 0.0
    with pytest.raises(SolveError, match="broke down"):
        conjugate_residuals(solution.matrix, jacobi, solution, lambda *_: False, 40)
