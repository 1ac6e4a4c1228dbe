"""The verdict of an accuracy with several contacts: scenes without an error are not good ones."""

from dataclasses import replace
from math import nan

from benchmarks.asked_contacts import FURTHER, KINDS, ORGAN, Trial, drawn, verdict

GOOD = Trial(1, "two jaws", "ball", "ok", 0.008, 0.002, 0.004, 9000, 2, 1.0, nan, "")
UNKNOWN = replace(GOOD, status="not judged", bar=nan, error=nan)


def test_scenes_without_an_error_are_not_good_ones():
    assert not verdict([GOOD] * 5 + [UNKNOWN] * 5)
    assert verdict([GOOD] * 4 + [UNKNOWN] * 5) == "only 4 of 9 scenes are judged"
    assert verdict([]) == "only 0 of 0 scenes are judged"


def test_what_is_not_judged_does_not_make_errors_rare():
    """One of ten errors is above its bar; with thirty scenes more it would be one of forty."""
    off = replace(GOOD, error=0.009)
    assert verdict([GOOD] * 9 + [off] + [UNKNOWN] * 10) == "1 of 10 errors are above their bars"
    assert not verdict([GOOD] * 39 + [off])


def test_a_bar_that_is_none_or_above_the_accuracy_is_not_good():
    assert verdict([replace(GOOD, bar=nan)]) == "1 of 1 errors are above their bars"
    assert "without a word" in verdict([replace(GOOD, bar=0.011)])
    assert not verdict([replace(GOOD, bar=0.011, status="inaccurate")])


def test_scenes_are_of_all_kinds():
    assert {drawn(seed)[0] for seed in range(7)} == set(KINDS)
    found = {kind: study for kind, _, study in (drawn(seed, further=True) for seed in range(len(FURTHER)))}
    assert tuple(found) == FURTHER
    assert found["two jaws with friction"]["probe"][0]["friction"] > 0
    assert found["support that lets go with friction"]["body"]["support"]["friction"] > 0
    assert found["loose layer with friction"]["body"]["layer"][0]["friction"] > 0
    assert found[ORGAN]["body"]["shape"] == "image"
