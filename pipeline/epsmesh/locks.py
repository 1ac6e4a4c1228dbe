"""Locks that show whether the process that made a file still runs, also where the file system has none."""

import fcntl
import os
import socket
from contextlib import suppress
from pathlib import Path

# Seconds by which a process may seem to begin after it has made a file: clocks of processes and files differ.
_SLACK = 5.0


def hold(file: int) -> None:
    """Lock an open file until it is closed, or the process ends; without effect where the file system has no locks."""
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def is_held(path: Path, machine: str, pid: int) -> bool:
    """Return whether the process ``pid`` of a ``machine`` still holds a file, which it made.

    The lock shows it. Where the file system has none, it is held if a process of that number, as old as the file, runs
    on this machine; of another machine it is not known, and the file counts as held.

    Raises:
        OSError: if the file cannot be opened.
    """
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return machine != socket.gethostname() or _runs(pid, os.fstat(file.fileno()).st_mtime)
    return False


def _runs(pid: int, since: float) -> bool:
    """Return whether a process of this number runs that began before the time ``since``."""
    import psutil  # noqa: PLC0415 (only where there are no locks)

    try:
        return bool(psutil.Process(pid).create_time() <= since + _SLACK)
    except psutil.Error:
        return False
