"""Output of the command line: colour on a terminal, plain text or JSON elsewhere; a closed pipe ends no command."""

import json
import os
import re
import shutil
import sys
import textwrap
from contextvars import ContextVar
from io import TextIOWrapper
from math import inf, isfinite
from typing import Any, TextIO

from epsmesh.launcher import is_first_rank
from epsmesh.printable import printable_json, printable_lines

# For the running command: whether the user wants JSON, and whether any was printed.
JSON: ContextVar[dict[str, bool]] = ContextVar("JSON")
_COLOURS = {"red": "31", "yellow": "33"}
# What comes before the text of a line: its indentation, and columns apart from it.
_BEFORE = re.compile(r"( *)(?:.*\S {2,})?")


def paint(text: str, colour: str, stream: TextIO) -> str:
    """Return ``text`` in a colour if ``stream`` is a terminal and NO_COLOR is not set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\033[{_COLOURS[colour]}m{text}\033[0m"


def fitted(text: str, stream: TextIO) -> str:
    """Return ``text`` with lines as wide as the terminal that ``stream`` is, broken between words; else as it is."""
    if not stream.isatty():
        return text
    lines, width = [], shutil.get_terminal_size().columns
    wrapper = textwrap.TextWrapper(width, break_long_words=False, break_on_hyphens=False)
    for line in text.split("\n"):
        before = _BEFORE.match(line)
        hang = (before.end() if before.end() <= width // 2 else before.end(1) + 2) if before else 0
        wrapper.subsequent_indent = hang * " "
        lines.append(wrapper.fill(line))
    return "\n".join(lines)


def tell(text: str) -> None:
    """Print a text for people, which fits the terminal."""
    print(fitted(text, sys.stdout))


def error(text: str) -> None:
    """Print to standard error, in red."""
    print(paint(fitted(printable_lines(text), sys.stderr), "red", sys.stderr), file=sys.stderr, flush=True)


def warning(text: str) -> None:
    """Print a warning to standard error, in yellow."""
    text = fitted(f"warning: {printable_lines(text)}", sys.stderr)
    print(paint(text, "yellow", sys.stderr), file=sys.stderr, flush=True)


def is_json_wanted() -> bool:
    """Return whether the command has --json: standard output is then one JSON value."""
    return JSON.get({}).get("wanted", False)


def has_printed_json() -> bool:
    """Return whether no JSON is left to print: the command has no --json, or has printed its value."""
    return not is_json_wanted() or JSON.get()["printed"]


def print_json(value: Any) -> None:
    """Print ``value`` as JSON. An infinite ε becomes "full", as in a study file; NaN and other infinities, null."""
    if is_json_wanted():
        JSON.get()["printed"] = True
    print(printable_json(json.dumps(plain(value), indent=2, ensure_ascii=False, allow_nan=False)), flush=True)


def say(data: Any, *lines: str) -> None:
    """Print a command's result on the first rank: ``data`` as JSON with --json, else ``lines``."""
    if not is_first_rank():
        return
    if is_json_wanted():
        print_json(data)
    elif lines:
        print("\n".join(lines), flush=True)


def plain(value: Any, key: str = "") -> Any:
    """Return ``value``, found under ``key``, as JSON types: numbers of numpy, too."""
    if hasattr(value, "dtype") and not value.ndim:
        value = value.item()
    if isinstance(value, dict):
        return {name: plain(item, name) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, key) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return "full" if key == "epsilon" and value == inf else None
    return value


class Patient:
    """A stream whose reader may close it early: later text is dropped, and the command continues.

    Control characters, and characters outside the stream's encoding, are written as escapes. ``fault`` is any other
    reason why text could not be written, such as a full disk.
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
        """Flush, or drop the rest."""
        try:
            self._stream.flush()
        except OSError as error:
            self._drop(error)

    def _drop(self, error: OSError) -> None:
        if not isinstance(error, BrokenPipeError):
            self.fault = error.strerror or str(error)
        # Python flushes the buffer at exit: the null device accepts it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def make_patient() -> None:
    """Let commands continue when a reader closes standard output or error: ``epsmesh plan … | head``.

    Standard error on a terminal stays as it is: the progress bar moves the cursor.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not (name == "stderr" and stream.isatty()):
            setattr(sys, name, Patient(stream))


def what_was_not_written() -> str:
    """Flush standard output; return why it could not be written, "" if it was or its reader closed it."""
    if not isinstance(sys.stdout, Patient):
        return ""
    sys.stdout.flush()
    return sys.stdout.fault
