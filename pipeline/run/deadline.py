"""An end within a bounded time: Python hears of a signal once what is computed, in C, is done, which may take minutes.

A factorisation or a mesh does not look up. So a small process of the shell's waits beside a run: the interpreter's own
C code tells it of each signal the moment it comes, and unless Python answers soon it ends the run. That is no loss:
records are on disk, whole, the moment they exist.
"""

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress

# Seconds that Python has to answer.
LONGEST = 20
# The numbers of signals come as bytes; the end of the pipe is the answer.
_WATCH = """
while number=$(od -An -tu1 -N1) && [ -n "$number" ]; do
  case $((number)) in {numbers})
    timeout {seconds} cat > /dev/null
    if [ $? = 124 ]; then
      echo "what was being computed did not end within {seconds} s: the run is ended; what is finished is kept" >&2
      kill -KILL {process}
    fi
    exit;;
  esac
done
"""


class Watch:
    """Whoever answers a signal says so."""

    def __init__(self, pipe: int | None):
        self._pipe = pipe

    def answer(self) -> None:
        """Say that Python has heard of the signal, or that there will be none."""
        pipe, self._pipe = self._pipe, None
        if pipe is not None:
            with suppress(ValueError):  # only the main thread may; then nothing was told
                signal.set_wakeup_fd(-1)
            os.close(pipe)


@contextmanager
def watched(*signals: signal.Signals, seconds: float = LONGEST) -> Iterator[Watch]:
    """End this process by SIGKILL if one of ``signals`` is not answered within some seconds; main thread only."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    numbers = "|".join(str(int(number)) for number in signals)
    script = _WATCH.format(numbers=numbers, seconds=seconds, process=os.getpid())
    try:
        # Of another session: Ctrl-C at a terminal is not meant for it.
        process = subprocess.Popen(
            ["sh", "-c", script], stdin=reading, stdout=subprocess.DEVNULL, start_new_session=True
        )
    except OSError:  # no shell, or no room for a process: signals are answered when they can be
        os.close(writing)
        yield Watch(None)
        return
    finally:
        os.close(reading)
    watch, before = Watch(writing), signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    try:
        yield watch
    finally:
        watch.answer()
        signal.set_wakeup_fd(before)
        process.wait()
