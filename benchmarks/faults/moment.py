"""One moment of fault injection: a run that receives a signal in a stage, and checks of what it leaves."""

import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from benchmarks.faults.victim import WIDTH
from epsmesh.report.read import read_file
from epsmesh.report.study import DatasetError
from epsmesh.run.reading import read_rows
from epsmesh.run.store import Store, StoreError

ROOT = Path(__file__).parents[2]
# Stages of a run by phase; a moment is drawn within one of them.
PHASES = {
    "compile": ("compiler",),
    "mesh": ("gmsh", "dolfinx mesh", "mesh cache"),
    "solve": ("assembly", "set-up", "iterations", "error bar", "interpolation", "spaces, forms"),
    "write": ("store", "results"),
}
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
# Receiver of the signal: the process or its launcher, or one of two ranks.
TARGETS = ("launcher", "rank 0", "rank 1")
# Seconds within which all processes of a run must be gone.
LONGEST = 30.0
# Limit (s) for a run that is not killed.
_PATIENCE = 300.0
# Longest delay (s) of the signal after a stage was seen to begin.
_LATEST = {"compile": 1.5, "mesh": 0.08, "solve": 0.05, "write": 0.02}
_MARK = "EPSMESH_FAULTS"
_MPI = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Moment:
    """A signal, its receiver, the phase, and how often that phase must begin first (``entry``)."""

    number: signal.Signals
    ranks: int
    target: str
    phase: str
    entry: int
    delay: float

    def __str__(self) -> str:
        who = self.target if self.ranks > 1 else "the process"
        return f"{self.number.name} to {who} ({self.ranks} rank{'s' * (self.ranks > 1)}), {self.phase} {self.entry}"


@dataclass(frozen=True)
class Left:
    """Observations: stage of the signal ("" if the run had ended before), seconds until all processes were gone, the
    run's status, and faults.
    """

    stage: str
    seconds: float
    status: int
    faults: tuple[str, ...]


