"""A seeded sample of scenes, each with changes that may not matter; `make same` runs many."""

import numpy as np
import pytest

from tests.same.campaign import Row, report, run_scene
from tests.same.files import write_files
from tests.same.judge import judge
from tests.same.outcome import Outcome, Value
from tests.same.quantities import in_other_units, number_of, scaled
from tests.same.scenes import draw

# Of the scenes, those that run by day: an inclusion with a history, a ball beside the axis, an ellipse.
_BY_DAY = (6, 19, 22)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies")
    write_files(path)
    return path


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=() if seed in _BY_DAY else pytest.mark.nightly) for seed in range(40)]
)
def test_what_may_not_matter_does_not(seed, folder):
    rows = run_scene(seed, folder)
    assert not [row for row in rows if row.result == "differs"]
    assert any(row.result == "same" for row in rows) or seed not in _BY_DAY


def test_a_seed_gives_the_same_scene(folder):
    assert draw(3, folder) == draw(3, folder)
    assert draw(3, folder) != draw(4, folder)


def _outcome(force, bar, cells=10):
    return Outcome("taken", "", {"force": Value(np.array([force]), "N", np.array([bar]))}, cells, cells)


@pytest.mark.parametrize(
    ("second", "one_mesh", "agrees"),
    [
        (_outcome(1.00001, 0.01), True, True),
        (_outcome(1.001, 0.01), True, False),
        (_outcome(1.0, 0.02), True, False),  # another error bar
        (_outcome(1.015, 0.01), False, True),
        (_outcome(1.03, 0.01), False, False),
        (_outcome(1.015, 0.01, cells=11), True, True),  # the mesher drew another mesh
        (_outcome(float("nan"), 0.01), True, False),
        (Outcome("failed", "why"), True, False),
    ],
)
def test_results_agree_within_the_solver_or_the_bars(second, one_mesh, agrees):
    assert judge(_outcome(1.0, 0.01), second, one_mesh=one_mesh).agrees == agrees


def test_quantities_are_the_same_in_other_units_and_scaled():
    import random

    study = {"body": {"size": ["40 mm", "2 cm"]}, "material": {"young": "10 kPa", "density": "1000 kg/m^3"}}
    other = in_other_units(study, random.Random(1))
    assert other != study
    assert [*map(number_of, other["body"]["size"])] == pytest.approx([0.04, 0.02])
    larger = scaled(study, 2.0, 3.0)
    assert number_of(larger["material"]["young"]) == pytest.approx(3e4)
    assert number_of(larger["material"]["density"]) == pytest.approx(1500.0)


def test_the_report_counts_pairs_by_change_and_feature():
    rows = [
        Row(1, ("blade", "gravity"), "units", "same", times=0.1),
        Row(2, ("blade",), "units", "differs", "force: 1 and 2", 9.0),
        Row(2, ("blade",), "mirror image", "refused", "why"),
    ]
    text = report(rows)
    assert "1 of 2 pairs" in text
    assert "| blade | 1 of 2 |" in text and "| gravity | 1 of 1 |" in text
    assert "force: 1 and 2" in text
