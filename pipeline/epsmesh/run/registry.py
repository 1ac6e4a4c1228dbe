"""A register of the user's runs: `status` shows them from any folder, and those of other machines with the same home.

Each run has a small file in the user's state folder, which it updates while it computes. On the machine of the run, a
lock on the file shows whether the run is alive. For runs elsewhere, Slurm knows it, or else the age of the last update.
If the folder cannot be written, runs are not registered.
"""

import json
import os
import socket
import subprocess
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from types import TracebackType

from pydantic import TypeAdapter

from epsmesh.files import state_folder
from epsmesh.locks import hold, is_held
from epsmesh.plan.plan import Plan
from epsmesh.plan.shard import shard_of
from epsmesh.run.progress import MESHING, Progress

# States of a run. "silent": on another machine, without a sign of life for `_SILENCE`.
RUNNING, ENDED, INTERRUPTED, KILLED, SILENT = "running", "ended", "interrupted", "killed", "silent"
_SILENCE = 600.0  # s
# Seconds between two updates.
_PACE = 1.0
# Runs that are over are forgotten after so many seconds.
_AGE = 14 * 86400.0
# Seconds that Slurm has to answer.
_PATIENCE = 5.0


@dataclass(frozen=True)
class Run:
    """A registered run: its study, store, shard ("3/20", or ""), place and progress; times in seconds since 1970.

    ``done`` of ``total`` solves are stored, ``failed`` of them failed; ``at`` is the case in work. ``job`` is Slurm's
    name of the job, ``job_id`` its number.
    """

    study: str
    store: str
    shard: str
    host: str
    machine: str
    job: str
    job_id: str
    pid: int
    started: float
    seen: float
    total: int
    done: int
    failed: int
    at: str
    state: str

    @property
    def left(self) -> int:
        """The number of solves to do, with that in work."""
        return self.total - self.done


class Registered(Progress):
    """Progress that also updates the register; a context manager, on the first rank of a run.

    It takes the place of earlier runs on the same ``store``. Reports go on to ``progress``.
    """

    def __init__(self, store: Path, plan: Plan, progress: Progress):
        self._progress, self._file, self._written = progress, -1, 0
        self._store, self._study = store.resolve(), Path(plan.study.file).resolve()
        self._done = len(plan.stored)
        self._total, self._failed, self._at = self._done + len(plan.solves), 0, ""
        self._started, self._last = time.time(), 0.0

    def __enter__(self) -> "Registered":
        with suppress(OSError):
            self._open(state_folder() / "runs")
        self._update(RUNNING)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._at = ""
        self._update(ENDED if kind is None else INTERRUPTED)
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def done(self, label: str, failed: str = "") -> None:
        """Report a finished solve, or one that ``failed`` with a message."""
        self._done += 1
        self._failed += bool(failed)
        self._update_if_due()
        self._progress.done(label, failed)

    def note(self, text: str) -> None:
        """Report the present work."""
        self._at = text.removeprefix(MESHING)
        self._update_if_due()
        self._progress.note(text)

    def _open(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        name = sha256(f"{self._store}\n{self._study}".encode()).hexdigest()[:16]
        for path in folder.iterdir():
            if path.name.startswith(name) or path.stat().st_mtime < self._started - _AGE:
                _remove(path)
        path = folder / f"{name}-{os.urandom(4).hex()}.json"
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        hold(self._file)

    def _update_if_due(self) -> None:
        if time.monotonic() - self._last > _PACE:
            self._update(RUNNING)

    def _update(self, state: str) -> None:
        if self._file < 0:
            return
        self._last, shard = time.monotonic(), shard_of(self._store)
        array, job = os.environ.get("SLURM_ARRAY_JOB_ID"), os.environ.get("SLURM_JOB_ID", "")
        run = Run(
            study=str(self._study),
            store=str(self._store),
            shard=str(shard or ""),
            host=os.environ.get("SLURMD_NODENAME", socket.gethostname()),
            machine=socket.gethostname(),
            job=f"{array}_{os.environ.get('SLURM_ARRAY_TASK_ID')}" if array else job,
            job_id=job,
            pid=os.getpid(),
            started=self._started,
            seen=time.time(),
            total=self._total,
            done=self._done,
            failed=self._failed,
            at=self._at,
            state=state,
        )
        text = json.dumps(asdict(run)).encode()
        # One write that covers the earlier text: a reader never finds a mixture that is valid.
        self._written, padded = len(text), text.ljust(self._written)
        with suppress(OSError):
            os.pwrite(self._file, padded, 0)


def runs() -> list[Run]:
    """Return the registered runs whose stores exist, by study, store and shard; dead ones have the state "killed"."""
    folder, found = state_folder() / "runs", []
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        with suppress(OSError, ValueError):
            run = _read(path)
            found.append((run, is_held(path, run.machine, run.pid)))
    known = _running_jobs() if any(_is_elsewhere(run) and run.job_id for run, _ in found) else None
    judged = [_judged(run, is_locked, known) for run, is_locked in found if Path(run.store).exists()]
    return sorted(
        judged, key=lambda run: (run.study, Path(run.store).parent, [int(n) for n in run.shard.split("/") if n])
    )


def _judged(run: Run, is_locked: bool, jobs: frozenset[str] | None) -> Run:
    """Return ``run`` with its true state, given Slurm's running ``jobs`` (None if unknown)."""
    if run.state != RUNNING or (is_locked and not _is_elsewhere(run)):
        return run
    if not _is_elsewhere(run) or (run.job_id and jobs is not None and run.job_id not in jobs):
        return replace(run, state=KILLED)
    is_silent = not (run.job_id and jobs is not None) and time.time() - run.seen > _SILENCE
    return replace(run, state=SILENT) if is_silent else run


def _is_elsewhere(run: Run) -> bool:
    return run.machine != socket.gethostname()


def _running_jobs() -> frozenset[str] | None:
    """Return the numbers of the user's running Slurm jobs, None if Slurm does not answer."""
    try:
        done = subprocess.run(
            ["squeue", "--me", "-h", "-r", "-t", "running,completing", "-o", "%A"],
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return frozenset(done.stdout.split())


def _read(path: Path) -> Run:
    return TypeAdapter(Run).validate_json(path.read_bytes())


def _remove(path: Path) -> None:
    """Remove the file of a run that is over."""
    with suppress(OSError):
        try:
            run = _read(path)
            is_over = run.state != RUNNING or not is_held(path, run.machine, run.pid)
        except ValueError:
            is_over = True
        if is_over:
            path.unlink()
