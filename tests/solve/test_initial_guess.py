"""Earlier solutions begin the next one, by the best of their sums in energy; what is kept changes no force."""

import numpy as np
import pytest
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run import far_field
from pipeline.run.execute import compute
from pipeline.solve.conditions import Conditions
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.spaces import Spaces
from tests.cases import study
from tests.solve.test_mixed import law, make_mesh


def test_a_solve_begins_from_the_best_sum_of_earlier_ones():
    """A sum of loads that were solved for takes no more iterations than to see that nothing is left."""
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
    for without in ((), ("reuse",)):
        far_field._known.clear()
        plan = make_plan(study(**changes), without=without)
        records = compute(plan, MPI.COMM_SELF)
        found.append([records[key] for key in plan.keys])
    begun, afresh = found
    assert [one.force for one in begun] == pytest.approx([one.force for one in afresh], rel=1e-10)
    assert [one.force_error for one in begun] == pytest.approx([one.force_error for one in afresh], rel=1e-6)
    assert begun[0].iterations == afresh[0].iterations
    assert all(one.iterations < 0.7 * other.iterations for one, other in zip(begun[1:], afresh[1:], strict=True))
