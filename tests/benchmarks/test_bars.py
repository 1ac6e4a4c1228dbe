"""Error bars on random scenes of every feature: they hold, on scenes that no earlier sources have seen."""

import hashlib
import json
import math

import pytest

from benchmarks import bars
from benchmarks.bars import HELD, Row, interval, report, scene, table, truths
from tests.physics import hashes
from tests.same.scenes import seconds, write_files

SAMPLE = 40


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
def test_bars_hold_on_scenes_that_are_drawn_anew_for_each_change_of_mesher_and_solver(folder):
    """Where sources differ, so does the sample: nothing could be fitted to it."""
    text = json.dumps(hashes(), sort_keys=True)
    first = 10**6 + int(hashlib.sha256(text.encode()).hexdigest()[:8], 16)
    rows = bars.run(range(first, first + SAMPLE))
    everything, *_ = table(rows)
    assert everything["scenes"] >= SAMPLE / 2
    _, high = interval(everything["held"], everything["scenes"])
    assert high >= HELD, report(rows)
