"""Times of a loaded machine, repeats that differ, and speed-ups below one are told of, not sold as speed."""

import numpy as np
import pytest

from epsmesh.report.figures import figure
from epsmesh.report.guide import guide
from epsmesh.report.page.facts import facts
from epsmesh.report.times import doubts
from tests.report.synthetic import EPSILONS, dataset


@pytest.fixture
def timed():
    """A study whose times nothing speaks against."""
    found = dataset(mesh={"epsilon": EPSILONS, "outside": ["coarse", "free"]}, solve={"exact": True})
    found["machine_load"] = found["time_total"] * 0 + 0.6
    found["time_spread"] = found["time_total"] * 0 + 0.01
    return found


def test_times_of_an_idle_machine_need_no_words(timed):
    assert doubts(timed) == []
    assert doubts(timed.drop_vars(["machine_load", "time_spread"])) == []  # of an earlier version


def test_a_loaded_machine_is_told_of(timed):
    timed["machine_load"][0, 0] = 3.2
    (told,) = doubts(timed)
    assert f"1 of {timed['force'].size} times were taken on a loaded machine (up to 3.2 processes a core)" in told
    timed["machine_load"][:] = 2.0
    assert doubts(timed)[0].startswith("all times were taken on a loaded machine")
    found = guide(timed, accuracy="50 %")
    assert "times are doubtful" in str(found)
    assert "All times were taken on a loaded machine" in found.text(verbose=True)
    assert ("speed-ups", doubts(timed)[0]) in facts(timed)
    for kind in ("ratio", "error"):
        assert "loaded machine" in figure(timed, kind).get_label()
    assert "loaded" not in figure(timed, "force").get_label()


def test_repeats_that_are_far_apart_are_told_of(timed):
    timed["time_spread"][0, 0] = 0.43
    assert doubts(timed) == ["repeats of a case are up to 43 % apart"]


def test_how_far_repeats_are_apart_is_drawn(timed):
    """A case's bar holds its repeats and the full order's, which has none: it is what the others are measured by."""
    timed["time_spread"][:] = 0.2
    timed["time_spread"].loc[{"epsilon": np.inf}] = 0.1
    speed = timed["speedup"].sel(epsilon=4e-3, outside="free").item()
    drawn = figure(timed, "ratio")
    bars = [line.get_segments() for ax in drawn.axes for line in ax.collections]
    spans = np.array([segment[:, 1] for segments in bars for segment in segments])
    assert len(spans) == 2 * (timed.sizes["epsilon"] - 1)
    assert np.isclose(spans, [speed / (1.1 * 1.05), speed * 1.1 * 1.05]).all(axis=1).any()
    for kind in ("ratio", "error"):
        assert "how far repeats are apart" in figure(timed, kind).get_label()
    once = timed.drop_vars("time_spread")
    assert not [line for ax in figure(once, "ratio").axes for line in ax.collections]


def test_fewer_unknowns_that_were_slower_are_named(timed):
    timed["dofs"] = timed["dofs"].where(np.isinf(timed["epsilon"]), 900)
    assert doubts(timed) == []
    timed["speedup"].loc[{"epsilon": 4e-3, "outside": "free"}] = 0.7
    assert doubts(timed)[0].endswith("the full order: 1 case, ε = 4 mm, outside free, 0.7 ×")
    timed["speedup"].loc[{"epsilon": 5e-3, "outside": "free"}] = 0.9
    (told,) = doubts(timed)
    assert told == "fewer unknowns were slower than the full order: 2 cases, most of all ε = 4 mm, outside free, 0.7 ×"
