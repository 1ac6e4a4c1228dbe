"""Text in a figure: how wide it is, where it breaks, and how a name that is too long is shortened."""

import re
import warnings
from collections.abc import Sequence
from functools import lru_cache

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

# Letters of a name that a figure shows whole; of a longer one it shows the beginning and the last word, or its end.
_LONG, _WORD, _END = 34, 12, 7
_CUT = "…"
_POINTS = 72.0  # in an inch


@lru_cache(maxsize=4096)
def width_of(text: str, size: float, *, bold: bool = False) -> float:
    """Return the width (inches) of a line of ``text`` in letters of ``size`` points."""
    properties = FontProperties(size=size, weight="bold" if bold else "normal")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # signs that the font lacks are told of as they are drawn
        width, _, _ = text_to_path.get_text_width_height_descent(_seen(text), properties, ismath=False)
    return float(width) / _POINTS


def wrapped(text: str, width: float, size: float, *, bold: bool = False, most: int = 0) -> str:
    """Break ``text`` into lines no wider than ``width`` inches, within a word where it has to be.

    Of more than ``most`` lines, if it is given, the last one ends in "…".
    """
    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".strip()
        if width_of(joined, size, bold=bold) <= width:
            lines[-1] = joined
            continue
        pieces = _pieces(word, width, size, bold=bold)
        lines[-1:] = [*filter(None, lines[-1:]), *pieces]
    if most and len(lines) > most:
        last = re.findall(r"\\\$|.", lines[most - 1])
        while last and width_of("".join(last) + _CUT, size, bold=bold) > width:
            last.pop()
        lines = [*lines[: most - 1], "".join(last).rstrip(" ,;") + _CUT]
    return "\n".join(lines)


def fits(text: str, width: float, size: float) -> bool:
    """Tell whether no word of ``text`` is wider than ``width`` inches."""
    return all(width_of(word, size) <= width for word in text.split())


def shortened(names: Sequence[str], most: int = _LONG) -> list[str]:
    """Return ``names`` with "…" in the middle of those of more than ``most`` letters, different from one another."""
    found: list[str] = []
    for name in names:
        short = name if len(name) <= most else _without_middle(name, most)
        again = sum(other == short or other.startswith(f"{short} (") for other in found)
        found.append(f"{short} ({again + 1})" if again and len(name) > most else short)
    return found


def _without_middle(name: str, most: int) -> str:
    last = name.rsplit(maxsplit=1)[-1]
    end = last if len(last) <= _WORD else last[-_END:]
    begin = name[: most - len(end) - 1]
    whole = begin[: begin.rfind(" ")] if " " in begin[-_END:] and name[len(begin)] != " " else begin
    return f"{whole.rstrip(' ,;')}{_CUT}{end}"


def _pieces(word: str, width: float, size: float, *, bold: bool) -> list[str]:
    """Break a word into pieces that fit; a sign that is written as two stays whole."""
    pieces = [""]
    for sign in re.findall(r"\\\$|.", word):
        if pieces[-1] and width_of(pieces[-1] + sign, size, bold=bold) > width:
            pieces.append("")
        pieces[-1] += sign
    return pieces


def _seen(text: str) -> str:
    """Return what is seen of ``text``: signs of formulas are not."""
    return re.sub(r"(?<!\\)\$|_\{|\}|\\(?=\$)", "", text)
