"""Where F is decided, on random scenes: all are studies, and the derivatives are those of differences."""

import pytest

from benchmarks.influence import row_of, scenes
from epsmesh.study.read import parse


def test_every_scene_is_a_study_and_a_seed_has_its_own():
    found = [*scenes()]
    assert all(parse(scene.raw(size)).shape == () for scene in found for size in (1.0, 0.5))
    assert {scene.degree for scene in found} == {2, 3}
    assert found != [*scenes(1)] and found == [*scenes()]


@pytest.mark.nightly
def test_shares_are_differences_and_bars_hold():
    row, changes = row_of(next(scenes()))
    assert row["off differences"] < 1e-5 and row["ν off differences"] < 1e-4
    assert all(values.max() < 1 for values in changes.values())
