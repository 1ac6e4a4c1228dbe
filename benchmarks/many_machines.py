"""A study of 10,000 cases dealt to 20 Slurm jobs: three jobs are killed, and one of the two nodes is drained.

    python -m benchmarks.many_machines [--cases 10000] [--jobs 20] [--seed 1]

It needs root, and installs and starts the Slurm of the tests: two virtual nodes of two processors each, on the cores of
this machine. First one undisturbed process runs the study. Then the jobs run. At random moments a random running job is
killed, in one of three ways: its program; all processes of its step; its script, too, so that it is not restarted. Half
way a node is drained. The merge job completes the study.

The exit status is 1 if the dataset is not whole, or differs from that of the single process by one bit. Efficiency is
the processor time of the single process over that of all jobs.
"""

import os
import random
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

from benchmarks.machine import MPI_ENVIRONMENT
from benchmarks.scenes import many_small
from benchmarks.tables import markdown, options, write
from epsmesh.run.registry import RUNNING, runs
from epsmesh.study.toml import to_toml
from tests.cluster.slurm import HERE, JOBS, ROOT, Cluster, started
from tests.compare import all_done, assert_same_bits

CASES, MACHINES, ON_A_MESH = 10_000, 20, 20
# 2,400 quadratic elements: a job computes several times as long as it takes to start, and all of them ten minutes.
MESH = {"degree": 2, "fine": "3 mm", "coarse": "3 mm"}
# Ways to kill a job, and the name of each in the output.
PROGRAM, STEP, SCRIPT = "program", "step", "script"
WAYS = (PROGRAM, STEP, SCRIPT)
# Kills happen between these shares of the work; the node is drained after this share.
_FIRST, _LAST, _DRAIN = 0.05, 0.75, 0.5
# Seconds between two looks at the register, and between two lines of output.
_LOOK, _TELL = 0.2, 20.0
# Seconds after which the campaign is given up.
_PATIENCE = 1200.0
# The command of a job: it notes the processor time of the program, also of one that was killed.
COMMAND = """#!/bin/bash
{python} -m epsmesh "$@"
status=$?
times >"{folder}/$SLURM_JOB_ID-$SLURM_RESTART_COUNT-$$"
exit $status
"""


@dataclass(frozen=True)
class Used:
    """What a process and its children used: elapsed and processor time (s), and peak memory (bytes)."""

    elapsed: float
    processor: float
    memory: float


