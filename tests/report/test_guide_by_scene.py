"""What the guide answers by depth and law, and of datasets without F_exact."""

import json
from math import inf

import pytest

from epsmesh.cli.console import plain
from epsmesh.report.guide import guide
from tests.report.chosen import TEXT, dataset

BALL = """
title = "deep"
[body]
shape = "box"
size = ["60 mm", "60 mm", "20 mm"]
[material]
young = "10 kPa"
poisson = 0.4
law = ["neo-hookean", "yeoh"]
c2 = 0.4
[probe]
shape = "sphere"
radius = "4 mm"
depth = ["0.4 mm", "1 mm", "3.6 mm"]
[mesh]
outside = ["coarse", "free"]
epsilon = ["6 mm", "10 mm", "full"]
fine = "2 mm"
coarse = "8 mm"
[solve]
exact = false
"""


def off(case):
    """F/F_max: of `free` it falls with the depth, and faster with yeoh's law; of `coarse` it is 1."""
    if case.is_full or case.mesh.outside == "coarse":
        return 1.0
    sinks = case.probe.depth * (2 if case.material.law == "yeoh" else 1)
    return 1 - 0.09 * sinks / case.mesh.epsilon


@pytest.fixture(scope="module")
def deep():
    return dataset(BALL, ratio=off)


def test_without_exact_forces_f_is_compared_with_that_of_the_full_order(deep):
    found = guide(deep, "2%")
    assert found.reference == "F_max"
    assert found.answer.labels == {"outside": "coarse", "epsilon": 6e-3}
    assert found.answer.error == pytest.approx(0)
    worst = next(v for v in found.verdicts if v.labels == {"outside": "free", "epsilon": 6e-3})
    assert worst.error == pytest.approx(0.09 * 7.2 / 6)
    text = str(found)
    assert "F is within 0 % of F_max in all 6 scenes, without the elements' error, which F_max shares" in text
    assert "±" not in text
    assert "F_exact" not in found.text(verbose=True)
    assert "of F_max" in str(guide(deep.sel(outside=["free"], epsilon=[6e-3, 10e-3, inf]), "1e-9"))


def test_each_depth_and_law_has_its_answer(deep):
    found = guide(deep, "2%")
    smallest = {(part.where["depth"], part.where["law"]): part.key for part in found.parts}
    assert smallest == {
        ((0.4e-3,), ("neo-hookean", "yeoh")): (6e-3, 6e-3),
        ((1e-3,), ("neo-hookean",)): (6e-3, 6e-3),
        ((1e-3,), ("yeoh",)): (6e-3, 10e-3),
        ((3.6e-3,), ("neo-hookean", "yeoh")): (6e-3, inf),
    }
    lines = str(found).splitlines()
    start = lines.index("Smallest ε for F within 2 % of F_max:")
    head, *rows = [line.split() for line in lines[start + 1 :]]
    assert head == ["d", "law", "coarse", "free"]
    assert rows[1] == ["1", "mm", "neo-hookean", "6", "mm", "6", "mm"]
    assert " ".join(rows[3]) == "3.6 mm all 6 mm none: 0.94 to 0.97 F_max at 10 mm"


def test_what_is_the_same_everywhere_is_said_once(deep):
    found = guide(deep.sel(outside=["coarse"]), "2%")
    assert len(found.parts) == 1
    assert "Smallest ε" not in str(found)
    assert not guide(deep, budget="1 s").parts


def test_one_outside_and_one_parameter(deep):
    found = guide(deep.sel(outside="free", law="neo-hookean"), "2%")
    assert [part.where for part in found.parts] == [{"depth": (0.4e-3, 1e-3)}, {"depth": (3.6e-3,)}]
    assert str(found).splitlines()[-2].split() == ["0.4", "mm", "to", "1", "mm", "6", "mm"]


def test_json_has_the_answers_by_depth(deep):
    content = json.loads(json.dumps(plain(guide(deep, "2%").to_dict()), allow_nan=False))
    last = content["by_scene"][-1]
    assert content["reference"] == "F_max"
    assert last["depth"] == [3.6e-3]
    assert last["epsilon"]["coarse"] == 6e-3
    assert last["widest"]["free"]["ratio_min"] == pytest.approx(1 - 0.0648)


def test_a_study_of_depths_that_has_the_same_answer_says_nothing_more():
    text = TEXT.replace('depth = "0.1 mm"', 'depth = "0.2 mm"').replace('"0.2 mm"', '["0.1 mm", "0.2 mm"]')
    assert len(guide(dataset(text), "5%").parts) == 1
