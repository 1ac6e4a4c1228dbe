"""The job scripts on a real Slurm: two virtual nodes on this machine, of which one is lost in the middle."""

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from tests.cluster.slurm import JOBS, ROOT, Cluster, records, started, told, wait
from tests.compare import all_done, assert_same
from tests.studies import small_text

pytestmark = pytest.mark.slurm

# Meshes fine enough for a job to be caught in the middle of its work.
STUDY = small_text(
    "cluster",
    material={"poisson": [0.3, 0.4]},
    mesh={
        "epsilon": ["4 mm", "5 mm", "6 mm", "full"], "fine": "1.2 mm", "rim": "0.2 mm", "outside": ["coarse", "free"],
    },
)  # fmt: skip


@pytest.fixture(scope="module")
def cluster(tmp_path_factory) -> Iterator[Cluster]:
    if os.geteuid() != 0:
        pytest.skip("slurmd needs root")
    command = f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m epsmesh "$@"\n'
    with started(tmp_path_factory.mktemp("slurm"), command) as running:
        yield running


@pytest.fixture(scope="module")
def serial(tmp_path_factory) -> tuple[Path, Path]:
    """Return the study, and the dataset of a run by itself."""
    folder = tmp_path_factory.mktemp("serial")
    study = folder / "cluster.toml"
    study.write_text(STUDY)
    command = [sys.executable, "-m", "epsmesh", "run", study, "--output", folder, "--meshes", folder / "meshes", "-q"]
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
    assert_same(tmp_path / "cluster.nc", dataset, alike=False)


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

    def is_running() -> bool:
        rows = cluster.call("squeue", "-h", "-r", "-j", array, "-t", "running", "-o", "%N|%K|%A").splitlines()
        on_node.update({row.split("|")[0]: row for row in rows})
        return "n2" in on_node

    wait(is_running)
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
    assert_same(tmp_path / "cluster.nc", dataset, alike=False)


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
