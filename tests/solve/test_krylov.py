"""Conjugate gradients with multigrid: accurate for F, balanced near locking, independent of the mesh size."""

from contextlib import ExitStack

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.plan.plan import make_plan
from epsmesh.run import far_field
from epsmesh.run.execute import compute
from epsmesh.solve import SolveError, krylov, linear_solver
from epsmesh.solve.balance import BALANCE_LIMIT, check_balance
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.hierarchical_estimate import energy_decrements
from epsmesh.solve.krylov import keep
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import study
from tests.solve.test_mixed import DEPTH, PRESS, law, make_mesh


@pytest.mark.parametrize(("degree", "poisson"), [(1, 0.3), (2, 0.49), (3, 0.0)])
def test_default_tolerance_is_enough_for_f(degree, poisson):
    with QuasiStaticProblem(Spaces(make_mesh(mesh={"degree": min(degree, 2)})), degree, Conditions()) as problem:
        usual = problem.solve(law(poisson), PRESS, method="iterative")
        direct = problem.solve(law(poisson), PRESS, method="direct")
    assert usual.reaction[2] == pytest.approx(direct.reaction[2], rel=1e-8)
    assert usual.balance <= BALANCE_LIMIT
    assert direct.iterations == 1 < usual.iterations


def test_force_of_a_probe_that_slices_is_as_exact():
    """Its force along the axis does not follow from the work alone: both motions are solved for."""
    slicing = Movement.along((DEPTH / 2, 0.0, -DEPTH))
    with QuasiStaticProblem(Spaces(make_mesh(mirrors=("y",))), 2, Conditions()) as problem:
        usual, direct = (problem.solve(law(0.45), slicing, method=method) for method in ("iterative", "direct"))
    assert usual.reaction == pytest.approx(direct.reaction, rel=1e-7, abs=1e-7 * direct.reaction[2])


def test_forces_that_do_not_balance_are_a_failure():
    with (
        QuasiStaticProblem(Spaces(make_mesh()), 2, Conditions()) as problem,
        pytest.raises(SolveError, match="do not balance"),
    ):
        problem.solve(law(0.3), PRESS, method="iterative", tolerance=1e-3)


def without_preconditioner(matrix):
    """Assemble a matrix; return a right side of ones, unknowns, and a preconditioner that changes nothing."""
    matrix.assemble()
    rhs, unknown = matrix.createVecs()
    rhs.set(1.0)
    plain = PETSc.PC().create(PETSc.COMM_SELF)
    plain.setOperators(matrix)
    plain.setType("none")
    return rhs, unknown, plain


@pytest.mark.parametrize("kind", ["tangent", "tangent, mixed"])
def test_a_solver_of_tangents_that_ends_at_its_last_iteration_has_not_converged(kind):
    """PETSc's GCR calls that a success: here with more than half of the residual left."""
    matrix = PETSc.Mat().createAIJ(50, nnz=3, comm=PETSc.COMM_SELF)
    for row in range(50):
        columns = [column for column in (row - 1, row, row + 1) if 0 <= column < 50]
        matrix.setValues([row], columns, [2.0 if column == row else -1.0 for column in columns])
    rhs, unknown, plain = without_preconditioner(matrix)
    with ExitStack() as stack:
        ksp = krylov.solver_of(kind, matrix, stack, plain, ksp_max_it=10)
        ksp.solve(rhs, unknown)
        left = rhs - matrix * unknown
        assert left.norm() > 0.5 * rhs.norm()
        assert not krylov.has_converged(ksp)
        with pytest.raises(SolveError, match="diverged_max_it after 10 iterations"):
            krylov.check_converged(ksp)
        enough = krylov.solver_of(kind, matrix, stack, plain, ksp_max_it=200)
        unknown.set(0.0)
        enough.solve(rhs, unknown)
        assert krylov.has_converged(enough)
        assert 10 < krylov.check_converged(enough) < 200


