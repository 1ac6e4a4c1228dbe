"""The register of the user's runs: which are alive, which were killed, and which cannot be known from here."""

import errno
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import Mock

import pytest

from epsmesh.cli.runs import lines_of
from epsmesh.files import state_folder
from epsmesh.plan.plan import make_plan
from epsmesh.run.progress import Progress
from epsmesh.run.registry import Registered, runs
from tests.cases import study
from tests.commands import ENVIRONMENT, ROOT

# A process with a run of one solve that does not end.
BEGIN = """
import sys, time
from pathlib import Path
from epsmesh.plan.plan import make_plan
from epsmesh.run.progress import Progress
from epsmesh.run.registry import Registered
from tests.cases import study
with Registered(Path(sys.argv[1]), make_plan(study()), Progress()) as registered:
    registered.note("the case")
    print("begun", flush=True)
    time.sleep(300)
"""


@pytest.fixture
def store(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    path = tmp_path / "shards" / "big.3-of-20.sqlite"
    path.parent.mkdir()
    path.touch()
    return path


@pytest.mark.parametrize("has_locks", [True, False])
def test_a_run_is_alive_until_it_is_killed_and_the_next_one_takes_its_place(store: Path, monkeypatch, has_locks: bool):
    if not has_locks:
        monkeypatch.setattr("fcntl.flock", Mock(side_effect=OSError(errno.ENOLCK, "No locks available")))
    environment = ENVIRONMENT | {"PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(state_folder().parent)}
    with subprocess.Popen(
        [sys.executable, "-c", BEGIN, str(store)], env=environment, cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stdout.readline() == "begun\n"
        (run,) = runs()
        assert (run.state, run.shard, run.pid, run.done, run.left) == ("running", "3/20", process.pid, 0, 1)
        process.send_signal(signal.SIGKILL)
    assert [run.state for run in runs()] == ["killed"]
    told = "\n".join(lines_of(runs()))
    assert "1 of 20 shards begun, 1 killed; solves done: 0 of 1" in told
    with Registered(store, make_plan(study()), Progress()) as registered:
        registered.done("the case", "too large")
    (run,) = runs()
    assert (run.state, run.done, run.failed, run.left) == ("ended", 1, 1, 0)
    with pytest.raises(KeyboardInterrupt), Registered(store, make_plan(study()), Progress()):
        raise KeyboardInterrupt
    assert [run.state for run in runs()] == ["interrupted"]
    store.unlink()
    assert runs() == []


@pytest.mark.parametrize(
    ("job", "age", "queue", "state"),
    [
        ("", 1.0, "", "running"),
        ("", 3600.0, "", "silent"),
        ("7", 3600.0, "exit 1", "silent"),
        ("7", 3600.0, "echo 6; echo 7", "running"),
        ("7", 1.0, "echo 6", "killed"),
    ],
)
def test_a_run_on_another_machine_is_judged_by_slurm_or_by_its_last_sign_of_life(
    store: Path, monkeypatch, tmp_path: Path, job: str, age: float, queue: str, state: str
):
    squeue = tmp_path / "squeue"
    squeue.write_text(f"#!/bin/sh\n{queue}\n")
    squeue.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    with Registered(store, make_plan(study()), Progress()):
        (path,) = (state_folder() / "runs").iterdir()
        content = json.loads(path.read_text())
    changes = {"machine": "elsewhere", "job_id": job, "seen": time.time() - age, "state": "running"}
    path.write_text(json.dumps(content | changes))
    assert [run.state for run in runs()] == [state]


def test_damaged_files_are_no_runs_and_a_folder_that_cannot_be_written_stops_none(store: Path, monkeypatch):
    folder = state_folder() / "runs"
    folder.mkdir(parents=True)
    for number, content in enumerate((b"", b"\0\xff", b"[1]", b'{"study": 3}')):
        (folder / f"{number}.json").write_bytes(content)
    assert runs() == []
    monkeypatch.setenv("XDG_STATE_HOME", "/proc/none")
    with Registered(store, make_plan(study()), Progress()) as registered:
        registered.done("the case")
    assert runs() == []
