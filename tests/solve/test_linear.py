"""Conjugate gradients with multigrid: exact enough for F, balanced near locking, indifferent to the mesh's size."""

import time

import numpy as np
import pytest
from petsc4py import PETSc

from pipeline.solve.conditions import Conditions
from pipeline.solve.linear import Level, LinearSolver, SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.solution import BALANCE_LIMIT, check_balance
from pipeline.solve.spaces import Spaces
from tests.solve.test_mixed import DEPTH, PRESS, law, make_mesh


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
def test_default_tolerance_is_enough_for_f(degree, poisson):
    with QuasiStaticProblem(Spaces(make_mesh(mesh={"degree": min(degree, 2)})), degree, Conditions()) as problem:
        usual = problem.solve(law(poisson), PRESS, method="iterative")
        direct = problem.solve(law(poisson), PRESS, method="direct")
    assert usual.reaction[2] == pytest.approx(direct.reaction[2], rel=1e-8)
    assert usual.balance <= BALANCE_LIMIT
    assert direct.iterations == 1 < usual.iterations


def test_force_of_a_probe_that_slices_is_as_exact():
    """Its force along the axis is not the work alone: both movements are solved for."""
    slicing = Loads.along((DEPTH / 2, 0.0, -DEPTH))
    with QuasiStaticProblem(Spaces(make_mesh(mirrors=("y",))), 2, Conditions()) as problem:
        usual, direct = (problem.solve(law(0.45), slicing, method=method) for method in ("iterative", "direct"))
    assert usual.reaction == pytest.approx(direct.reaction, rel=1e-7, abs=1e-7 * direct.reaction[2])


def test_forces_that_do_not_balance_are_a_failure():
    with (
        QuasiStaticProblem(Spaces(make_mesh()), 2, Conditions()) as problem,
        pytest.raises(SolveError, match="do not balance"),
    ):
        problem.solve(law(0.3), PRESS, method="iterative", tolerance=1e-3)


def test_times_are_those_that_passed():
    mesh, begin = make_mesh(), time.perf_counter()
    with QuasiStaticProblem(Spaces(mesh), 2, Conditions()) as problem:
        found = problem.solve(law(0.3), PRESS, method="iterative", estimate=True)
    times = found.times
    assert min(times.assemble, times.setup, times.solve, times.error) > 0
    assert times.total + times.error <= time.perf_counter() - begin


@pytest.mark.parametrize(("direct", "levels", "serves"), [(False, 1, True), (True, 1, False), (False, 2, False)])
def test_what_is_set_up_for_degree_1_serves_above_it_unless_it_is_a_factorisation(direct, levels, serves):
    solver = object.__new__(LinearSolver)
    solver._is_single, solver._is_direct = False, direct
    solver._levels = [Level(None, None, np.empty(0)) for _ in range(levels)]
    above = Level(None, None, np.empty(0))
    assert solver.carries([*solver._levels, above]) == serves
    assert not solver.carries([above, *solver._levels])
    assert not solver.carries([*solver._levels, Level(None, None, np.empty(0), held=np.zeros(1))])


def test_what_does_not_converge_is_a_failure():
    """An operator that is not positive definite: no energy is smallest, and conjugate gradients give up."""
    matrix = PETSc.Mat().createAIJ(2, nnz=2, comm=PETSc.COMM_SELF)
    matrix.setValues([0, 1], [0, 1], [1.0, 3.0, 3.0, 1.0])
    matrix.assemble()
    solver = LinearSolver([Level(None, matrix, np.empty(0, np.int32))], direct=False, tolerance=1e-6)
    rhs, unknown = matrix.createVecs()
    rhs.setValues([0, 1], [1.0, -1.0])
    rhs.assemble()
    with pytest.raises(SolveError, match="did not converge: diverged_"):
        solver.solve(rhs, unknown)
    solver.close()


@pytest.mark.parametrize("degree", [1, 2])
def test_iterations_do_not_grow_with_the_mesh(degree):
    counts, dofs = [], []
    for rim, fine in (("1 mm", "5 mm"), ("0.25 mm", "2.5 mm")):
        mesh = make_mesh(mesh={"rim": rim, "fine": fine, "growth": 0.5, "degree": degree})
        with QuasiStaticProblem(Spaces(mesh), degree, Conditions()) as problem:
            counts.append(problem.solve(law(0.3), PRESS, method="iterative").iterations)
            dofs.append(problem.dofs)
    assert dofs[1] > 4 * dofs[0]
    assert counts[1] <= 1.3 * counts[0]


def test_a_tolerance_after_a_target_is_kept():
    """What one solve was allowed to leave, in joules, the next one is not."""
    with (
        QuasiStaticProblem(Spaces(make_mesh()), 2, Conditions()) as problem,
        problem.solver(law(0.3), "iterative") as solver,
    ):
        rhs, solution = solver.matrix.createVecs()
        rhs.set(1.0)
        loose = solver.solve(rhs, solution, target=1e3)
        solution.set(0.0)
        strict = solver.solve(rhs, solution, tolerance=1e-8)
        rhs.destroy()
        solution.destroy()
    assert loose < 3 < strict


def test_a_set_up_that_fails_leaves_nothing(monkeypatch):
    made = []

    def own(self, item):
        self._owned.append(item)
        made.append(item)
        return item

    def multigrid(*_):
        raise MemoryError

    with (
        Spaces(make_mesh()) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions()) as problem,
        problem.solver(law(0.3), "iterative") as solver,
    ):
        monkeypatch.setattr(LinearSolver, "_own", own)
        monkeypatch.setattr(LinearSolver, "_multigrid", multigrid)
        with pytest.raises(MemoryError):
            LinearSolver(solver.levels, direct=False, tolerance=1e-6)
    assert made
    assert all(item.handle == 0 for item in made)


@pytest.mark.parametrize("balance", [2 * BALANCE_LIMIT, np.inf, np.nan])
def test_forces_that_do_not_balance_are_refused_and_so_is_no_number(balance):
    check_balance(BALANCE_LIMIT)
    with pytest.raises(SolveError, match="do not balance"):
        check_balance(balance)
