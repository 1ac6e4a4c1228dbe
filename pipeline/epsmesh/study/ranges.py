"""Ranges of values, ``{from = "0.1 mm", to = "1 mm", steps = 10}``: each becomes the list of its values."""

import re
from itertools import chain, islice
from typing import Any

from epsmesh.study.problems import Problems
from epsmesh.units import canonical

KEYS = ("from", "to", "steps")
MOST_STEPS = 10_000
EXAMPLE = '{from = "0.1 mm", to = "1 mm", steps = 10}'
# Tables whose values can be swept.
_TABLES = ("history", "sine", "spread", "young")
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def without_ranges(raw: Any, where: str, problems: Problems) -> Any:
    """Return a section, or an array of its tables, with a list of values for each range; ``where`` is for messages.

    A list may hold ranges among other values: ``[{from = "4 mm", to = "10 mm", steps = 4}, "full"]``. A range that is
    wrong is reported; the rest of the section is then checked with its first value. Paths have ranges of their own.
    """
    if isinstance(raw, list):
        return [without_ranges(table, f"{where}[{number}]", problems) for number, table in enumerate(raw, start=1)]
    if not isinstance(raw, dict):
        return raw
    found: dict[str, Any] = {}
    for key, value in raw.items():
        place, parts = f"{where}.{key}", value if isinstance(value, list) else [value]
        if key != "path" and any(map(_is_range, parts)):
            several = (_values(part, place, problems) if _is_range(part) else [part] for part in parts)
            found[key] = [*islice(chain.from_iterable(several), MOST_STEPS + 1)]  # one more is reported as too many
        elif any(isinstance(part, dict) for part in parts) and (isinstance(value, list) or key in _TABLES):
            found[key] = without_ranges(value, place, problems)
        else:
            found[key] = value
    return found


def _is_range(value: Any) -> bool:
    return isinstance(value, dict) and "from" in value


def _values(table: dict[str, Any], place: str, problems: Problems) -> list[Any]:
    """Return the values of a range as a study would list them; the first one if the range is wrong."""
    start, end, steps = (table.get(key) for key in KEYS)
    if set(table) != set(KEYS):
        problems.error(place, table, f"a range has the keys from, to and steps: {EXAMPLE}")
        return [start]
    if isinstance(steps, bool) or not isinstance(steps, int) or not 2 <= steps <= MOST_STEPS:
        problems.error(f"{place}.steps", steps, f"must be a whole number from 2 to {MOST_STEPS}; both ends count")
        return [start]
    if isinstance(start, str) and isinstance(end, str):
        first, last = _QUANTITY.fullmatch(start), _QUANTITY.fullmatch(end)
        if first and last and first[2] == last[2]:
            values = _spread(float(first[1]), float(last[1]), steps)
            return [f"{value:.12g} {first[2]}".rstrip() for value in values]
    elif isinstance(start, float | int) and isinstance(end, float | int) and bool not in (type(start), type(end)):
        values = _spread(float(start), float(end), steps)
        is_whole = isinstance(start, int) and all(map(float.is_integer, values))
        return list(map(int, values)) if is_whole else values
    problems.error(place, table, f"from and to must be two numbers, or two quantities of one unit: {EXAMPLE}")
    return [start]


def _spread(start: float, end: float, steps: int) -> list[float]:
    """Return ``steps`` numbers at equal distances, both ends among them."""
    return [canonical(start + (end - start) * number / (steps - 1)) for number in range(steps)]