def draw(number: int, seed: int) -> Moment:
    """Return the moment of a ``number``: signals, ranks and phases cycle, the rest is random."""
    dice = random.Random(f"{seed} {number}")
    phase = [*PHASES][number % len(PHASES)]
    name = SIGNALS[number // len(PHASES) % len(SIGNALS)]
    ranks = 1 + (number // (len(PHASES) * len(SIGNALS))) % 2
    target = TARGETS[dice.randrange(len(TARGETS))] if ranks > 1 else "launcher"
    return Moment(name, ranks, target, phase, dice.randint(1, 4), dice.uniform(0, _LATEST[phase]))


class Scene:
    """A folder with a study, its store and results, and a folder of compiled code with some code missing."""

    def __init__(self, folder: Path, study: str, cache: Path, missing: int, dice: random.Random):
        folder.mkdir(parents=True)
        self.folder, self.file = folder, folder / "study.toml"
        self.file.write_text(study)
        shutil.copytree(cache, folder / "cache")
        forms = sorted((folder / "cache").rglob("*.c.cached"))
        for mark in dice.sample(forms, min(missing, len(forms))):
            for file in mark.parent.glob(f"{mark.name.removesuffix('.c.cached')}*"):
                file.unlink()

    @property
    def cache(self) -> Path:
        """The folder of compiled code."""
        return self.folder / "cache"

    @property
    def words(self) -> list[str]:
        """The command line."""
        places = {"--output": self.folder / "results", "--meshes": self.folder / "meshes"}
        return ["run", str(self.file), *(str(word) for pair in places.items() for word in pair)]

    @property
    def store(self) -> Path:
        """The case store."""
        return self.folder / "results" / "cases.sqlite"

    @property
    def dataset(self) -> Path:
        """The results."""
        return self.folder / "results" / "study.nc"

    def start(self, ranks: int) -> subprocess.Popen[bytes]:
        """Start a run in a session of its own; its output goes to a file."""
        launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, sys.executable, "-m", "benchmarks.faults.victim", str(self.folder / "stage"), *self.words]
        for told in self.folder.glob("stage-*"):
            told.unlink()
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
        own = {"EPSMESH_CACHE": str(self.cache), _MARK: str(self.folder), "PYTHONPATH": str(ROOT)}
        with (self.folder / "said").open("wb") as said:
            return subprocess.Popen(
                command,
                cwd=ROOT,
                env={**kept, **_MPI, **own},
                start_new_session=True,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
            )

    def run_on(self, ranks: int = 1) -> int:
        """Run to the end, and return the status."""
        process = self.start(ranks)
        try:
            return process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            _end(self._alive())
            return process.wait()

    def stop_at(self, moment: Moment) -> Left:
        """Begin a run, send the signal, and check what is left."""
        process, before = self.start(moment.ranks), dict[str, str]()
        stage = self._await(moment, process)
        if stage:
            time.sleep(moment.delay)
            before = self._records()
            with suppress(ProcessLookupError):
                os.kill(self._whom(moment, process), moment.number)
        start = time.monotonic()
        with suppress(subprocess.TimeoutExpired):
            process.wait(LONGEST if stage else _PATIENCE)
        while (alive := self._alive()) and time.monotonic() - start < LONGEST:
            time.sleep(0.05)
        seconds = time.monotonic() - start
        faults = [f"{len(alive)} processes are still there after {seconds:.0f} s"] if alive else []
        _end(alive)
        status = process.wait()
        if not stage and status:
            faults.append(f"the run ended by itself with {status}: {(self.folder / 'said').read_text()[-2000:]}")
        return Left(stage, seconds, status, (*faults, *self._faults(before)))

    def _await(self, moment: Moment, process: subprocess.Popen[bytes]) -> str:
        """Wait until the phase begins for the ``entry``-th time; return the stage, "" if the run ends before."""
        seen, was = 0, False
        while process.poll() is None:
            stages = [told.read_bytes()[:WIDTH].decode().strip() for told in self.folder.glob("stage-*")]
            stage = next((name for name in stages if name in PHASES[moment.phase]), "")
            seen += bool(stage) and not was
            if stage and (seen >= moment.entry or moment.phase in ("compile", "write")):
                return stage
            was = bool(stage)
            time.sleep(5e-4)
        return ""

    def _whom(self, moment: Moment, process: subprocess.Popen[bytes]) -> int:
        if moment.target == "launcher":
            return process.pid
        wanted = moment.target.removeprefix("rank ")
        for other in self._alive():
            with suppress(psutil.Error):
                if other.environ().get("OMPI_COMM_WORLD_RANK") == wanted and other.pid != process.pid:
                    return other.pid
        return process.pid

    def _alive(self) -> list[psutil.Process]:
        """Return all processes started by runs in this folder, whoever is their parent now."""
        return [process for process in _processes() if _mark_of(process) == str(self.folder)]

    def _records(self) -> dict[str, str]:
        """Return the records of the store, none of which may be lost."""
        if not self.store.exists():
            return {}
        with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{self.store}?mode=ro", uri=True)) as database:
            return dict(database.execute("SELECT key, record FROM records"))
        return {}

    def _faults(self, before: dict[str, str]) -> Iterator[str]:
        """Yield faults of store, dataset and meshes."""
        if self.store.exists():
            contents = _contents(self.folder)
            try:
                rows = {key: text for key, text, _ in read_rows(self.store)}
            except StoreError as error:
                yield str(error)
                return
            if _contents(self.folder) != contents:
                yield "reading the store changed a file"
            if any(rows.get(key) != text for key, text in before.items()):
                yield "a record of the store is lost, or has changed"
            store = Store(self.store)
            yield from store.problems()
            if store.notice:
                yield store.notice
            store.close()
        if self.dataset.exists():
            try:
                read_file(self.dataset)
            except DatasetError as error:
                yield f"the dataset is torn: {error}"


def _contents(folder: Path) -> dict[Path, tuple[int, int]]:
    found = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("stage-"))
    return {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in found}


def _processes() -> Iterator[psutil.Process]:
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.status() != psutil.STATUS_ZOMBIE:
                yield process


def _mark_of(process: psutil.Process) -> str | None:
    try:
        return process.environ().get(_MARK)
    except (psutil.Error, OSError):
        return None


def _end(processes: list[psutil.Process]) -> None:
    for process in processes:
        with suppress(psutil.Error):
            process.kill()
