"""The cases that a process is at, in a small file beside the case store: what is left if the process is ended.

Nothing in Python catches the system's out-of-memory killer, a library that ends the process, or a fault in one. The
next run finds the file, lets the cases in it fail, and goes on with the others. It is a file, and no row of the store:
each rank has one of its own, its lock tells whether that rank still runs, and a line is written in microseconds, since
it need not outlive the machine. Python's own handler adds the number of each signal, even while C code computes: a
process that was asked to end blames no case.
"""

import fcntl
import json
import os
import signal
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from pipeline.run.record import Record
from pipeline.run.store import Store

KILLED = "the process ended while it computed this case: out of memory, as a rule, or a fault in a library"
# The cases of a process that still runs are not known to have failed.
_RUNNING = "running"
# What asks a process to end.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Begun:
    """The file of this process, made when the first case begins; a context manager, that removes it at an orderly end.

    Without a ``store`` nothing is written. A file that cannot be written stops nobody.
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
            with suppress(ValueError):  # only the main thread hears of signals
                signal.set_wakeup_fd(self._before)
            os.close(self._file)
            self._file = -1
            if not self._is_blamed:
                self._path.unlink(missing_ok=True)

    def name(self, keys: Collection[str], why: str = KILLED) -> None:
        """Write which cases are begun, instead of the last ones, and ``why`` they failed if nothing else is written."""
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


def fail_begun(store: Store, keys: Collection[str]) -> dict[str, Record]:
    """Return by key the failures of those of ``keys`` with which a process was ended, and put them on record.

    A force that is on record stays there. Files of processes that still run, and of other studies, are left alone.

    Raises:
        StoreError: if the store cannot be written.
    """
    failed = {}
    stem = _stem(store.path)
    for path in [path for path in store.path.parent.iterdir() if path.name.startswith(stem)]:
        begun, why = _read(path)
        if (why and begun.isdisjoint(keys)) or why == _RUNNING:
            continue
        known = store.get(begun) if why else {}
        for key in begun if why else ():
            failed[key] = Record(key, "failed", why)
            if key not in known or not known[key].is_ok:
                store.put(failed[key])
        path.unlink(missing_ok=True)
    return {key: record for key, record in failed.items() if key in keys}


def _stem(store: Path) -> str:
    return f".{store.name}-begun-"


def _read(path: Path) -> tuple[set[str], str]:
    """Return the cases in a file, and why they failed: "" if none is to blame, ``_RUNNING`` if it is not known yet."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return set(), _RUNNING
        told, _, signals = file.read().partition(b"\n")
    try:
        content = json.loads(told)
        keys, why = set(content["keys"]), str(content["why"])
    except (ValueError, TypeError, KeyError):
        return set(), ""
    was_asked = why == KILLED and any(number in signals for number in ENDING)
    return keys, "" if was_asked else why
