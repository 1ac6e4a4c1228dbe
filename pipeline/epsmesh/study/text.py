"""The text of a study file, and its TOML, within the limits of any study."""

import re
import tomllib
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic_core import PydanticCustomError

from epsmesh.shapes.files.foreign import why_no_study
from epsmesh.study.problems import Problem, Problems, StudyError
from epsmesh.study.syntax import meant

# A hundred times the longest study with a path of its own points: what is larger is another kind of file.
_MOST_BYTES = 1_000_000
# The deepest place of a study is a coordinate of a cap on a load: section, array, table, list, value.
_DEEPEST = 12
# Parts of a dotted key: the library's time grows with the square of their number.
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){20}""")
# Integers of TOML, and of what is made of them.
LARGEST = 2**63
# Control characters and what turns the direction of writing: on a terminal they make a line say something else.
_NO_STUDY = "is no study: a study file is TOML, and ends in .toml"
_OF_LINE = "must be one line of text without control characters"
_CONTROLS = ("Cc", "Cs", "Zl", "Zp")
_TURNS = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a study file, and the TOML in it.

    Raises:
        StudyError: if it cannot be read, or is no study of a sane size.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise _refused(str(path), "", getattr(error, "strerror", None) or str(error)) from None
    if why := why_no_study(path):
        raise _refused(str(path), "", why)
    _check_size(len(data), str(path))
    try:
        text = data.decode("utf-8-sig")  # some editors begin a file with the mark of its encoding
    except UnicodeDecodeError as error:
        if path.suffix != ".toml":
            raise _refused(str(path), "", _NO_STUDY) from None
        raise _refused(str(path), "", f"is not UTF-8 text: {error}") from None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    try:
        return text, toml_of(text, str(path))
    except StudyError:
        if path.suffix in (".toml", ""):
            raise
        raise _refused(str(path), "", _NO_STUDY) from None


def toml_of(text: str, file: str) -> dict[str, Any]:
    """Return the TOML in the ``text`` of a study; ``file`` is for messages.

    Raises:
        StudyError: if it is none, or no study of a sane size.
    """
    _check_size(len(text), file)
    try:
        if _LONG_KEY.search(text):
            raise _refused(file, "TOML", f"is nested more than {_DEEPEST} levels deep: this is no study")
        raw = tomllib.loads(text)
    except RecursionError:
        raise _refused(file, "TOML syntax", "is nested too deeply") from None
    except ValueError as error:  # besides its own, those of numbers with thousands of digits and of days that are none
        raise _refused(file, "TOML syntax", meant(text, error)) from None
    layer: list[Any] = [raw]
    for _ in range(_DEEPEST):
        if any(isinstance(value, int) and not -LARGEST <= value < LARGEST for value in layer):
            raise _refused(file, "TOML", "has an integer of more than 64 bits: write 1e30 for a large number")
        layer = list(_inside(layer))
    if layer:
        raise _refused(file, "TOML", f"is nested more than {_DEEPEST} levels deep: this is no study")
    return raw


def _check_size(size: int, file: str) -> None:
    if size > _MOST_BYTES:
        raise _refused(file, "", f"is larger than {_MOST_BYTES / 1e6:g} MB: this is no study")


def _refused(file: str, what: str, why: str) -> StudyError:
    return StudyError(file, [Problem(what, None, why)])


def check_text(key: str, text: str, problems: Problems) -> None:
    """Report a text that is not safe to print: one with several lines, control characters, or a reversed direction."""
    if not _is_line(text):
        problems.error(key, text, _OF_LINE)


def one_line(text: str) -> str:
    """Return a text that is safe to print, for a key of a section.

    Raises:
        PydanticCustomError: if it is not.
    """
    if not _is_line(text):
        raise PydanticCustomError("not_supported", _OF_LINE)
    return text


def _is_line(text: str) -> bool:
    return not any(unicodedata.category(letter) in _CONTROLS or letter in _TURNS for letter in text)


def _inside(layer: list[Any]) -> Iterator[Any]:
    """Yield the values in the tables and lists of a layer."""
    for outer in layer:
        if isinstance(outer, dict | list):
            yield from outer.values() if isinstance(outer, dict) else outer
