"""What random scenes say of the constants of error bars: each error is a sample of the row of its bar."""

import math
from functools import partial

import pytest

from benchmarks.bars import Row
from benchmarks.refit import of_family, report, rows, samples, table, traced
from epsmesh import fitted

KNOWN = {
    "degree": 2, "element": "displacement", "is_graded": True, "is_fine": False, "has_others": False,
    "is_nonlinear": False, "is_ball": False, "plain": 0.0, "is_solved": False, "is_ended": False, "friction_bar": 0.0,
    "at_edge": 0.0,
}  # fmt: skip
THETA = 4 / 5


def scene(error, decrement=0.05, *, unseen=None, off=0.0, seed=0, more=None, **known):
    """Return a scene whose F is too large by a share ``error`` of itself, of which one degree more removes some."""
    solved = {
        "known": KNOWN | known, "is_on_meridian": False, "is_extrapolated": False, "motions": 1, "force": 2.0,
        "has_history": False, "decrement": decrement, "bar": 0.1, "unseen": unseen and [unseen], "calls": [],
    }  # fmt: skip
    results = {"force": [2.0, 0.2, 2.0 * (1 - error), 2.0 * off]}
    return Row(seed, "judged", raw={"solved": solved | (more or {}), "results": results})


def of(row):
    return {sample.entry: sample for sample in samples(row)}


@pytest.mark.parametrize(("known", "entry"), [
    ({}, "LIMITS displacement, 2"),
    ({"is_fine": True}, "LIMITS_FINE displacement, 2"),
    ({"is_graded": False}, "LIMITS_COARSE"),
    ({"has_others": True}, "LIMITS_ELSEWHERE displacement"),
    ({"plain": 0.3}, "LIMITS_PLAIN"),
    ({"is_nonlinear": True, "is_solved": True}, "LIMITS_SOLVED"),
])  # fmt: skip
def test_the_limit_of_f_is_found_in_units_of_what_one_degree_more_leaves(known, entry):
    """With F_exact = F_{p+1} - 0.4 θ s F_p, the sample is 0.4, of the row that an accuracy would have."""
    sample = of(scene(0.05 * (1 + 0.4 * THETA), **known))[entry]
    assert sample.value == pytest.approx(0.4)
    assert not sample.is_outside


def test_the_error_is_one_of_the_term_that_decides():
    left = of(scene(0.05 * (1 + 0.7 * THETA)))["LEFT displacement"]
    assert left.value == pytest.approx(0.7)
    mixed = {"element": "mixed", "unseen": 0.2}
    found = of(scene(0.05, 0.001, **mixed))
    assert found["UNSEEN"].value == pytest.approx(0.25)
    assert "LEFT mixed" not in found
    assert "APART 2" in found
    assert "LIMITS mixed, 2" not in found


def test_contact_has_the_bar_of_its_call():
    call = {"name": "found_bar", "args": [0.02, 0.0, 0.1]}
    more = {"calls": [call], "contact": {"area": 1.0, "bar": 0.1, "at_edge": 0.05}}
    found = of(scene(0.03, 0.02, is_ball=True, more=more))
    assert found["FOUND"].value == pytest.approx(1.5)
    assert found["FOUND_BALL displacement, 2"].value == pytest.approx(0.3)
    again = {"name": "found_again_bar", "args": [0.001, 0.2], "at_end": 0.0}
    assert of(scene(0.01, 0.02, more=more | {"calls": [again]}))["AT_EDGE"].value == pytest.approx(0.05)


def test_data_contradict_a_row_if_more_errors_are_outside_than_bars_allow():
    inside = [scene(0.05 * (1 + 0.4 * THETA), seed=seed) for seed in range(12)]
    lines = {line["row"]: line for line in table(inside)}
    assert lines["LIMITS displacement, 2"]["verdict"] == "wide"
    outside = [scene(0.05 * (1 + 0.9 * THETA), seed=seed) for seed in range(20, 24)]
    line = next(line for line in table([*inside, *outside]) if line["row"] == "LIMITS displacement, 2")
    assert (line["samples"], line["outside"], line["verdict"], line["worst seed"]) == (16, 4, "contradicted", 20)
    assert "Contradicted: LIMITS displacement, 2." in report([*inside, *outside])
    assert "too few" in {line["verdict"] for line in table(outside[:1])}


def test_a_truth_that_is_not_known_says_nothing():
    assert of(scene(0.05 * (1 + 0.9 * THETA), off=0.05)) == {}
    near = of(scene(0.05 * (1 + 0.7 * THETA), off=0.004))["LIMITS displacement, 2"]
    assert near.blur == pytest.approx(0.1)
    assert not near.is_outside
    assert math.isclose(near.value, 0.7)


def test_every_row_is_in_the_report():
    text = report([scene(0.05)])
    assert all(f"| {name}" in text for name in rows())
    assert fitted.LIMITS["displacement", 2] == (0.4, 0.25)


@pytest.mark.nightly
def test_a_scene_of_a_family_is_followed(tmp_path):
    row = traced(1, tmp_path, partial(of_family, "tools"), "tools")
    assert row.result == "judged"
    found = of(row)
    assert {"FOUND", "AREA"} <= found.keys() or {"FOUND_AGAIN", "AREA"} <= found.keys()
    assert not any(sample.is_outside for sample in found.values())
