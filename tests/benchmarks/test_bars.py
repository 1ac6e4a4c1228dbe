"""Error bars on random scenes of every feature: they hold, on scenes that no earlier sources have seen."""

import hashlib
import json
import math

import numpy as np
import pytest

from benchmarks import bars
from benchmarks.bars import HELD, Row, compared, interval, report, table
from benchmarks.drawn import has_two_contacts, more_steps, scene, truths
from epsmesh.solve.contact import large, pull
from tests.pairs import BASE
from tests.physics import hashes
from tests.same.outcome import Outcome, Value
from tests.same.scenes import seconds, write_files

SAMPLE = 40
CONTACTS = ("grasp", "pull", "support that lets go")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("bars")
    write_files(path)
    return path


def row(error, seed=0, **classes):
    return Row(seed, "judged", {"law": "gent", **classes}, 0.02, {"force": error}, {"force": 0.1})


@pytest.mark.nightly
def test_a_seed_is_a_scene_and_has_a_finer_one(folder):
    assert scene(3, folder) == scene(3, folder) != scene(4, folder)
    for seed in range(3, 7):
        study, classes = scene(seed, folder)
        assert math.isfinite(seconds(study, folder)) and {"mesh", "order", "element"} <= classes.keys()
        assert any(math.isfinite(seconds(finer, folder)) for finer in truths(study, 0.02))


@pytest.mark.nightly
def test_scenes_of_some_features_have_one_of_them_and_differ_in_more_than_that(folder):
    drawn = [scene(seed, folder, CONTACTS) for seed in range(3, 15)]
    assert scene(3, folder, CONTACTS) == drawn[0]
    for study, classes in drawn:
        assert has_two_contacts(study)
        assert classes.get("grasp", classes.get("support")) in CONTACTS
        assert any(math.isfinite(seconds(finer, folder)) for finer in truths(study, 0.02))
    assert {classes["friction"] for _, classes in drawn} == {"none", "some", "stick"}
    assert {"equal", "different"} <= {classes.get("jaws") for _, classes in drawn}


def test_the_truth_of_two_contacts_is_followed_in_more_steps():
    def steps():
        return large.LargeContact.STEPS, pull.PullPaths.STEPS

    usual = steps()
    with more_steps(BASE):
        assert steps() == usual
    with more_steps(BASE | {"probe": [BASE["probe"] | {"together": "grasp"}, {"together": "grasp"}]}):
        assert steps() == tuple(2 * count for count in usual)
    assert steps() == usual


def test_a_force_that_is_given_is_no_result():
    def outcome(depth):
        values = {"force": 1.0, "closed_force": 1.0, "pull_force": depth, "depth": depth}
        return Outcome("taken", "", {name: Value(np.array(one), "", np.array(0.1)) for name, one in values.items()})

    errors, _ = compared(outcome(1.0), outcome(1.05))
    assert errors == pytest.approx({"pull_force": 0.5, "depth": 0.5})


def test_a_class_is_not_outvoted_by_the_others():
    rows = [*(row(0.5, law="linear") for _ in range(900)), *(row(1.5, law="gent") for _ in range(40))]
    lines = {line["class"]: line for line in table(rows)}
    assert lines["law: gent"]["held"] == 0 and lines["law: linear"]["share"] == 1
    assert lines["all"]["held"] == 900 and lines["all"]["worst"] == 1.5
    assert "law: gent" in report(rows).split("\n\n")[0]


def test_an_unknown_truth_is_not_counted():
    unknown = Row(1, "its truth takes too long", {"law": "gent"})
    assert table([unknown]) == []
    assert "1 (its truth takes too long)" in report([unknown, row(0.5)])


@pytest.mark.nightly
def test_a_scene_is_judged_and_a_campaign_goes_on(tmp_path, capsys):
    words = ["--output", str(tmp_path), "--seeds"]
    assert bars.main([*words, "7:8"]) == 0
    (line,) = (tmp_path / "bars-calibration.jsonl").read_text().splitlines()
    assert 0 < json.loads(line)["errors"]["force"] < 1
    log = tmp_path / "bars-calibration.jsonl"
    log.write_text(line.replace('"seed": 7', '"seed": 8') + "\n")
    assert bars.main([*words, "8:9"]) == 0
    assert len(log.read_text().splitlines()) == 1
    assert "| all | 1 | 1 |" in capsys.readouterr().out


@pytest.mark.nightly
def test_a_campaign_of_some_features_has_a_log_of_its_own(tmp_path):
    words = ["--output", str(tmp_path), "--seeds", "7:8", "--only", "support that lets go"]
    assert bars.main(words) in (0, 1)
    (log,) = tmp_path.glob("*.jsonl")
    assert log.name == "bars-support_that_lets_go-calibration.jsonl"
    assert json.loads(log.read_text())["classes"]["support"] == "support that lets go"


@pytest.mark.nightly
def test_bars_hold_on_scenes_that_are_drawn_anew_for_each_change_of_mesher_and_solver(folder):
    """Where sources differ, so does the sample: nothing could be fitted to it."""
    text = json.dumps(hashes(), sort_keys=True)
    first = 10**6 + int(hashlib.sha256(text.encode()).hexdigest()[:8], 16)
    rows = bars.run(range(first, first + SAMPLE))
    everything, *_ = table(rows)
    assert everything["scenes"] >= SAMPLE / 2
    _, high = interval(everything["held"], everything["scenes"])
    assert high >= HELD, report(rows)
