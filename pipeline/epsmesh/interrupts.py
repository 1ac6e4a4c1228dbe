"""Ctrl-C as KeyboardInterrupt, where that can be raised: elsewhere a little later, so that none is lost."""

import signal
import sys
from contextlib import suppress
from types import FrameType
from typing import Any

_raised: list[int] = []
# Seconds until an interrupt is tried again, and the beginning of the names of the files of Python's import.
_LATER = 0.05
_IMPORT = "<frozen importlib"


def listen() -> None:
    """Turn Ctrl-C into KeyboardInterrupt in the main thread.

    While a module is loaded, it waits: imports make other exceptions of it. One that Python drops, because it frees an
    object at that moment, is raised again.
    """
    plainly = sys.unraisablehook

    def dropped(what: Any) -> None:
        if what.exc_type is not None and issubclass(what.exc_type, KeyboardInterrupt):
            _wait()
        else:
            plainly(what)

    sys.unraisablehook = dropped
    for number in (signal.SIGINT, signal.SIGALRM):
        signal.signal(number, _interrupt)


def is_raised() -> bool:
    """Tell whether Ctrl-C has been turned into KeyboardInterrupt, of which a library may have made another error."""
    return bool(_raised)


def forget() -> None:
    """Leave out an interrupt that waits."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith(_IMPORT):
            _wait()
            return
        frame = frame.f_back
    _raised.append(number)
    raise KeyboardInterrupt


def _wait() -> None:
    with suppress(KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, _LATER)
