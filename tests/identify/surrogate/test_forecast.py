"""The cost of surrogates, estimated before: about what they then cost."""

import json

import pytest

from epsmesh.plan.cost import CostModel
from epsmesh.study.read import read_mapping
from epsmesh_identify.surrogate.build import build
from epsmesh_identify.surrogate.cases import domain_of
from epsmesh_identify.surrogate.forecast import forecast
from tests.identify.surrogate.scenes import BALL, PUNCH, hertz, solved_by

BONDED = PUNCH | {"probe": PUNCH["probe"] | {"contact": "bonded"}}


def _domain(study, bounds):
    return domain_of(read_mapping(study, "scene"), bounds, 1e-4)


def test_three_solves_are_the_least_where_the_equation_may_replace_the_others():
    found = forecast(_domain(BALL, {"young": (1e3, 1e6), "poisson": (0.2, 0.5)}), CostModel())
    assert found.least == 3 < found.most and found.least_seconds < found.most_seconds


def test_a_bonded_tool_is_solved_at_one_depth():
    found = forecast(_domain(BONDED, {"young": (1e3, 1e6), "poisson": (0.2, 0.5)}), CostModel())
    assert found.least == found.most == 5


@pytest.mark.parametrize(
    "bounds",
    [{"poisson": (0.0, 0.5)}, {"poisson": (0.0, 0.5), "radius": (1e-3, 2e-3)}],
    ids=["one parameter", "two parameters"],
)
def test_it_is_of_the_order_of_what_is_solved(bounds):
    asked = []
    domain = _domain(BALL, {"young": (1e3, 1e6), **bounds})
    build(domain, solved_by(lambda case: hertz(case) / (1 - case.probe.depth * 500), asked=asked), 1e-3)
    most = forecast(domain, CostModel()).most
    assert most / 5 < len(set(asked)) < 5 * most


def test_plan_tells_the_forces_of_a_study_with_ranges(epsmesh, tmp_path):
    found = json.loads(epsmesh("plan", "studies/sensitivity.toml", "--output", tmp_path, "--json").stdout)
    planned, export = found["forecasts"]
    assert planned["command"] == "sensitivity" and planned["least"] == 3
    assert export["command"] == "export"
    lines = epsmesh("plan", "studies/sensitivity.toml", "--output", tmp_path).stdout
    assert "sensitivity, forces of the scene: 3 solves" in lines
