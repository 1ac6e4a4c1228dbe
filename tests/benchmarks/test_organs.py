"""The benchmark of organs leaves no second out, and its scenes are studies."""

import pytest

from benchmarks.organs import PARTS, SCENES, parts_of, study_of
from epsmesh.plan.plan import make_plan
from epsmesh.study.read import parse


def test_parts_hold_all_seconds():
    stages = {
        "meshing / mesh cache / far surface / surface": 1.0, "meshing / mesh cache": 2.0, "meshing / surface": 4.0,
        "error bar / set-up": 8.0, "spaces, forms": 16.0, "solve / residuals": 32.0, "compiler": 64.0,
    }  # fmt: skip
    assert parts_of(stages) == dict.fromkeys(PARTS, 0.0) | {
        "far surface": 1.0, "mesh": 6.0, "assembly": 16.0, "iterations": 32.0, "error bar": 8.0, "rest": 64.0,
    }  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_each_place_is_solved(name):
    _, ratios, _, places = SCENES[name]
    plan = make_plan(parse(study_of(SCENES[name])))
    assert len(plan.solves) == len(ratios) * len(places)
    assert {" ".join(str(dict(solve.case.labels)["at"]).split()) for solve in plan.solves} == set(places.values())
