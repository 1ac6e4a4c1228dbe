"""A small file beside the case store with the cases that a process is computing, for the case that it is killed.

Python cannot catch the out-of-memory killer, nor a crash in a library. The next run finds the file, and tries its cases
again after all others; cases with which a process was killed twice have failed. Each rank has its own file: its lock
shows whether the rank still runs, and a write takes microseconds because it is not synchronised to disk. Python's
signal handler appends the number of each signal, even while C code runs: if a process was asked to end, its cases are
not to blame.
"""

import fcntl
import json
import os
import signal
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from pipeline.run.record import Record
from pipeline.run.store import Store
from pipeline.states import FAILED

KILLED = "the process was killed while it computed this case: usually out of memory, else a crash in a library"
# The state of a file whose process still runs.
_RUNNING = "running"
# Signals that ask a process to end.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Begun:
    """The file of this process: made at its first case, removed at an orderly end; a context manager.

    Without a ``store`` nothing is written. If the file cannot be written, the run continues without it.
    """

    def __init__(self, store: Path | None = None):
        self._store, self._path, self._file = store, Path(), -1
        self._is_blamed = False
        self._before = -1

    def __enter__(self) -> "Begun":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file >= 0:
            with suppress(ValueError):  # only the main thread receives signals
                signal.set_wakeup_fd(self._before)
            os.close(self._file)
            self._file = -1
            if not self._is_blamed:
                self._path.unlink(missing_ok=True)

    def name(self, keys: Collection[str], why: str = KILLED) -> None:
        """Write the cases that start now in place of the last ones, and ``why`` they failed if the process ends."""
        self._is_blamed = why != KILLED
        with suppress(OSError):
            if self._file < 0:
                if self._store is None:
                    return
                self._open(self._store)
            os.ftruncate(self._file, 0)
            os.lseek(self._file, 0, os.SEEK_SET)
            os.write(self._file, json.dumps({"keys": sorted(keys), "why": why}).encode() + b"\n")

    def _open(self, store: Path) -> None:
        self._path = store.with_name(f"{_stem(store)}{os.urandom(4).hex()}")
        self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NONBLOCK, 0o666)
        fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        with suppress(ValueError):
            self._before = signal.set_wakeup_fd(self._file, warn_on_full_buffer=False)


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
    stem = _stem(store.path)
    for path in [path for path in store.path.parent.iterdir() if path.name.startswith(stem)]:
        begun, why = _read(path)
        if (why and begun.isdisjoint(keys)) or why == _RUNNING:
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


def _stem(store: Path) -> str:
    return f".{store.name}-begun-"


def _read(path: Path) -> tuple[set[str], str]:
    """Return the cases in a file and why they failed: "" if they did not, ``_RUNNING`` if the process still runs."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return set(), _RUNNING
        text, _, signals = file.read().partition(b"\n")
    try:
        content = json.loads(text)
        keys, why = set(content["keys"]), str(content["why"])
    except (ValueError, TypeError, KeyError):
        return set(), ""
    was_asked = why == KILLED and any(number in signals for number in ENDING)
    return keys, "" if was_asked else why
