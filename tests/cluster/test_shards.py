"""Shards on the command line: run one by one and merged they give what one run gives, and what is missing is told."""

import contextlib
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from typer.testing import Result

from epsmesh.report.read import read_file
from epsmesh.run.reading import read_rows
from tests.commands import ENVIRONMENT, ROOT, epsmesh
from tests.compare import all_done, assert_same
from tests.studies import small_text

SMALL = small_text(
    material={"young": ["5 kPa", "10 kPa"], "poisson": [0.3, 0.4]},
    mesh={"growth": 0.8, "outside": ["coarse", "free"]},
    solve={"exact": False},
)


# The command, killed in its fourth solve.
KILLED = """
import os, signal
from epsmesh.run.runner import StepRunner
solve, count = StepRunner._solve, []
def fatal(*arguments):
    count.append(1)
    if len(count) == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return solve(*arguments)
StepRunner._solve = fatal
from epsmesh.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    return tmp_path_factory.mktemp("meshes")


def run(study: Path, output: Path, meshes: Path, *options: object) -> Result:
    return epsmesh("run", study, "--output", output, "--meshes", meshes, *options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory, meshes):
    """Return the study and the folder of its results, run in one go."""
    folder = tmp_path_factory.mktemp("whole")
    study = folder / "small.toml"
    study.write_text(SMALL)
    assert run(study, folder, meshes, "--quiet").exit_code == 0
    return study, folder


def test_a_lost_shard_is_told_and_completed(whole, meshes, tmp_path):
    study, folder = whole
    for number in (1, 3):
        done = run(study, tmp_path, meshes, "--shard", f"{number}/3")
        assert done.exit_code == 0, done.output
        assert f"shard {number}/3" in done.stdout
        assert "merge them: `epsmesh run" in done.stdout
    assert not (tmp_path / "small.nc").exists()
    for _ in range(2):
        assert run(study, tmp_path, meshes).exit_code == 0
        assert all_done(tmp_path / "small.nc")
        assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)
    # What is merged is not computed again, by no other deal.
    again = run(study, tmp_path, meshes, "--shard", "1/2")
    assert "to do" not in again.stdout
    assert "stored" in again.stdout


def shards_of(study: Path, output: Path) -> list[dict[str, Any]]:
    """Return the shards of a study with this output that `status` shows from a folder with no store."""
    with TemporaryDirectory() as folder, contextlib.chdir(folder):
        told = json.loads(epsmesh("status", "--json").stdout)
    return [run for run in told["runs"] if run["study"] == str(study) and Path(run["store"]).is_relative_to(output)]


def test_a_shard_that_was_killed_goes_on_to_the_same_dataset(whole, meshes, tmp_path):
    """Killed in the middle of the cases of a mesh, which begin with each other's solutions: later ones with others."""
    study, folder = whole
    options = ("--output", tmp_path, "--meshes", meshes)
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, "run", study, "--shard", "1/2", *options],
        env=ENVIRONMENT, cwd=ROOT, check=False, capture_output=True, text=True,
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    (begun,) = shards_of(study, tmp_path)
    assert (begun["shard"], begun["state"], begun["left"] > 0) == ("1/2", "killed", True)
    assert len(read_rows(tmp_path / "shards" / "small.1-of-2.sqlite")) > 0
    again = run(study, tmp_path, meshes, "--shard", "1/2")
    assert again.exit_code == 0, again.output
    assert "will be solved after the others" in again.stderr
    (ended,) = shards_of(study, tmp_path)
    assert (ended["shard"], ended["state"], ended["left"]) == ("1/2", "ended", 0)
    assert run(study, tmp_path, meshes, "--shard", "2/2").exit_code == 0
    assert "to do" not in run(study, tmp_path, meshes).stdout
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)


def test_more_shards_than_steps_and_a_run_of_the_whole_that_takes_them_in(whole, meshes, tmp_path):
    study, folder = whole
    outputs = [run(study, tmp_path, meshes, "--shard", f"{number}/12").stdout for number in range(1, 13)]
    assert sum("nothing to do" in output for output in outputs) >= 3
    told = epsmesh("status", study, "--output", tmp_path).stdout
    assert "12 shards in" in told and f"`epsmesh run {study}` with the same --output merges them" in told
    whole_run = run(study, tmp_path, meshes)
    assert (whole_run.exit_code, "to do" in whole_run.stdout) == (0, False), whole_run.output
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)
    assert "12 shards" not in epsmesh("status", study, "--output", tmp_path).stdout


def test_early_stop_in_shards(whole, meshes, tmp_path):
    """Which cases are skipped is decided within a shard, and told in the merged dataset."""
    study = tmp_path / "small.toml"
    study.write_text(SMALL.replace("exact = false", '[plan]\nstop_near_exact = "40 %"'))
    outputs = [run(study, tmp_path, meshes, "--shard", f"{number}/2") for number in (1, 2)]
    assert [output.exit_code for output in outputs] == [0, 0]
    assert "16 ok, 8 skipped" in (merged := run(study, tmp_path, meshes).stdout) and "16 from the store" in merged
    assert run(study, tmp_path / "whole", meshes).exit_code == 0
    assert_same(tmp_path / "small.nc", tmp_path / "whole" / "small.nc", alike=False)
    assert "skipped" in np.unique(read_file(tmp_path / "small.nc")["status"])


def test_damaged_and_failed(whole, meshes, tmp_path):
    study, folder = whole
    shards = tmp_path / "shards"
    shards.mkdir()
    shutil.copy(folder / "cases.sqlite", shards / "small.1-of-2.sqlite")
    damaged = shards / "small.2-of-2.sqlite"
    damaged.write_bytes(b"no database at all" * 99)
    found = run(study, tmp_path, meshes)
    assert (found.exit_code, "to do" in found.stdout) == (0, False)
    assert f"{damaged}: damaged, left out" in found.stderr
    assert damaged.read_bytes().startswith(b"no database")
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)
    # Elements that fit into no machine: their cases fail, in the shard and in what is merged.
    study = tmp_path / "failing.toml"
    study.write_text(SMALL.replace('["coarse", "free"]', '"coarse"').replace('"0.5 mm"', '["1e-9 mm", "0.5 mm"]'))
    assert 1 in {run(study, tmp_path, meshes, "--shard", f"{number}/2").exit_code for number in (1, 2)}
    merged = run(study, tmp_path, meshes)
    assert merged.exit_code == 1
    assert "GB of memory" in merged.output
    assert "pending" not in merged.output


def test_wrong_input(whole, tmp_path):
    study, _ = whole
    for text in ("0/3", "4/3", "three", "3"):
        wrong = epsmesh("run", study, "--output", tmp_path, "--shard", text)
        assert wrong.exit_code == 2
        assert f"--shard: {text!r} is no shard; give i/n" in wrong.output
    timed = tmp_path / "timed.toml"
    timed.write_text(SMALL.replace("exact = false", "timing = true"))
    wrong = epsmesh("run", timed, "--output", tmp_path, "--shard", "1/2")
    assert wrong.exit_code == 2
    assert "one machine" in wrong.output
    assert {path.name for path in tmp_path.iterdir()} == {"timed.toml"}
