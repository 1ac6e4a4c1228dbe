"""A Slurm of virtual nodes on this machine, for tests and benchmarks."""

import os
import sqlite3
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from epsmesh.run.reading import read_rows
from epsmesh.run.store import StoreError

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
JOBS = "scripts/slurm"
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

    def has_ended(self, job: str, released: set[str]) -> bool:
        """Return whether a job and all its tasks have ended. One put back into the queue rests for seconds only.

        Not for none: a job that starts in the second of its requeueing is refused for its old credential. ``released``
        are the jobs whose rest was shortened before.
        """
        rows = self.call("squeue", "-h", "-r", "--states=all", "-j", job, "-o", "%A|%T|%r").splitlines()
        states = [row.split("|") for row in rows]
        for number, state, reason in states:
            if state == "PENDING" and reason == "BeginTime" and number not in released:
                released.add(number)
                # One task of an array has the number of the whole, of which others may run.
                self.call("scontrol", "update", f"JobId={number}", "StartTime=now+3seconds", may_fail=True)
        return all(state in FINAL for _, state, _ in states)

    def wait_for(self, job: str) -> None:
        """Wait until :meth:`has_ended`."""
        released = set[str]()
        wait(lambda: self.has_ended(job, released))


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


@contextmanager
def started(folder: Path, command: str, cpus: int = 2) -> Iterator[Cluster]:
    """Start two nodes, whose files are in ``folder`` and whose jobs run the shell ``command`` as `epsmesh`."""
    script = folder / "epsmesh"
    script.write_text(command)
    script.chmod(0o755)
    # The jobs are to find no trace of the MPI and the Slurm that the tests may themselves run under.
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_", "SLURM_", "SHARDS"))}
    # The nodes have one machine's cores between them: a rank that waits is to leave them to the others.
    own = {"SLURM_CONF": str(folder / "slurm.conf"), "EPSMESH": str(script), "OMPI_MCA_mpi_yield_when_idle": "1"}
    environment = clean | own
    try:
        subprocess.run([HERE / "start-slurm.sh", folder, "2", str(cpus)], env=environment, check=True)
        yield Cluster(folder, environment)
    finally:
        subprocess.run([HERE / "stop-slurm.sh", folder], env=environment, check=True)
