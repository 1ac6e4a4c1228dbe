"""A process that is ended from outside, or from below Python, costs the case that it was at, and no other."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray as xr
from mpi4py import MPI

from tests.commands import ENVIRONMENT, ROOT
from tests.studies import small_text

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts processes itself")

# Cases a to e; what comes of each is told by what stands in `ENDS`.
RUN = """
import os, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts the tests may have it ignored
from pipeline.run.guard import guarded
with guarded(print) as guard:
    for case in "abcde":
        if case in guard.kept or case in guard.lost:
            continue
        guard.begin([case])
        {ends}
        guard.keep(case)
        print("kept", case, flush=True)
print("lost", *sorted(guard.lost), flush=True)
sys.exit(3)
"""
# The command, with a solve in it that ends the process.
COMMAND = """
import os, sys
from pipeline.run import guard
end_with = guard._end_with
def forked(parent):
    end_with(parent)
    from pipeline.run.runner import StepRunner
    solve = StepRunner._solve
    def fatal(self, case, *rest):
        if "epsilon = 4 mm" in case.label:
            os.abort()
        return solve(self, case, *rest)
    StepRunner._solve = fatal
guard._end_with = forked
from pipeline.__main__ import main
main()
"""


def start(script: str, *arguments: object) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.Popen(
        command, cwd=ROOT, env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)}, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def test_each_process_that_is_ended_costs_one_case():
    ends = "if case in 'bd': os.kill(os.getpid(), 9 if case == 'b' else 11)"
    run = start(RUN.format(ends=ends))
    told, errors = run.communicate(timeout=60)
    assert (run.returncode, errors) == (3, "")
    lines = told.splitlines()
    assert [line for line in lines if line.startswith("kept")] == ["kept a", "kept c", "kept e"]
    assert lines[-1] == "lost b d"
    assert [line.split()[7].strip(":") for line in lines if "process" in line] == ["SIGKILL", "SIGSEGV"]


def test_a_process_that_ends_before_any_case_is_not_begun_again():
    run = start(RUN.format(ends="guard.keep(case); os._exit(59)"))
    told, _ = run.communicate(timeout=60)
    assert (run.returncode, told) == (59, "")


def test_a_run_whose_time_is_up_is_not_begun_again():
    run = start(RUN.format(ends="os.kill(os.getpid(), 24)"))
    told, _ = run.communicate(timeout=60)
    assert (run.returncode, told) == (128 + signal.SIGXCPU, "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_whoever_asks_the_process_that_waits_to_end_reaches_the_other(number):
    # Many short sleeps: Python may take a signal just before a long one begins, which is then slept to its end.
    run = start(RUN.format(ends="print('here', flush=True); [time.sleep(0.1) for _ in range(600)]"))
    assert run.stdout is not None
    assert run.stdout.readline() == "here\n"
    run.send_signal(number)
    assert run.wait(timeout=30) == 128 + number
    assert "begun" not in run.stdout.read()


def test_nothing_is_left_when_the_process_that_waits_is_killed():
    run = start(RUN.format(ends="print(os.getpid(), flush=True); time.sleep(60)"))
    assert run.stdout is not None
    child = psutil.Process(int(run.stdout.readline()))
    assert child.pid != run.pid
    run.kill()
    run.wait()
    for _ in range(500):
        with suppress(psutil.NoSuchProcess):
            if child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
                time.sleep(0.01)
                continue
        return
    pytest.fail("the child goes on")


def test_a_case_that_ends_its_process_fails_alone(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(small_text(mesh={"epsilon": ["4 mm", "6 mm", "full"], "degree": 1}, solve={"exact": False}))
    run = start(COMMAND, "run", file, "--output", tmp_path, "--meshes", tmp_path / "meshes")
    told, errors = run.communicate(timeout=300)
    assert run.returncode == 1, errors
    assert "2 ok, 1 failed (the process ended by SIGABRT while this case was computed" in told
    data = xr.load_dataset(tmp_path / "small.nc").squeeze()
    assert list(data["status"].values) == ["failed", "ok", "ok"]
    assert np.isfinite(data["force"].values).tolist() == [False, True, True]


def test_under_a_launcher_there_is_no_second_process(tmp_path: Path):
    script = "import os; from pipeline.run.guard import guarded\nwith guarded(print): print(os.getpid())"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT), "OMPI_COMM_WORLD_SIZE": "2"},
    )  # fmt: skip
    assert len(done.stdout.split()) == 1
    assert os.getpid() != int(done.stdout)
