"""Earlier solutions begin the next one, by the best of their sums in energy; what is kept changes no force."""

import numpy as np
import pytest
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run import far_field
from pipeline.run.execute import compute
from pipeline.solve.initial_guess import Earlier
from pipeline.solve.physics import MaterialLaw
from tests.cases import study

LAW = MaterialLaw.of_moduli(1.0, 0.3)


def _operator(size=60):
    """Return a symmetric positive definite matrix of condition 1e8."""
    random = np.random.default_rng(3)
    turn, _ = np.linalg.qr(random.standard_normal((size, size)))
    return turn @ np.diag(np.geomspace(1, 1e8, size)) @ turn.T, random


def test_the_guess_is_the_nearest_sum_in_energy():
    matrix, random = _operator()
    earlier = Earlier(MPI.COMM_SELF, len(matrix), LAW)
    solutions = random.standard_normal((5, len(matrix)))
    solutions[1:4] = solutions[0] + 1e-3 * solutions[1:4]  # neighbours
    load = matrix @ random.standard_normal(len(matrix))
    assert not earlier.guess(load).any()
    for solution in solutions:
        earlier.add(matrix @ solution, solution)
    basis = np.linalg.cholesky(matrix).T
    nearest, *_ = np.linalg.lstsq(basis @ solutions.T, np.linalg.solve(basis.T, load), rcond=None)
    assert earlier.guess(load) == pytest.approx(nearest @ solutions, rel=1e-6)
    within = solutions.T @ [1.0, 2.0, 0.0, -1.0, 3.0]
    assert earlier.guess(matrix @ within) == pytest.approx(within, rel=1e-7)


def test_what_is_no_news_is_not_kept_and_the_latest_is():
    matrix, random = _operator()
    earlier = Earlier(MPI.COMM_SELF, 100_000_000 // (16 * 3), LAW)
    found = random.standard_normal((5, len(matrix)))
    for solution in (found[0], 2 * found[0], *found):
        earlier.add(matrix @ solution, solution)
    kept = np.array(earlier._solutions)
    assert len(kept) == 3 and kept @ matrix @ kept.T == pytest.approx(np.eye(3), abs=1e-6)
    assert abs(kept[-1] @ matrix @ found[4]) > abs(kept[1] @ matrix @ found[4])


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
