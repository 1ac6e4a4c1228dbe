"""The job scripts on a real Slurm: two virtual nodes on this machine, of which one is lost in the middle."""

import os
import shlex
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from pipeline.run.reading import read_rows
from pipeline.run.store import StoreError
from tests.compare import all_done, assert_same
from tests.studies import small_text

pytestmark = pytest.mark.slurm

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
JOBS = "scripts/slurm"
# Meshes fine enough for a job to be caught in the middle of its work.
STUDY = small_text(
    "cluster",
    material={"poisson": [0.3, 0.4]},
    mesh={
        "epsilon": ["4 mm", "5 mm", "6 mm", "full"], "fine": "1.2 mm", "rim": "0.2 mm", "outside": ["coarse", "free"],
    },
)  # fmt: skip
FINAL = ("COMPLETED", "FAILED", "TIMEOUT", "OUT_OF_MEMORY")  # on its way back into the queue a job may be CANCELLED
PATIENCE = 400.0  # seconds, on a machine that is busy with other things


@dataclass(frozen=True)
class Cluster:
    """A running Slurm: where its files are, the environment of its commands, and where the test's logs go."""

    folder: Path
    environment: dict[str, str]

    def call(self, *words: object, may_fail: bool = False) -> str:
        done = subprocess.run(
            [str(word) for word in words], capture_output=True, text=True, env=self.environment, cwd=ROOT, check=False
        )
        assert may_fail or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout.strip()

    def submit(self, logs: Path, *words: object) -> str:
        """Submit a job from the project's folder and return its id."""
        return self.call("sbatch", "--parsable", f"--output={logs}/%x-%A_%a.log", *words)

    def field(self, job: str, name: str) -> str:
        """Return a field of what Slurm tells of a job, of the first task of an array."""
        told = self.call("scontrol", "--oneliner", "show", "job", job).splitlines()[0]
        return next(word.partition("=")[2] for word in told.split() if word.startswith(f"{name}="))

    def story(self, logs: Path) -> str:
        """Return what is to be known where something went wrong."""
        return f"{self.call('scontrol', 'show', 'jobs')}\n{told(logs)}\n{(self.folder / 'slurmctld.log').read_text()}"

    def wait_for(self, job: str) -> None:
        """Wait until a job and all its tasks have ended; one that was put back into the queue rests for seconds only.

        Not for none: a job that starts in the second of its requeueing is refused for its old credential.
        """
        released = set[str]()

        def ended() -> bool:
            rows = self.call("squeue", "-h", "-r", "--states=all", "-j", job, "-o", "%A|%T|%r").splitlines()
            states = [row.split("|") for row in rows]
            for number, state, reason in states:
                if state == "PENDING" and reason == "BeginTime" and number not in released:
                    released.add(number)
                    # One task of an array has the number of the whole, of which others may run.
                    self.call("scontrol", "update", f"JobId={number}", "StartTime=now+3seconds", may_fail=True)
            return all(state in FINAL for _, state, _ in states)

        wait(ended)


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "Slurm takes too long"
        time.sleep(0.05)


def records(store: Path) -> int:
    try:
        return len(read_rows(store)) if store.exists() else 0
    except (StoreError, sqlite3.Error):
        return 0


def told(logs: Path) -> str:
    return "\n".join(f"{path.name}:\n{path.read_text()}" for path in sorted(logs.glob("*.log")))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Cluster]:
    if os.geteuid() != 0:
        pytest.skip("slurmd needs root")
    folder = tmp_path_factory.mktemp("slurm")
    command = folder / "epsmesh"
    command.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m pipeline "$@"\n')
    command.chmod(0o755)
    # The jobs are to find no trace of the MPI and the Slurm that the tests may themselves run under.
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_", "SLURM_", "SHARDS"))}
    # The nodes have one machine's cores between them: a rank that waits is to leave them to the others.
    own = {"SLURM_CONF": str(folder / "slurm.conf"), "EPSMESH": str(command), "OMPI_MCA_mpi_yield_when_idle": "1"}
    environment = clean | own
    try:
        subprocess.run([HERE / "start-slurm.sh", folder, "2", "2"], env=environment, check=True)
        yield Cluster(folder, environment)
    finally:
        subprocess.run([HERE / "stop-slurm.sh", folder], env=environment, check=True)


@pytest.fixture(scope="module")
def serial(tmp_path_factory) -> tuple[Path, Path]:
    """Return the study, and the dataset of a run by itself."""
    folder = tmp_path_factory.mktemp("serial")
    study = folder / "cluster.toml"
    study.write_text(STUDY)
    command = [sys.executable, "-m", "pipeline", "run", study, "--output", folder, "--meshes", folder / "meshes", "-q"]
    subprocess.run(command, cwd=ROOT, env=os.environ | {"OMP_NUM_THREADS": "1"}, check=True)
    return study, folder / "cluster.nc"


