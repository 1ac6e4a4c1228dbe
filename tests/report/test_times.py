"""Times of a loaded machine, repeats that differ, and speed-ups below one are told of, not sold as speed."""

import numpy as np
import pytest

from pipeline.report.figures import figure
from pipeline.report.guide import guide
from pipeline.report.page.facts import facts
from pipeline.report.times import doubts
from tests.report.synthetic import EPSILONS, dataset


@pytest.fixture
def timed():
    """A study whose times nothing speaks against."""
    found = dataset(mesh={"epsilon": EPSILONS, "outside": ["coarse", "free"]}, solve={"exact": True})
    found["load"] = found["time_total"] * 0 + 0.6
    found["time_spread"] = found["time_total"] * 0 + 0.01
    return found


def test_times_of_an_idle_machine_need_no_words(timed):
    assert doubts(timed) == []
    assert doubts(timed.drop_vars(["load", "time_spread"])) == []  # of an earlier version


def test_a_loaded_machine_is_told_of(timed):
    timed["load"][0, 0] = 3.2
    (told,) = doubts(timed)
    assert f"1 of {timed['force'].size} times were taken on a loaded machine (up to 3.2 processes a core)" in told
    timed["load"][:] = 2.0
    assert doubts(timed)[0].startswith("all times were taken on a loaded machine")
    assert f"times        {doubts(timed)[0]}" in str(guide(timed, accuracy="50 %"))
    assert ("speed-ups", doubts(timed)[0]) in facts(timed)
    for kind in ("speedup", "epsilon", "accuracy"):
        words = " ".join(text.get_text() for text in figure(timed, kind).texts)
        assert "loaded machine" in words.replace("\n", " ")
    assert not any("loaded" in text.get_text() for text in figure(timed, "ratio").texts)


def test_repeats_that_are_far_apart_are_told_of(timed):
    timed["time_spread"][0, 0] = 0.43
    assert doubts(timed) == ["repeats of a case are up to 43 % apart"]


def test_fewer_unknowns_that_were_slower_are_named(timed):
    timed["dofs"] = timed["dofs"].where(np.isinf(timed["epsilon"]), 900)
    assert doubts(timed) == []
    timed["speedup"].loc[{"epsilon": 3e-3, "outside": "free"}] = 0.7
    timed["speedup"].loc[{"epsilon": 5e-3, "outside": "free"}] = 0.9
    (told,) = doubts(timed)
    assert told == "fewer unknowns were slower than the full order: 2 cases, most of all ε = 3 mm, outside free, 0.7 ×"
