"""How the command line speaks: colour where a person watches, plain text elsewhere; nobody listening ends nothing."""

import json
import os
import sys
from contextvars import ContextVar
from io import TextIOWrapper
from math import inf, isfinite
from typing import Any, TextIO

from pipeline.printable import printable_json, printable_lines

# Of the command that runs: whether JSON was asked for, and whether any has been printed.
JSON: ContextVar[dict[str, bool]] = ContextVar("JSON")
_COLOURS = {"red": "31", "yellow": "33"}


def paint(text: str, colour: str, stream: TextIO) -> str:
    """Return ``text`` in a colour if ``stream`` is a terminal and the environment does not ask for none."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\033[{_COLOURS[colour]}m{text}\033[0m"


def error(text: str) -> None:
    """Print to standard error, in red."""
    print(paint(printable_lines(text), "red", sys.stderr), file=sys.stderr, flush=True)


def warning(text: str) -> None:
    """Print a warning to standard error, in yellow."""
    print(paint(f"warning: {printable_lines(text)}", "yellow", sys.stderr), file=sys.stderr, flush=True)


def is_json_wanted() -> bool:
    """Tell whether the command was asked for JSON: standard output is for that alone then."""
    return JSON.get({}).get("wanted", False)


def has_printed_json() -> bool:
    """Tell whether nothing more is to be said in JSON: none was asked for, or the command has spoken."""
    return not is_json_wanted() or JSON.get()["printed"]


def print_json(value: Any) -> None:
    """Print ``value`` as JSON: an infinite ε is "full", as in a study file, and null is what JSON has no number for."""
    if is_json_wanted():
        JSON.get()["printed"] = True
    print(printable_json(json.dumps(plain(value), indent=2, ensure_ascii=False, allow_nan=False)), flush=True)


def say(data: Any, *lines: str) -> None:
    """Print what a command has found: ``data`` if JSON was asked for, ``lines`` for people if not."""
    if is_json_wanted():
        print_json(data)
    elif lines:
        print("\n".join(lines), flush=True)


def plain(value: Any, key: str = "") -> Any:
    """Return ``value``, which stands under ``key``, as JSON takes it."""
    if isinstance(value, dict):
        return {name: plain(item, name) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, key) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return "full" if key == "epsilon" and value == inf else None
    return value


class Patient:
    """A stream whose reader may go away: what is then written is dropped, and the command goes on to its end.

    What one cannot see, or the stream has no sign for, is written out. ``fault`` says why else it could not be written:
    a full disk.
    """

    def __init__(self, stream: TextIO):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        self._stream = stream
        self.fault = ""

    def write(self, text: str) -> int:
        """Write ``text``, or drop it."""
        text = printable_lines(text)
        try:
            self._stream.write(text)
        except OSError as error:
            self._drop(error)
        return len(text)

    def flush(self) -> None:
        """Flush, or drop what is left."""
        try:
            self._stream.flush()
        except OSError as error:
            self._drop(error)

    def _drop(self, error: OSError) -> None:
        if not isinstance(error, BrokenPipeError):
            self.fault = error.strerror or str(error)
        # What the buffer still holds must go somewhere when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def make_patient() -> None:
    """Let standard output and error outlive their readers: ``epsmesh plan … | head``.

    Standard error that is a terminal has a bar that moves the cursor, and is left as it is.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not (name == "stderr" and stream.isatty()):
            setattr(sys, name, Patient(stream))


def what_was_not_written() -> str:
    """Flush standard output; say why it could not be written, "" if it was, or if nobody wanted it."""
    if not isinstance(sys.stdout, Patient):
        return ""
    sys.stdout.flush()
    return sys.stdout.fault
