"""Small files beside the case store with what a process is computing, and has computed, for the case that it is killed.

Python cannot catch the out-of-memory killer, nor a crash in a library. Each rank has two files. One has the cases that
it is computing: the next run finds the file, and tries them again after all others; cases with which a process was
killed twice have failed. The other has the records of the cases that it has finished, for the next run to store: they
may not be in the store yet, as its writer waits for several of them, and may be another rank that is in a solve.

A write takes microseconds because it is not synchronised to disk: it outlives the process, not the machine. Locks show
whether the process still runs. Python's signal handler appends the number of each signal to the first file, even while
C code runs: if a process was asked to end, its cases are not to blame.
"""

import json
import os
import signal
import socket
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from epsmesh.locks import hold, is_held
from epsmesh.run.record import Record
from epsmesh.run.store import Row, Store
from epsmesh.states import FAILED

KILLED = "the process was killed while it computed this case: usually out of memory, else a crash in a library"
# Signals that ask a process to end.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Kinds of files.
_BEGUN, _DONE = "begun", "done"


class Begun:
    """The files of this process: made at its first case, removed at an orderly end; a context manager.

    Without a ``store`` nothing is written. If a file cannot be written, the run continues without it.
    """

    def __init__(self, store: Path | None = None):
        self._store = store
        self._files: dict[str, tuple[Path, int]] = {}
        self._is_blamed = False
        self._before: int | None = None

    def __enter__(self) -> "Begun":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            with suppress(ValueError):  # only the main thread receives signals
                signal.set_wakeup_fd(self._before)
            self._before = None
        for what, (path, file) in self._files.items():
            os.close(file)
            # An exception may keep records from the store, which is another rank's.
            if not self._is_blamed if what == _BEGUN else kind is None:
                path.unlink(missing_ok=True)
        self._files = {}

    def name(self, keys: Collection[str], why: str = KILLED) -> None:
        """Write the cases that start now in place of the last ones, and ``why`` they failed if the process ends."""
        self._is_blamed = why != KILLED
        with suppress(OSError):
            if (file := self._open(_BEGUN)) is not None:
                os.ftruncate(file, 0)
                os.lseek(file, 0, os.SEEK_SET)
                os.write(file, json.dumps({"keys": sorted(keys), "why": why}).encode() + b"\n")

    def done(self, record: Record) -> None:
        """Write the record of a finished case."""
        with suppress(OSError):
            if (file := self._open(_DONE)) is not None:
                os.write(file, b"\n" + record.to_json().encode())  # after a torn one, too

    def _open(self, what: str) -> int | None:
        """Return a file of this process, None without a store."""
        if self._store is None:
            return None
        if what not in self._files:
            owner = f"{socket.gethostname()}-{os.getpid()}-{os.urandom(4).hex()}"
            path = self._store.with_name(_stem(self._store, what) + owner)
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NONBLOCK, 0o666)
            self._files[what] = path, file
            hold(file)
            if what == _BEGUN:
                with suppress(ValueError):
                    self._before = signal.set_wakeup_fd(file, warn_on_full_buffer=False)
        return self._files[what][1]


@dataclass(frozen=True)
class Ended:
    """The cases during which processes were killed: the ``failed`` ones, by key, and those to try ``again``."""

    failed: dict[str, Record]
    again: frozenset[str]


def fail_begun(store: Store, keys: Collection[str]) -> Ended:
    """Return the cases among ``keys`` during which a process was killed, and store their failures.

    A case that was killed once, for an unknown reason, is to be tried again: a batch system or a person kills at any
    case. Its stored failure makes the second time the last one. Stored forces stay. Files of running processes, and
    of other studies, are not touched.

    Raises:
        StoreError: if the store cannot be written.
    """
    failed, again = {}, set()
    for path, is_running in _files(store.path, _BEGUN):
        if is_running:
            continue
        begun, why = _read(path)
        if why and begun.isdisjoint(keys):
            continue
        known = store.get(begun) if why else {}
        for key in begun if why else ():
            record, before = Record(key, FAILED, why), known.get(key)
            if why == KILLED and (before is None or (before.message != why and not before.is_ok)):
                again.add(key)
            else:
                failed[key] = record
            if before is None or not before.is_ok:
                store.put(record)
        path.unlink(missing_ok=True)
    return Ended({key: record for key, record in failed.items() if key in keys}, frozenset(again & {*keys}))


def store_done(store: Store) -> dict[str, Record]:
    """Store the records that processes have finished, and return them by key.

    Files of processes that are over are removed.

    Raises:
        StoreError: if the store cannot be written.
    """
    found: dict[str, Record] = {}
    for path, is_running in _files(store.path, _DONE):
        records = list(_records(path))
        store.put_all(records)
        found |= {record.key: record for record in records}
        if not is_running:
            path.unlink(missing_ok=True)
    return found


def done_beside(store: Path) -> Iterator[Row]:
    """Yield the records that processes have finished, and that may not be in the ``store`` yet, as its rows."""
    for path, _ in _files(store, _DONE):
        with suppress(FileNotFoundError):  # its process has just ended
            at = path.stat().st_mtime
            yield from [(record.key, record.to_json(), at) for record in _records(path)]


def _records(path: Path) -> Iterator[Record]:
    """Yield the records in a file; the last one may be torn. None in one that its process has just removed."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return
    for line in text.splitlines():
        with suppress(ValueError):
            yield Record.from_json(line)


def _stem(store: Path, what: str) -> str:
    return f".{store.name}-{what}-"


def _files(store: Path, what: str) -> Iterator[tuple[Path, bool]]:
    """Yield the files of a kind, and whether their processes run."""
    stem = _stem(store, what)
    for path in [path for path in store.parent.iterdir() if path.name.startswith(stem)]:
        machine, _, pid = path.name.removeprefix(stem).rpartition("-")[0].rpartition("-")
        with suppress(FileNotFoundError):  # it has just ended
            yield path, is_held(path, machine, int(pid) if pid.isdecimal() else -1)


def _read(path: Path) -> tuple[set[str], str]:
    """Return the cases in a file, and why they failed: "" if they did not."""
    try:
        text, _, signals = path.read_bytes().partition(b"\n")
        content = json.loads(text)
        keys, why = set(content["keys"]), str(content["why"])
    except (ValueError, TypeError, KeyError, FileNotFoundError):
        return set(), ""
    was_asked = why == KILLED and any(number in signals for number in ENDING)
    return keys, "" if was_asked else why