@pytest.mark.parametrize("job", ["study", "shards", "merge"])
def test_slurm_accepts_the_jobs(cluster, job):
    cluster.call("sbatch", "--test-only", "--ntasks=2", f"{JOBS}/{job}.sbatch", "study.toml")


def test_array_of_shards_and_their_merge(cluster, serial, tmp_path):
    study, dataset = serial
    options = [study, "--output", tmp_path]
    array = cluster.submit(tmp_path, "--array=1-3", f"{JOBS}/shards.sbatch", *options, "--meshes", tmp_path / "meshes")
    merge = cluster.submit(tmp_path, f"--dependency=afterany:{array}", f"{JOBS}/merge.sbatch", *options)
    cluster.wait_for(merge)
    assert cluster.field(merge, "JobState") == "COMPLETED", cluster.story(tmp_path)
    assert all(records(tmp_path / "shards" / f"cluster.{number}-of-3.sqlite") > 0 for number in (1, 2, 3))
    assert_same(tmp_path / "cluster.nc", dataset)


def test_one_job_on_two_nodes_interrupted_and_resumed(cluster, serial, tmp_path):
    """The signal that comes before the time limit: what is done is on disk, and the job comes back and goes on."""
    study, dataset = serial
    options = [study, "--output", tmp_path, "--meshes", tmp_path / "meshes"]
    job = cluster.submit(tmp_path, "--nodes=2", "--ntasks=2", f"{JOBS}/study.sbatch", *options)
    wait(lambda: records(tmp_path / "cases.sqlite") >= 2)
    cluster.call("scancel", "--signal=TERM", job)
    wait(lambda: cluster.field(job, "Restarts") == "1")
    assert not all_done(tmp_path / "cluster.nc")
    cluster.wait_for(job)
    assert cluster.field(job, "JobState") == "COMPLETED", cluster.story(tmp_path)
    assert "Stored cases are read" in told(tmp_path)
    assert_same(tmp_path / "cluster.nc", dataset, rtol=1e-6, alike=False)


def test_a_node_is_lost_in_the_middle(cluster, serial, tmp_path):
    """Its shard is put back into the queue by Slurm, and goes on from its store on the node that is left."""
    study, dataset = serial
    options = [study, "--output", tmp_path]
    array = cluster.submit(
        tmp_path, "--array=1-2", "--exclusive", f"{JOBS}/shards.sbatch", *options, "--meshes", tmp_path / "meshes"
    )
    merge = cluster.submit(tmp_path, f"--dependency=afterany:{array}", f"{JOBS}/merge.sbatch", *options)
    on_node: dict[str, str] = {}

    def started() -> bool:
        rows = cluster.call("squeue", "-h", "-r", "-j", array, "-t", "running", "-o", "%N|%K|%A").splitlines()
        on_node.update({row.split("|")[0]: row for row in rows})
        return "n2" in on_node

    wait(started)
    _, number, job = on_node["n2"].split("|")
    store = tmp_path / "shards" / f"cluster.{number}-of-2.sqlite"
    wait(lambda: records(store) >= 1)
    kill_node(cluster, "n2")
    before = records(store)
    cluster.call("scontrol", "update", "NodeName=n2", "State=DOWN", "Reason=lost")
    wait(lambda: cluster.field(job, "Restarts") == "1")
    assert records(store) == before
    cluster.wait_for(array)
    cluster.wait_for(merge)
    assert cluster.field(job, "JobState") == "COMPLETED", cluster.story(tmp_path)
    assert cluster.field(merge, "JobState") == "COMPLETED", cluster.story(tmp_path)
    assert "Stored cases are read" in (tmp_path / f"epsmesh-shards-{array}_{number}.log").read_text()
    assert_same(tmp_path / "cluster.nc", dataset)


def kill_node(cluster: Cluster, name: str) -> None:
    """Kill a node's daemon, the guardians of its job steps, and their processes: those of this cluster only."""
    pids = dict(line.split() for line in (cluster.folder / "pids").read_text().splitlines())
    os.kill(int(pids[name]), signal.SIGKILL)
    doomed: set[psutil.Process] = set()
    mark = {"SLURMD_NODENAME": name, "SLURM_CONF": cluster.environment["SLURM_CONF"]}
    for process in psutil.process_iter():
        try:
            if mark.items() <= process.environ().items():
                doomed |= {process, *(p for p in process.parents() if "".join(p.cmdline()).startswith("slurmstepd"))}
        except psutil.Error:
            continue
    assert doomed
    for process in doomed:
        try:
            process.kill()
        except psutil.NoSuchProcess:
            continue
    psutil.wait_procs(list(doomed), timeout=30)
