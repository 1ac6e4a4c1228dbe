"""Do error bars hold on random scenes: they do, and what says so is not to be fooled."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks import coverage
from benchmarks.coverage import Coverage, Trial, trials
from benchmarks.families import FAMILIES
from epsmesh.study.read import parse


def test_error_bars_of_random_scenes_hold():
    found = Coverage(tuple(trials(MPI.COMM_SELF, count=3, seed=3)))
    assert len(found.trials) == 3
    assert all(trial.truth_bar < 0.3 * trial.bar for trial in found.trials)
    assert found.is_met


@pytest.mark.nightly
def test_error_bars_of_other_proportions_hold():
    found = Coverage(tuple(trials(MPI.COMM_SELF, 12, 3, "proportions")))
    assert len(found.trials) == 12
    assert all(trial.truth_bar < 1e-4 for trial in found.trials)
    assert len(found.groups) >= 6
    assert found.is_met


@pytest.mark.parametrize("family", FAMILIES)
def test_same_seed_same_scenes(family):
    first, again, other = (FAMILIES[family].throw(np.random.default_rng(seed)) for seed in (7, 7, 8))
    assert first == again != other


def test_coverage_asks_for_bars_that_hold_and_are_not_idle():
    def coverage(bar):
        return Coverage(tuple(Trial("", 1.0, bar, 0.99, 0.0) for _ in range(20)))

    assert coverage(0.02).is_met
    assert not coverage(0.005).is_met
    assert not coverage(0.2).is_met


def test_every_large_group_must_hold():
    """A kind of element whose bars miss is not outvoted by the others; one that is refused misses nothing."""

    def trial(kind, bar, count, refused=False):
        return (Trial("", 1.0, bar, 0.99, 0.0, "", kind, "naive", refused),) * count

    good = trial((2, "displacement"), 0.015, 900)
    assert Coverage(good + trial((1, "displacement"), 0.015, 40)).is_met
    assert not Coverage(good + trial((1, "displacement"), 0.005, 40)).is_met
    assert not Coverage(good + trial((1, "displacement"), 0.05, 40)).is_met
    assert Coverage(good + trial((1, "displacement"), 0.005, 39)).is_met
    assert Coverage(good + trial((1, "displacement"), 0.005, 40, refused=True)).is_met
    table = str(Coverage(good + trial((1, "displacement"), 0.005, 40)))
    assert "| degree 1 displacement | 40 | 40 | 0 | 0.0% |" in table
    assert "NOT MET" in table


def test_error_is_the_larger_of_both_readings():
    """Relative to the truth where F is too large, to F where it is too small."""
    for force, truth in ((1.5, 1.0), (1.0, 1.5)):
        assert Trial("", force, 0.5, truth, 0.0).error == pytest.approx(0.5)


def test_unknown_family_is_named(capsys):
    with pytest.raises(SystemExit) as ended:
        coverage.main(["--family", "square"])
    assert ended.value.code == 2
    assert "proportions" in capsys.readouterr().err


def test_coverage_is_told_in_words_and_as_data(capsys, monkeypatch):
    monkeypatch.setattr(coverage, "trials", lambda *_: iter([Trial("a disc", 1.0, 0.1, 1.05, 0.0)]))
    for words in ([], ["--json"]):
        coverage.main(words)
    told = capsys.readouterr().out
    assert "a disc" in told
    assert json.loads(told[told.index("\n{") :])["trials"][0]["name"] == "a disc"


@pytest.mark.parametrize("seed", [1, 4])
def test_scenes_thrown_of_several_materials_make_sense(seed):
    scene, mesh = FAMILIES["regions"].throw(np.random.default_rng(seed))
    found = parse({**scene, "mesh": mesh, "solve": {"exact": False}}).case(())
    assert found.body.regions
    assert found.mesh.degree > 1 or found.poisson < 0.45