@dataclass
class Campaign:
    """The jobs of a study in ``folder``, and what was done to them."""

    cluster: Cluster
    folder: Path
    cases: int
    dice: random.Random
    lost: float = 0.0  # processor seconds of programs whose notes were lost
    killed: list[str] = field(default_factory=list)
    starts: int = 0

    def kill(self, way: str) -> bool:
        """Kill a random running job; return whether there was one."""
        alive = [run for run in runs() if run.state == RUNNING and run.shard and run.done < run.total]
        if not alive:
            return False
        run = self.dice.choice(alive)
        with suppress(psutil.NoSuchProcess):
            process = psutil.Process(run.pid)
            used = process.cpu_times()
            if way == PROGRAM:
                process.kill()
            else:
                self.lost += used.user + used.system
                full = ["--full"] if way == SCRIPT else []
                self.cluster.call("scancel", "--signal=KILL", *full, run.job)
            self.killed.append(f"{way} of shard {run.shard} ({run.done} of {run.total} done)")
            print(f"killed: {self.killed[-1]}", flush=True)
            return True
        return False

    def drain(self) -> None:
        """Let the second node take no further jobs."""
        self.cluster.call("scontrol", "update", "NodeName=n2", "State=DRAIN", "Reason=test")
        print("drained: n2", flush=True)

    def processor(self) -> float:
        """Return the processor seconds of all programs so far."""
        notes = [path.read_text().splitlines()[-1].split() for path in (self.folder / "times").iterdir()]
        self.starts = len(notes)
        return self.lost + sum(_seconds(text) for note in notes for text in note)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run; return the exit status."""
    parser = options(__doc__)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--jobs", type=int, default=MACHINES)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args(arguments)
    if os.geteuid() != 0:
        print("many_machines needs root, which starts Slurm: left out")
        return 0
    # Who ends this program ends its Slurm, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    with TemporaryDirectory() as name:
        if subprocess.run([HERE / "start-slurm.sh", name], check=False).returncode:
            print("many_machines: no Slurm can be installed or started here: left out")
            return 0
        subprocess.run([HERE / "stop-slurm.sh", name], check=True)
    with TemporaryDirectory(prefix="epsmesh-machines-") as name:
        folder = Path(name)
        os.environ |= MPI_ENVIRONMENT | {"XDG_STATE_HOME": str(folder / "state"), "PYTHONPATH": str(ROOT)}
        study = folder / "many.toml"
        study.write_text(to_toml(_scenes(asked.cases), study.name))
        # Compiled forms are made once a machine.
        _run("run", _first(folder), "--output", folder / "first", "--meshes", folder / "first", "-q")
        print(f"one process, {asked.cases} cases", flush=True)
        single = _run("run", study, "--output", folder / "one", "--meshes", folder / "one", "-q")
        print(f"  {single.processor:.0f} s of processor time, {single.elapsed:.0f} s", flush=True)
        (folder / "slurm").mkdir()
        (folder / "times").mkdir()
        command = COMMAND.format(python=shlex.quote(sys.executable), folder=folder / "times")
        with started(folder / "slurm", command) as cluster:
            campaign = Campaign(cluster, folder, asked.cases, random.Random(asked.seed))
            start = time.monotonic()
            state = _campaign(campaign, study, asked.jobs)
            elapsed = time.monotonic() - start
            used = campaign.processor()
            status = _run("status", at=Path("/"))
            told = sum(1 for run in runs() if run.shard)
            of_study = _run("status", study, "--output", folder / "many")
        same = _verdict(folder)
        rows = [
            {"": "one process", "processor time": single.processor, "elapsed": single.elapsed, "efficiency": 1.0},
            {
                "": f"{asked.jobs} jobs, 3 killed, a node drained",
                "processor time": used,
                "elapsed": elapsed,
                "efficiency": single.processor / used,
            },
        ]
        table = markdown(rows, {"": "", "processor time": ".0f", "elapsed": ".0f", "efficiency": ".2f"})
        further = {
            "status, all runs (s of processor time)": status.processor,
            "status of the study (s of processor time)": of_study.processor,
            "status of the study (MB)": of_study.memory / 1e6,
            "programs started": campaign.starts,
            "runs shown": told,
        }
        lines = [
            *(f"- {name}: {value:.3g}" for name, value in further.items()),
            f"- merge job: {state}; {same or 'same bits'}",
        ]
        text = "\n".join([table, *lines, ""])
        print(text)
        write("many_machines", asked.output, {"rows": rows, "killed": campaign.killed, **further, "wrong": same}, text)
    return int(bool(same) or state != "COMPLETED" or told != asked.jobs)


def _scenes(cases: int) -> dict[str, Any]:
    """Return a study of small scenes, each solved from zero.

    A restarted job would have other initial guesses than one that was not killed: forces would agree to 1e-11, but not
    in every bit.
    """
    scenes = many_small(cases, ON_A_MESH)
    without = [*scenes["plan"]["without"], "reuse"]
    return scenes | {"mesh": scenes["mesh"] | MESH, "plan": {"without": without}}


def _campaign(campaign: Campaign, study: Path, jobs: int) -> str:
    """Submit the jobs, disturb them, and wait for their end; return the state of the merge job."""
    cluster, folder = campaign.cluster, campaign.folder
    words = [study, "--output", folder / "many"]
    array = cluster.submit(
        folder, f"--array=1-{jobs}", f"{JOBS}/shards.sbatch", *words, "--meshes", folder / "many", "-q"
    )
    merge = cluster.submit(folder, f"--dependency=afterany:{array}", f"{JOBS}/merge.sbatch", *words)
    moments = sorted(campaign.dice.uniform(_FIRST, _LAST) for _ in WAYS)
    events = sorted([*zip(moments, WAYS, strict=True), (_DRAIN, "drain")])
    released, told, end = set[str](), time.monotonic(), time.monotonic() + _PATIENCE
    while not cluster.has_ended(merge, released) and time.monotonic() < end:
        cluster.has_ended(array, released)
        done = sum(run.done for run in runs() if run.shard) / campaign.cases
        if events and done >= events[0][0]:
            if events[0][1] == "drain":
                campaign.drain()
                events.pop(0)
            elif campaign.kill(events[0][1]):
                events.pop(0)
        if time.monotonic() - told > _TELL:
            told = time.monotonic()
            print(f"  {100 * done:.0f} % done", flush=True)
        time.sleep(_LOOK)
    if events:
        raise SystemExit(f"the jobs ended before they were disturbed: {events}")
    return cluster.field(merge, "JobState")


def _verdict(folder: Path) -> str:
    """Return what is wrong with the dataset of the jobs, "" if nothing is."""
    many, one = folder / "many" / "many.nc", folder / "one" / "many.nc"
    if not many.exists() or not all_done(many):
        return "the dataset is not whole"
    try:
        assert_same_bits(many, one, alike=False)
    except AssertionError as error:
        return f"the datasets differ: {error}"
    return ""


def _first(folder: Path) -> Path:
    """Return a study of few cases, whose run compiles the forms."""
    path = folder / "first.toml"
    path.write_text(to_toml(_scenes(ON_A_MESH), path.name))
    return path


def _run(*words: object, at: Path = ROOT) -> Used:
    """Run `epsmesh` to its end; return what it used.

    Raises:
        SystemExit: if it fails.
    """
    start = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "epsmesh", *map(str, words)],
        cwd=at,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"epsmesh {' '.join(map(str, words))}: status {process.returncode}")
    return Used(time.monotonic() - start, used.ru_utime + used.ru_stime, 1024.0 * used.ru_maxrss)


def _seconds(text: str) -> float:
    """Return the seconds in a time as the shell writes it, such as ``1m2.345s``."""
    minutes, seconds = text.removesuffix("s").split("m")
    return 60 * float(minutes) + float(seconds)


if __name__ == "__main__":
    sys.exit(main())
