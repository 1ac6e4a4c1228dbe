"""Random scenes with extreme values: what counts as wrong, and that a seed is a scene."""

import pytest

from benchmarks import extremes
from benchmarks.bars import Row
from benchmarks.extremes import extreme, report, verdict
from tests.same.scenes import write_files


def row(result, error=0.5, truth=0.1):
    return Row(1, result, {"extreme": "depth, thin layer"}, 0.02, {"force": error}, {"force": truth})


@pytest.mark.parametrize(
    ("found", "known"),
    [
        (row("judged"), "right"),
        (row("judged", 1.05), "right"),  # within the bars of both
        (row("judged", 1.2), "wrong"),
        (row("refused: probe.depth: too deep"), "refused"),
        (row("failed: partial: tissue folds"), "failed in words"),
        (row("failed: failed: "), "wrong"),
        (row("failed: failed: an error of the program: KeyError"), "wrong"),
        (row("traceback: KeyError"), "wrong"),
        (row("its truth takes too long"), "not judged"),
        (row("took too long"), "not judged"),
    ],
)
def test_a_wrong_number_is_one_beyond_both_bars_and_silence_is_no_refusal(found, known):
    assert verdict(found) == known
    assert f"| thin layer | 1 | {int(known == 'right')} | {int(known == 'refused')} |" in report([found])
    assert ("Wrong:" in report([found])) == (known == "wrong")


@pytest.mark.nightly
def test_a_seed_is_a_scene_with_extremes_and_is_judged(tmp_path, capsys):
    write_files(tmp_path)
    found = [extreme(seed, tmp_path) for seed in range(20, 26)]
    assert found[0] == extreme(20, tmp_path)
    assert len({classes["extreme"] for _, classes in found}) > 2
    assert extremes.main(["--output", str(tmp_path), "--seeds", "20:23"]) == 0
    assert "3 scenes" in capsys.readouterr().out
