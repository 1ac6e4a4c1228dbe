"""Multigrid in single precision: as good a preconditioner as in double precision, in any units."""

import numpy as np
import pytest

from epsmesh.solve import SolveError
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.kernels import multigrid
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.solve.test_mixed import PRESS, law, make_mesh

FINE = {"mesh": {"rim": "0.5 mm", "fine": "3 mm"}}


def solved(kind, degree, material, movement=PRESS, **options):
    with Spaces(make_mesh(**FINE)) as spaces, QuasiStaticProblem(spaces, degree, Conditions(), kind) as problem:
        return problem.solve(material, movement, method="iterative", estimate=True, **options)


def test_a_tolerance_below_that_of_a_float_is_met():
    exact, found = (solved("displacement", 2, law(0.3), tolerance=tolerance) for tolerance in (1e-12, 1e-6))
    assert exact.balance < 1e-9
    assert exact.reaction[2] == pytest.approx(found.reaction[2], rel=1e-9)


def test_a_too_small_estimate_of_the_largest_eigenvalue_is_repaired(monkeypatch):
    """A few slender elements cause it: few Lanczos steps from random vectors do not find their eigenvalue."""
    known = solved("displacement", 2, law(0.3))
    monkeypatch.setattr(multigrid, "_LANCZOS", 1)
    found = solved("displacement", 2, law(0.3))
    assert found.reaction[2] == pytest.approx(known.reaction[2], rel=1e-8)
    assert found.bar == pytest.approx(known.bar, rel=0.02)
    monkeypatch.setattr(multigrid.Cycle, "refine_eigenvalues", lambda self: None)
    with pytest.raises(SolveError, match="indefinite"):
        solved("displacement", 2, law(0.3))


@pytest.mark.parametrize("stiffer", [1e-20, 1e25])
@pytest.mark.parametrize("deeper", [1e-15, 1e10])
def test_no_unit_runs_out_of_numbers(stiffer, deeper):
    (tissue,), depth = law(0.3).parameters, PRESS.amounts[0]
    known = solved("displacement", 2, law(0.3))
    material = MaterialLaw.of(stiffer * tissue.lame_lambda, stiffer * tissue.lame_mu)
    found = solved("displacement", 2, material, Movement(PRESS.motions, (deeper * depth,)))
    assert found.reaction[2] == pytest.approx(stiffer * deeper * known.reaction[2], rel=1e-8)


def test_it_is_symmetric_and_positive():
    with (
        Spaces(make_mesh(**FINE)) as spaces,
        QuasiStaticProblem(spaces, 3, Conditions()) as problem,
        problem.solver(law(0.4), "iterative") as lent,
    ):
        solver = LinearSolver(lent.levels, direct=False)
        assert solver.ksp.pc.getType() == "python"
        random = np.random.default_rng(5)
        pairs = []
        for _ in range(2):
            vector, result = solver.matrix.createVecs()
            vector.array[:] = random.standard_normal(vector.getSize())
            solver.precondition(vector, result)
            pairs.append((vector, result))
        (x, mx), (y, my) = pairs
        size = (x.dot(mx) * y.dot(my)) ** 0.5
        assert abs(x.dot(my) - y.dot(mx)) < 1e-5 * size
        assert x.dot(mx) > 0
        for item in (x, mx, y, my):
            item.destroy()
        solver.close()


def test_an_operator_that_is_not_positive_is_refused():
    with (
        Spaces(make_mesh()) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions()) as problem,
        problem.solver(law(0.3), "iterative") as solver,
    ):
        coarse, fine = solver.levels
        with (
            problem.elements.displacements.lend(MaterialLaw.of(-1.0, -1.0), entries=False) as turned,
            pytest.raises(SolveError, match="not positive definite"),
        ):
            LinearSolver([coarse, Level(fine.space, turned, fine.prescribed)], direct=False)


def test_moduli_out_of_range_are_refused():
    with (
        QuasiStaticProblem(Spaces(make_mesh()), 2, Conditions()) as problem,
        pytest.raises(SolveError, match="the range of single precision"),
    ):
        problem.solve(MaterialLaw.of(1e-38, 1e-38), PRESS, method="iterative")
