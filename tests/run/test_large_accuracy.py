"""Accuracy at large displacements: true forces are within it, and a depth that is not reached says so."""

import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.sampling import sampled

A, YOUNG = 3e-3, 10e3
# F / (E a²) of a bonded disc on a cylinder of radius 10 a and height 7 a, by law, ν and depth / a: axisymmetric
# elements of degree 2 of other code, a / 100 at the disc's edge; from a / 50 on they change by less than 0.1 %.
KNOWN = [
    ({"law": "neo-hookean"}, 0.3, 0.05, 0.12816),
    ({"law": "neo-hookean"}, 0.49, 0.1, 0.30510),
    ({"law": "yeoh", "c2": 0.5, "c3": 0.2}, 0.3, 0.1, 0.2591),
]


def declared(material, poisson, depth, mesh):
    study = {
        "body": {"shape": "cylinder", "radius": f"{10 * A} m", "height": f"{7 * A} m", "fixed": "bottom"},
        "material": {"young": f"{YOUNG} Pa", "poisson": poisson, **material},
        "probe": {"shape": "disc", "radius": f"{A} m", "depth": f"{depth * A} m", "contact": "bonded"},
        "mesh": mesh,
    }
    return parse(study)


def run(*scene):
    (record,) = compute(make_plan(declared(*scene), without=("axisymmetric",)), MPI.COMM_SELF).values()
    return record


@pytest.mark.parametrize(("material", "poisson", "depth", "known"), KNOWN)
def test_true_error_is_below_the_accuracy_and_below_the_bar(material, poisson, depth, known):
    record = run(material, poisson, depth, {"accuracy": "2 %"})
    assert record.status == "ok"
    error = abs(record.force / (known * YOUNG * A**2) - 1)
    assert error <= record.force_error + 1e-3
    assert record.force_error <= 0.02


@sampled("depth, poisson", [(0.3, 0.4), (0.6, 0.49), (0.95, 0.3)], by_day=1)
def test_forces_of_a_ball_are_within_their_bars(depth, poisson):
    """The truth is the meridian's. Coarse meshes suffice for 1 %, unless contact ends near the ball's equator."""
    study = {
        "body": {"shape": "cylinder", "radius": f"{6 * A} m", "height": f"{4 * A} m", "fixed": "bottom"},
        "material": {"young": f"{YOUNG} Pa", "poisson": poisson, "law": "neo-hookean"},
        "probe": {"shape": "sphere", "radius": f"{A} m", "depth": f"{depth * A} m", "contact": "unilateral"},
        "mesh": {"accuracy": "1 %"},
    }
    truth, found = (
        next(iter(compute(make_plan(parse(study), without=without), MPI.COMM_SELF).values()))
        for without in ((), ("axisymmetric",))
    )
    assert (truth.origin, found.origin) == ("axisymmetric", "symmetric")
    assert abs(found.force / truth.force - 1) <= found.force_error + truth.force_error
    assert found.force_error <= 0.01


def test_depth_that_newton_does_not_reach_says_that_the_accuracy_is_not_reached():
    record = run({"law": "neo-hookean"}, 0.3, 6.0, {"accuracy": "5 %"})
    assert record.status == "partial"
    assert record.message.startswith("the accuracy 5 % is not reached: load steps reached")


def test_body_that_is_linear_beyond_epsilon_stays_so():
    mesh = {"accuracy": "5 %", "outside": "linear"}
    (solve,) = make_plan(declared({"law": "neo-hookean"}, 0.4, 0.2, mesh | {"epsilon": "6 mm"})).solves
    assert solve.case.is_linear_beyond
    assert solve.case.mesh.epsilon == pytest.approx(6e-3)
    with pytest.raises(StudyError, match="needs epsilon"):
        declared({"law": "neo-hookean"}, 0.4, 0.2, mesh)
