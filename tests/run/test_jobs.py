"""`epsmesh run -j N`: the records of a run in one process, whatever becomes of the processes that compute them."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from epsmesh.run.reading import read_rows
from tests.commands import ENVIRONMENT, ROOT, command, run_script, spawn
from tests.compare import all_done, assert_same
from tests.studies import small_text

SMALL = small_text(material={"young": "10 kPa", "poisson": [0.3, 0.4]}, mesh={"outside": ["coarse", "free"]})
# How a case was computed, not what came out.
_HOW = {"memory", "load", "provenance"}
# The command, whose workers come to a bad end before the solve of a case: once, or at each attempt.
ENDING = """
import os, signal, sys
from pathlib import Path
from epsmesh.run import jobs
serve, mark, often = jobs._serve, Path(sys.argv.pop(1)), sys.argv.pop(1) == "often"
def fatal(workers, connection):
    from epsmesh.run.runner import StepRunner
    solve = StepRunner._solve
    def ending(runner, one, *arguments, **options):
        if "epsilon = 6 mm, outside = free" in one.label and "0.4" in one.label and (often or not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return solve(runner, one, *arguments, **options)
    StepRunner._solve = ending
    serve(workers, connection)
jobs._serve = fatal
from epsmesh.__main__ import main
main()
"""


def records(store: Path) -> dict[str, dict[str, str]]:
    """Return what the records of a store say of cases, as text, but for times and the place."""
    found = {}
    for key, text, _ in read_rows(store):
        content = json.loads(text)
        found[key] = {n: str(v) for n, v in content.items() if not (n.startswith("time") or n in _HOW)}
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the study, the folder of its results, and that of its meshes, run in one process."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "small.toml").write_text(SMALL)
    done = spawn("run", folder / "small.toml", "--output", folder, "--meshes", folder / "meshes", "-q")
    assert done.returncode == 0, done.stderr
    return folder / "small.toml", folder, ("--meshes", folder / "meshes", "-j", "2")


def test_records_are_those_of_one_process_bit_for_bit(whole, tmp_path):
    study, folder, options = whole
    done = spawn("run", study, "--output", tmp_path, *options)
    assert done.returncode == 0, done.stderr
    mine, theirs = records(tmp_path / "cases.sqlite"), records(folder / "cases.sqlite")
    assert mine == theirs
    assert len(mine) > 6
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".cases")]


def test_a_worker_that_ends_costs_no_case(whole, tmp_path):
    study, folder, options = whole
    done = run_script(ENDING, tmp_path / "mark", "once", "run", study, "--output", tmp_path, *options)
    assert (done.returncode, (tmp_path / "mark").exists()) == (0, True), done.stderr
    assert all_done(tmp_path / "small.nc")
    # The case that is tried again begins with another initial guess.
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)


@pytest.mark.nightly
def test_a_case_that_ends_each_worker_fails_alone(whole, tmp_path):
    study, folder, options = whole
    done = run_script(ENDING, tmp_path / "mark", "often", "run", study, "--output", tmp_path, *options)
    assert done.returncode == 1, done.stderr
    assert "1 failed (the process was killed while it computed this case" in done.stdout
    mine, theirs = records(tmp_path / "cases.sqlite"), records(folder / "cases.sqlite")
    (failed,) = [key for key, record in mine.items() if record["status"] == "failed"]
    assert {**mine, failed: {}} == {**theirs, failed: {}}
    again = spawn("run", study, "--output", tmp_path, *options)
    assert again.returncode == 0, again.stderr
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGKILL, marks=pytest.mark.nightly)])
def test_what_is_finished_when_the_run_is_ended_is_kept(whole, tmp_path, number):
    """By Ctrl-C, which a terminal sends to all processes, or by a signal that the first process cannot catch."""
    study, folder, options = whole
    words = command("run", study, "--output", tmp_path, "--verbose", *options)
    with subprocess.Popen(
        words, env=ENVIRONMENT, cwd=ROOT, text=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        while "[solve 3/" not in process.stderr.readline():
            assert process.poll() is None
        if number == signal.SIGINT:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        told = process.stderr.read()
        status = process.wait(timeout=60)
    assert status == (130 if number == signal.SIGINT else -number), told
    assert _is_gone(process.pid)
    again = spawn("run", study, "--output", tmp_path, *options)
    assert again.returncode == 0, again.stderr
    assert "from the store)" in again.stdout
    assert number == signal.SIGKILL or "tried again" not in again.stderr
    assert_same(tmp_path / "small.nc", folder / "small.nc", alike=False)


def _is_gone(group: int) -> bool:
    """Wait for the end of all processes of a group."""
    for _ in range(200):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def test_what_cannot_be_divided_is_refused(whole, tmp_path):
    study, _, _ = whole
    timed = tmp_path / "timed.toml"
    timed.write_text(SMALL + "[solve]\ntiming = true\n")
    done = spawn("run", timed, "-j", "2")
    assert (done.returncode, "run it without --jobs" in done.stderr) == (2, True)
    done = spawn("run", study, "-j", "2", "--output", tmp_path, ranks=2)
    assert (done.returncode, done.stderr.count("a launcher has started")) == (2, 1)


def test_a_dry_run_computes_nothing(whole, tmp_path):
    study, folder, _ = whole
    done = spawn("run", study, "-n", "-j", "2", "--output", tmp_path / "none", "--json")
    assert (done.returncode, json.loads(done.stdout)["ranks"]) == (0, 2), done.stderr
    assert json.loads(done.stdout)["solves"] == len(records(folder / "cases.sqlite"))
    assert not (tmp_path / "none").exists()
    assert "; nothing to do" in spawn("run", study, "-n", "--output", folder).stdout
    assert "; nothing to do" not in spawn("run", study, "-n", "--fresh", "--output", folder).stdout
    part = json.loads(spawn("run", study, "-n", "--shard", "1/2", "--output", tmp_path / "none", "--json").stdout)
    assert 0 < part["solves"] < len(records(folder / "cases.sqlite"))
