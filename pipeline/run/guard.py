"""A run in a process of its own, beside which a small one waits: what ends the process costs one case, not the rest.

A library that runs out of memory may end the whole process (hypre does), and so may the system's out-of-memory killer,
or a fault in a library: nothing that Python could catch. The process that waits loads no solver; told which solves are
begun and which records kept, it lets the solve under way fail, and begins another process for the others.
"""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress

from pipeline.launcher import is_launched
from pipeline.run.progress import Progress
from pipeline.run.record import Record
from pipeline.run.store import Store

# Signals that end a process from outside, or from below Python. Others mean the run: its time is up, its terminal gone.
_FATAL = {signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL}
_PR_SET_PDEATHSIG = 1
_BEGUN, _KEPT, _OVER = "begun", "kept", "over"


class Guard:
    """What is known of a run beyond its process: by key, the solves that ended one (``lost``, with the reason), and
    those that came to a record since it began (``kept``).
    """

    def __init__(self) -> None:
        self.lost: dict[str, str] = {}
        self.kept: set[str] = set()
        self._file: int | None = None

    def begin(self, keys: Collection[str]) -> None:
        """Say which solves are under way."""
        self._tell(_BEGUN, *keys)

    def keep(self, key: str) -> None:
        """Say that a solve has a record."""
        self._tell(_KEPT, key)

    def over(self) -> None:
        """Say that Python ends the run: whatever becomes of the process now, no case is to blame."""
        self._tell(_OVER)

    def records(self, store: Store, keys: Collection[str]) -> dict[str, Record]:
        """Return, among ``keys``, what this run has come to before: records kept, and failures of what it lost.

        Those are put on record here.
        """
        for key in self.lost.keys() & set(keys):
            store.put(Record(key, "failed", self.lost[key]))
        return store.get((self.kept | self.lost.keys()) & set(keys))

    def _tell(self, *words: str) -> None:
        if self._file is not None:
            with suppress(OSError):  # no memory even for that
                os.write(self._file, (" ".join(words) + "\n").encode())

    def _listen(self) -> list[list[str]]:
        """Return what was told so far, by lines, and forget it."""
        assert self._file is not None
        told = os.pread(self._file, os.fstat(self._file).st_size, 0).decode()
        os.ftruncate(self._file, 0)
        os.lseek(self._file, 0, os.SEEK_SET)
        return [line.split() for line in told.splitlines()]

    def lose(self, why: str) -> int:
        """Note, after the process has ended, which solves it was at; return their number, 0 if it was not theirs."""
        begun: set[str] = set()
        for word, *keys in self._listen():
            if word == _OVER:
                return 0
            if word == _BEGUN:
                begun = set(keys)
            elif word == _KEPT:
                self.kept.update(keys)
        begun -= self.kept
        self.lost |= dict.fromkeys(begun, why)
        return len(begun)


class Guarded:
    """Progress that a guard hears of, too."""

    def __init__(self, progress: Progress, guard: Guard):
        self._progress = progress
        self.begin = guard.begin
        self.done, self.note = progress.done, progress.note


@contextmanager
def guarded(say: Callable[[str], None]) -> Iterator[Guard]:
    """Do what follows in a child of this process, and in further ones if it is ended; this one waits, and then ends.

    Where that cannot be (under mpirun, or once MPI is loaded) it is done in this process. ``say`` tells the user.
    """
    guard = Guard()
    if _can_fork():
        _fork(guard, say)
    try:
        yield guard
    finally:
        guard.over()


def _can_fork() -> bool:
    alone = threading.current_thread() is threading.main_thread() and threading.active_count() == 1
    return hasattr(os, "memfd_create") and alone and not is_launched() and "mpi4py.MPI" not in sys.modules


def _fork(guard: Guard, say: Callable[[str], None]) -> None:
    """Return in a child; end with its status in this process."""
    guard._file = os.memfd_create("epsmesh")
    # Also where the shell has SIGINT ignored, as it does for `&` in a script: a run answers it all the same.
    heard = {signal.SIGINT, signal.SIGTERM, signal.SIGCHLD}
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    while True:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, heard)
        sys.stdout.flush()
        sys.stderr.flush()
        parent, child = os.getpid(), os.fork()
        if child == 0:
            _end_with(parent)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            return
        status, interrupted = _await(child, heard)
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        ended_by = signal.Signals(number).name if number else f"status {os.WEXITSTATUS(status)}"
        why = "out of memory, as a rule" if number == signal.SIGKILL else "a library failed, perhaps for want of memory"
        count = guard.lose(f"the process ended by {ended_by} while this case was computed: {why}")
        if interrupted or not count or (number and number not in _FATAL):
            os._exit(128 + number if number else os.WEXITSTATUS(status))
        say(f"the process of the run ended by {ended_by}: {_what_failed(count)}; the others go on in a new one")


def _what_failed(count: int) -> str:
    return "the case that it was at has failed" if count == 1 else f"the {count} cases that it was at have failed"


def _await(child: int, heard: set[signal.Signals]) -> tuple[int, bool]:
    """Return the status of a child when it has ended, and whether it was asked to; pass on what asks it."""
    interrupted = False
    while True:
        told = signal.sigwaitinfo(heard)
        if told.si_signo == signal.SIGCHLD:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status, interrupted
            continue
        interrupted = True
        if told.si_code <= 0:  # another process's, to this one; a terminal tells the child as well
            with suppress(ProcessLookupError):
                os.kill(child, told.si_signo)


def _end_with(parent: int) -> None:
    """Let this process end when ``parent`` does, even by SIGKILL."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(128 + signal.SIGKILL)
