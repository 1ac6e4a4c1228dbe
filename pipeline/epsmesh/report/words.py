"""Values of a dataset's arrays in the words and units that people use: mm, kPa, mN, per cent."""

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile
from math import floor, isfinite, log10, nan
from typing import Any

import numpy as np
import xarray as xr

from epsmesh import quantities
from epsmesh.report.values import relative

_NOUGHT = 1e-9  # what rounding leaves of no error
_SPAN, _APART = 4, 0.01  # digits of the larger end of a range, and a share of it below which the other has its own
_OF_BAR, _MOST = 2, 7  # digits of an error bar, and of a value at most
# Their values are names of their own, and need not be said what they are.
_NAMES = ("probe", "body", "quantity")
_NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
# Of sizes and semi-axes, the last word of their dimensions' names.
_SIZES = ("size", "axes")
_POINT = re.compile(rf"{_NUMBER} (?P<unit>[a-zµ]+)(?: {_NUMBER} (?P=unit))+\b")
_WORD = re.compile(rf"{_POINT.pattern}|\S+")


def scale(array: xr.DataArray) -> tuple[float, str]:
    """Return the factor from the array's unit to the one that people read, and that one's name ('': none)."""
    return quantities.readable(str(array.name), _unit(array))


def number(array: xr.DataArray, value: Any) -> str:
    """Write one value of ``array`` with its unit: ``10 mm``, ``full``, ``coarse``; '' where there is none."""
    return quantities.write(str(array.name), value, _unit(array))


def choice(coordinate: xr.DataArray, value: Any) -> str:
    """Write a choice along a dimension: ``ν = 0.45``, ``ε = full``, ``outside free``, or a table's own name."""
    if isinstance(value, str):
        return value if coordinate.name in _NAMES else f"{symbol(coordinate)} {lengths(coordinate, value)}"
    return f"{symbol(coordinate)} = {re.sub(r'^-', '−', number(coordinate, value))}"


def percent(share: float) -> str:
    """Write a share as people read it; nothing for what is not known."""
    if not isfinite(share):
        return ""
    if abs(share) < _NOUGHT:
        return "0 %"
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def barred(value: float, bar: float, unit: str = "") -> str:
    """Write a value and its error bar to one decimal place, the bar's second digit: ``31.00 ± 0.25 mN``.

    A value has seven digits at most; what its bar is less than, the bar has of the last. Without a bar it has four.
    """
    if not bar > 0:
        return f"{value:.{_SPAN}g}{' ± 0' if bar == 0 else ''} {unit}".rstrip()
    places = decimals(value, bar)
    return f"{value:.{places}f} ± {max(bar, 10.0**-places):.{places}f} {unit}".rstrip()


def decimals(value: float, bar: float) -> int:
    """Return how many decimals a value and its error bar, which is more than nought, are written with."""
    places, most = (digits - 1 - _power(number) for digits, number in ((_OF_BAR, bar), (_MOST, value or bar)))
    return max(0, min(places, most))


def _power(number: float) -> int:
    """Return the power of ten of the first digit, once rounded."""
    return floor(log10(float(f"{abs(number):.{_OF_BAR - 1}e}")))


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 0.9995 else f"{1e3 * seconds:.3g} ms"


def span(name: str, values: Any, unit: str | None = None, bar: float = nan) -> str:
    """Write the least and the largest value of a quantity with as many decimals: ``25.02 to 31.00 mN``.

    Once if they are the same, and without decimals that both lack; of values that are far apart, each with its own.
    There are no more digits than a relative error ``bar`` of both leaves.
    """
    factor, word = quantities.readable(name, unit)
    low, high = factor * float(np.nanmin(values)), factor * float(np.nanmax(values))
    largest = max(abs(low), abs(high))
    digits = max(1, min(_SPAN, _OF_BAR - 1 - _power(bar))) if bar > 0 else _SPAN
    places = max(0, digits - 1 - floor(log10(largest))) if largest else 0
    ends = [f"{end:.{places}f}" for end in (low, high)]
    while "." in ends[0] and all(end.endswith(("0", ".")) for end in ends):
        ends = [end[:-1] for end in ends]
    if min(abs(low), abs(high)) < _APART * largest:
        ends = [f"{float(f'{end:.{digits}g}'):.6g}" for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {word}".rstrip()


def ranged(dataset: xr.Dataset, name: str) -> str:
    """Write the range of a variable of ``dataset``, to the digits that its largest relative error bar leaves."""
    return span(name, dataset[name], bar=float(relative(dataset, f"{name}_error").max()))


def choices(coordinates: Mapping[Any, xr.DataArray], selection: Mapping[str, Any]) -> str:
    """Write a choice along several dimensions, with the units of ``coordinates``: of a dataset, or its own."""
    known = {name: coordinates[name] if name in coordinates else xr.DataArray(name=name) for name in selection}
    return ", ".join(choice(known[name], value) for name, value in selection.items())


def lengths(coordinate: xr.DataArray, text: str) -> str:
    """Return ``text`` with points, or, of sizes, with products as people write them: ``40 × 40 × 20 mm``."""
    if str(coordinate.name).rsplit("_", 1)[-1] not in _SIZES:
        return points(text)
    return _POINT.sub(lambda found: f"{' × '.join(found[0].split()[::2])} {found['unit']}", text)


def points(text: str) -> str:
    """Return ``text`` with its points as people write them: ``at 0 mm 2 mm -7 mm`` is ``at (0, 2, −7) mm``."""

    def written(found: re.Match[str]) -> str:
        numbers = ", ".join(found[0].split()[::2]).replace("-", "−")
        return f"({numbers}) {found['unit']}"

    return _POINT.sub(written, text)


def without_shared(names: Sequence[str]) -> list[str]:
    """Return ``names`` without the first and the last words that all of them have; a point is one word."""
    words = [[found[0] for found in _WORD.finditer(name)] for name in names]
    most = min(map(len, words)) - 1
    first = min(_shared(words), most)
    last = min(_shared([each[::-1] for each in words]), most - first)
    return [" ".join(each[first : len(each) - last]) for each in words]


def _shared(words: Sequence[list[str]]) -> int:
    """Return how many first words are the same in all."""
    return sum(1 for _ in takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False)))


def symbol(coordinate: xr.DataArray) -> str:
    """Return the letter or the word for a dimension."""
    return quantities.symbol(str(coordinate.name))


def heading(array: xr.DataArray, *, short: bool = False) -> str:
    """Return what an axis of a figure says: name, or where room is ``short`` its symbol, and unit."""
    name = str(array.name)
    known = quantities.quantity_of(name)
    text = (known.axis if known else "") or str(array.attrs.get("long_name", name))
    text, unit = symbol(array) if short else text, scale(array)[1]
    return f"{text}, {unit}" if unit else text


def at_most(error: xr.DataArray) -> str:
    """Write the largest of relative errors, `` (at most 0.08 %)``; '' where none is known."""
    largest = float(error.max())
    return f" (at most {100 * largest:.2g} %)" if np.isfinite(largest) else ""


def is_numeric(array: xr.DataArray) -> bool:
    """Tell numbers from words."""
    return bool(np.issubdtype(array.dtype, np.number))


def _unit(array: xr.DataArray) -> str | None:
    return array.attrs.get("units")