def test_a_step_of_newton_may_keep_a_tenth_of_the_residual():
    matrix = PETSc.Mat().createAIJ(50, nnz=1, comm=PETSc.COMM_SELF)
    for row in range(50):
        matrix.setValue(row, row, 1.0 + 10.0 * row)
    rhs, unknown, plain = without_preconditioner(matrix)
    found = list[bool]()
    for iterations in (2, 5, 10, 20):
        with ExitStack() as stack:
            ksp = krylov.solver_of("tangent, mixed", matrix, stack, plain, ksp_max_it=iterations, ksp_rtol=1e-12)
            unknown.set(0.0)
            ksp.solve(rhs, unknown)
            found.append(krylov.is_nearly_converged(ksp))
            assert found[-1] == ((rhs - matrix * unknown).norm() <= 0.1 * rhs.norm())
            assert not krylov.has_converged(ksp)
    assert {*found} == {False, True}


def test_what_does_not_converge_is_a_failure():
    """For an indefinite operator no energy is smallest, and conjugate gradients fail."""
    matrix = PETSc.Mat().createAIJ(200, nnz=3, comm=PETSc.COMM_SELF)  # more than a coarsest level solves at once
    for row in range(200):
        columns = [column for column in (row - 1, row, row + 1) if 0 <= column < 200]
        matrix.setValues([row], columns, [1.0 if column == row else -1.0 for column in columns])
    matrix.assemble()
    solver = LinearSolver([Level(None, matrix, np.empty(0, np.int32))], direct=False)
    rhs, unknown = matrix.createVecs()
    rhs.setValues(range(200), [1.0, 0.0] * 100)
    rhs.assemble()
    with pytest.raises(SolveError, match="did not converge: diverged_"):
        solver.solve(rhs, unknown, 1e-6)
    solver.close()


@pytest.mark.parametrize("degree", [1, 2])
def test_iterations_do_not_grow_with_the_mesh(degree):
    """Or hardly: from 600 to 44,000 unknowns of degree 1 hypre takes 9 to 13, PETSc 3.25's GAMG 9 to 15."""
    counts, dofs = [], []
    for rim, fine in (("1 mm", "5 mm"), ("0.25 mm", "2.5 mm")):
        mesh = make_mesh(mesh={"rim": rim, "fine": fine, "growth": 0.5, "degree": degree})
        with QuasiStaticProblem(Spaces(mesh), degree, Conditions()) as problem:
            counts.append(problem.solve(law(0.3), PRESS, method="iterative").iterations)
            dofs.append(problem.dofs)
    assert dofs[1] > 4 * dofs[0]
    assert counts[1] <= 1.3 * counts[0]


def test_a_tolerance_after_a_target_is_kept():
    """The absolute target (J) of one solve does not apply to the next."""
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

    def kept(stack, item):
        made.append(item)
        return keep(stack, item)

    def cycle(*_):
        raise MemoryError

    with (
        Spaces(make_mesh()) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions()) as problem,
        problem.solver(law(0.3), "iterative") as solver,
    ):
        monkeypatch.setattr(krylov, "keep", kept)
        monkeypatch.setattr(linear_solver, "Cycle", cycle)
        with pytest.raises(MemoryError):
            LinearSolver(solver.levels, direct=False)
    assert made
    assert all(item.handle == 0 for item in made)


@pytest.mark.parametrize("balance", [2 * BALANCE_LIMIT, np.inf, np.nan])
def test_forces_that_do_not_balance_are_refused_and_so_is_no_number(balance):
    check_balance(BALANCE_LIMIT)
    with pytest.raises(SolveError, match="do not balance"):
        check_balance(balance)


