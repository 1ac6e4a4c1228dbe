"""``python -m epsmesh`` is the command ``epsmesh``."""

import os
import signal
import sys
from typing import Any, NoReturn

BAD_INPUT, INTERRUPTED = 2, 130
_LAST_STANDARD = 2  # number of standard error


def main() -> None:
    """Run the command ``epsmesh``; Ctrl-C ends it without traceback, even while it loads or exits."""
    _open_standard_streams()
    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else ignored: nohup, or `&`
    if listens:
        signal.signal(signal.SIGINT, _leave)

    try:
        from epsmesh import interrupts  # noqa: PLC0415
        from epsmesh.cli import main as run  # noqa: PLC0415 (takes time to load)
        from epsmesh.launcher import end_ranks, prepare_libraries  # noqa: PLC0415

        prepare_libraries()
        if listens:
            interrupts.listen()
        try:
            run()
        except SystemExit as ended:
            if ended.code:
                end_ranks(int(ended.code))
            raise
        finally:
            if listens:
                signal.signal(signal.SIGINT, _leave)
                interrupts.forget()
    except ImportError as missing:
        from epsmesh.libraries import sentence_on  # noqa: PLC0415

        if not (sentence := sentence_on(missing)):
            raise
        print(sentence, file=sys.stderr)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _open_standard_streams() -> None:
    """Connect closed standard streams (``>&-``) to the null device, before another file gets their numbers.

    For a closed stream Python has None, which most code that writes or flushes does not expect.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= _LAST_STANDARD:
        os.set_inheritable(number, True)
    os.close(number)
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def _leave(*_: Any) -> NoReturn:
    """Exit at once: imports may turn a KeyboardInterrupt into another exception, and no work is under way."""
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
