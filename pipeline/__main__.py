"""``python -m pipeline`` is the command ``epsmesh``."""

import os
import signal
import sys
from typing import Any, NoReturn

INTERRUPTED = 130
_LAST_STANDARD = 2  # number of standard error


def main() -> None:
    """Run the command ``epsmesh``; Ctrl-C ends it quietly, even while it loads or is on its way out."""
    _open_standard_streams()
    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored: nohup, or `&`
    if listens:
        signal.signal(signal.SIGINT, _leave)
    from pipeline.cli import main as run  # noqa: PLC0415 (what takes time to load)

    try:
        if listens:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, _leave)
        sys.exit(INTERRUPTED)


def _open_standard_streams() -> None:
    """Open what was closed (``>&-``) on nothing: else the next file takes its number, and what libraries print.

    Python has None for such a stream, which most of what writes or flushes does not expect.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= _LAST_STANDARD:
        os.set_inheritable(number, True)
    os.close(number)
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def _leave(*_: Any) -> NoReturn:
    """End at once: nothing is begun, or all is done; an exception may come out of an import as another one."""
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
