"""Results as a person reads them, and as a program does."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from math import isfinite

from pipeline.verify.stress.cell import Result

_LINE = "{:8} {:30} {:56} {:>12} {:>12} {:>5} {:>8} {:>6}  {}"
_LONGEST = 110  # characters of a message in the table; the JSON has all of it


def heading() -> str:
    """Return the names of the columns."""
    return _LINE.format("", "row", "value", "error", "bar", "its", "dofs", "s", "").rstrip()


def line(result: Result) -> str:
    """Return one line of the table."""
    message = result.message if len(result.message) <= _LONGEST else result.message[: _LONGEST - 1] + "…"
    return _LINE.format(
        result.status,
        result.row,
        result.value,
        _relative(result.error, "+"),
        _relative(result.bar),
        result.iterations,
        result.dofs,
        f"{result.seconds:.1f}",
        message,
    ).rstrip()


def _relative(value: float, sign: str = "") -> str:
    if not isfinite(value):
        return ""
    return f"{100 * value:{sign}.4f} %" if abs(value) >= 1e-6 or value == 0 else f"{value:{sign}.0e}"


def summary(results: Sequence[Result]) -> str:
    """Return the counts, and how many of the failures are wrong numbers."""
    counts = {s: sum(r.status == s for r in results) for s in ("pass", "refused", "skipped", "FAIL")}
    wrong = sum(r.wrong for r in results)
    words = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    return f"{len(results)} cells: {words}; {wrong or 'no'} wrong number{'' if wrong == 1 else 's'} with a good status"


def table(results: Iterable[Result]) -> str:
    """Return the whole table."""
    found = list(results)
    return "\n".join([heading(), *map(line, found), summary(found)])


def to_json(results: Iterable[Result]) -> str:
    """Return a JSON list with an object for each result; what is not a number is null."""
    rows = [
        {key: None if isinstance(value, float) and not isfinite(value) else value for key, value in asdict(r).items()}
        for r in results
    ]
    return json.dumps(rows, indent=2, ensure_ascii=False)