def test_decrements_are_energies_from_below():
    """r·A⁻¹·r by a few iterations, compared with a factorisation, for two right-hand sides and their product."""
    with (
        Spaces(make_mesh()) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions()) as problem,
        problem.solver(law(0.45), "iterative") as solver,
        problem.solver(law(0.45), "direct") as exact,
    ):
        rights, solutions = ([solver.matrix.createVecRight() for _ in range(2)] for _ in range(2))
        for number, (right, solution) in enumerate(zip(rights, solutions, strict=True)):
            right.array[:] = np.sin((1 + number) * np.arange(right.getSize()))
            right.array[solver.levels[-1].prescribed] = 0.0
            exact.solve(right, solution)
        wanted = np.array([[b.dot(x) for x in solutions] for b in rights])
        found, corrections, iterations = energy_decrements(solver, rights)
        (alone,), *_ = energy_decrements(solver, rights[:1])
    share = np.diag(found) / np.diag(wanted)
    assert (share < 1 + 1e-9).all() and (share > 0.9).all()
    assert found[0, 1] == found[1, 0] == pytest.approx(wanted[0, 1], abs=0.1 * np.diag(wanted).max())
    assert alone[0] == pytest.approx(found[0, 0], rel=1e-9)
    assert len(corrections) == 2 and 6 <= iterations < 60


def test_a_solve_begins_from_the_best_sum_of_earlier_ones():
    """A linear combination of earlier loads needs only the iterations that detect convergence."""
    with (
        Spaces(make_mesh()) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions()) as problem,
        problem.solver(law(0.3), "iterative") as solver,
    ):
        solver.recycle()
        random, right, unknown = np.random.default_rng(3), *solver.matrix.createVecs()
        movement = random.standard_normal((4, right.getSize()))
        movement[:, solver.levels[-1].prescribed] = 0.0
        counts, solutions = [], []
        for load in [*movement, np.array([1.0, 2.0, 0.0, -1.0]) @ movement]:
            right.array[:] = load
            counts.append(solver.solve(right, unknown, 1e-8))
            solutions.append(unknown.array.copy())
    assert min(counts[:4]) > 10 and counts[4] <= 3
    expected = np.array([1.0, 2.0, 0.0, -1.0]) @ solutions[:4]
    assert np.abs(solutions[4] - expected).max() < 1e-6 * np.abs(expected).max()


def test_places_of_a_path_begin_from_the_others():
    points = [["1 mm", "2 mm"], ["-9 mm", "4 mm"], ["5 mm", "-11 mm"], ["4 mm", "-9 mm"]]
    mesh = {"epsilon": "5 mm", "fine": "5 mm", "rim": "1 mm", "growth": 2.0, "outside": "green"}
    changes = {"probe": {"radius": "2 mm", "path": {"points": points}}, "mesh": mesh, "solve": {"method": "iterative"}}
    found = []
    for without in ((), ("initial-guess",)):
        far_field._known.clear()
        plan = make_plan(study(**changes), without=without)
        records = compute(plan, MPI.COMM_SELF)
        found.append([records[key] for key in plan.keys])
    begun, afresh = found
    assert [one.force for one in begun] == pytest.approx([one.force for one in afresh], rel=1e-10)
    assert [one.force_error for one in begun] == pytest.approx([one.force_error for one in afresh], rel=1e-6)
    assert begun[0].iterations == afresh[0].iterations
    assert all(one.iterations < 0.7 * other.iterations for one, other in zip(begun[1:], afresh[1:], strict=True))


@pytest.mark.mpi
def test_a_factorisation_that_lacks_space_starts_again_with_more(monkeypatch):
    """MUMPS's work space is a guess; the first one here is far too small."""
    expected = mixed_force()
    factorisations, make = [], krylov.solver_of
    monkeypatch.setattr(krylov, "WORK_SPACE", (-90, 300))
    monkeypatch.setattr(krylov, "solver_of", lambda kind, *rest: factorisations.append(kind) or make(kind, *rest))
    assert mixed_force() == pytest.approx(expected, rel=1e-9)
    assert factorisations == ["factors", "factors"]


def mixed_force():
    body = make_mesh(MPI.COMM_WORLD)
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, 2, Conditions(), "mixed") as problem:
        return problem.solve(law(0.49), PRESS, method="direct").reaction[2]
