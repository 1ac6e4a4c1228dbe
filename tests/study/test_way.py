"""The way of a case follows from its sections: formulation, constraint, steps, dimension."""

import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.study.way import Constraint, Dimension, Motion, Steps
from tests.cases import BLADE, study

BALL = {"shape": "sphere", "radius": "3 mm", "depth": "0.2 mm"}
NEO = {"law": "neo-hookean"}
RELAXING = NEO | {"relaxation": [{"share": 0.3, "time": "2 s"}]}
HISTORY = {"history": {"ramp": "1 s", "hold": "10 s"}}


@pytest.mark.parametrize(
    ("probe", "material", "constraint", "steps", "formulation"),
    [
        ({}, {}, Constraint.BONDED, Steps.NONE, "displacement"),
        ({"contact": "frictionless"}, {"poisson": 0.49}, Constraint.SLIDING, Steps.NONE, "mixed"),
        (BALL, {}, Constraint.FOUND, Steps.NONE, "displacement"),
        (BALL | {"friction": 0.3}, {}, Constraint.FRICTION, Steps.LOAD, "displacement"),
        ({}, NEO, Constraint.BONDED, Steps.LOAD, "neo-hookean"),
        (BALL | {"friction": "stick"}, NEO | {"poisson": 0.5}, Constraint.FRICTION, Steps.LOAD, "neo-hookean-mixed"),
        (BALL | HISTORY, RELAXING, Constraint.FOUND, Steps.TIME, "neo-hookean"),
    ],
)
def test_a_way_follows_from_the_sections(probe, material, constraint, steps, formulation):
    way = study(probe=probe, material=material).case(()).way
    assert (way.constraint, way.steps, way.formulation) == (constraint, steps, formulation)
    assert way.dimension is Dimension.BODY


def test_tissue_beyond_is_part_of_the_formulation():
    mesh = {"epsilon": ["8 mm", "full"], "outside": "linear"}
    cases = study(material=NEO, mesh=mesh).cases()
    assert [case.way.formulation for case in cases] == ["linear+neo-hookean", "neo-hookean"]


def test_what_moves():
    blade = BLADE | {"incision": "4 mm", "radius": None}
    ball = {"epsilon": "8 mm", "outside": "halfspace"}
    changes = [{}, {"probe": {"motion": "all"}}, {"probe": blade}, {"mesh": ball}]
    found = [study(**change).case(()).way.motion for change in changes]
    assert found == [Motion.PRESS, Motion.SIX, Motion.SLIT, Motion.FAR]


def test_only_friction_on_a_linear_body_is_factorised():
    both = study(probe=BALL | {"friction": 0.3}, material={"law": ["linear", "neo-hookean"]})
    assert [case.way.is_factorised for case in both.cases()] == [True, False]


def test_a_plan_chooses_the_meridian_of_a_round_scene():
    body = {"shape": "cylinder", "radius": "30 mm", "height": "20 mm", "size": None}
    (solve,) = make_plan(study(body=body, plan={"without": []})).solves
    assert solve.way == solve.case.way.on_meridian
    assert solve.way.dimension is Dimension.MERIDIAN
