"""Sobol's indices of a dataset in words: a table for each output, and which parameter matters most."""

from collections.abc import Iterator
from math import isfinite

import xarray as xr

from epsmesh.quantities import QUANTITIES, readable, symbol, write
from epsmesh.report.words import barred

_ROW = "  {:<24} {:<24} {:>16} {:>16}"


def answer(dataset: xr.Dataset) -> list[str]:
    """Return the lines that tell the indices of all outputs, the parameter that matters most first."""
    lines = [line for output in dataset["output"].values for line in _of_output(dataset.sel(output=output))]
    return [*lines, *_bars(dataset)]


def sentences(dataset: xr.Dataset) -> list[str]:
    """Return in a sentence or two for each output which parameter matters most, and how exact that is."""
    outputs = [ordered(dataset.sel(output=output)) for output in dataset["output"].values]
    return [*map(_concluded, outputs), *_bars(dataset)]


def _bars(dataset: xr.Dataset) -> list[str]:
    """Return what the error bars of F are, and what to do next."""
    return [said] if (said := str(dataset.attrs.get("bars", ""))) else []


def rows_of(dataset: xr.Dataset) -> list[list[str]]:
    """Return a row of words for each output and parameter: output, parameter, range, and both indices."""
    return [row for output in dataset["output"].values for row in _rows(dataset.sel(output=output))]


def share(value: float, error: float) -> str:
    """Write a share and its error bar in per cent."""
    return barred(100 * value, 100 * error, "%")


def ordered(one: xr.Dataset) -> xr.Dataset:
    """Return the indices of one output in the order of the first index, the largest on top."""
    return one.sortby("first", ascending=False)


def range_of(one: xr.Dataset) -> str:
    """Write the range of one parameter, or its mean and error, as people read it."""
    name, unit = str(one["parameter"].values), str(one["unit"].values)
    factor, word = readable(name, unit)
    mean, error = (factor * float(one[part]) for part in ("expected", "expected_error"))
    if isfinite(mean) and isfinite(error):
        return barred(mean, error, word)
    return " to ".join(write(name, float(one[end]), unit) for end in ("low", "high"))


def _of_output(one: xr.Dataset) -> Iterator[str]:
    name, unit = str(one["output"].values), str(one["output_unit"].values)
    letter, mean = symbol(name), write(name, float(one["mean"]), unit)
    yield f"{letter}: mean {mean}, standard deviation {100 * float(one['deviation']):.1f} % of it"
    yield _ROW.format("parameter", "from – to", "alone", "in all")
    yield from (_ROW.format(*row[1:]) for row in _rows(one))
    yield f"  {_concluded(ordered(one))}"


def _rows(one: xr.Dataset) -> Iterator[list[str]]:
    letter, found = symbol(str(one["output"].values)), ordered(one)
    for number in range(found.sizes["parameter"]):
        row = found.isel(parameter=number)
        alone, total = (share(float(row[kind]), float(row[f"{kind}_error"])) for kind in ("first", "total"))
        yield [letter, str(row["parameter"].values), range_of(row), alone, total]


def _concluded(found: xr.Dataset) -> str:
    letter = symbol(str(found["output"].values))
    return f"{_what_matters(found, letter)} Surrogate: {int(found['cases'])} cases, error {percent(found)}."


def _what_matters(found: xr.Dataset, letter: str) -> str:
    """Tell which parameter matters most, if the surrogate is exact enough to tell any."""
    first, is_exact = found.isel(parameter=0), not found["total_error"].any()  # only one parameter acts
    if found["surrogate_error"] >= found["deviation"] and not is_exact:
        return f"{letter} varies by less than the error of the surrogate: its indices are not known."
    name, alone = first["parameter"].values, 100 * float(first["first"])
    return f"{name} matters most: if it were known, {alone:.0f} % of the variance of {letter} would vanish."


def percent(one: xr.Dataset) -> str:
    """Write the error of the surrogate of one output; without error bars of its cases, it is the interpolation's."""
    name, text = str(one["output"].values), f"{100 * float(one['surrogate_error']):.2g} %"
    has_bar = name not in QUANTITIES or f"{name}_error" in QUANTITIES
    return text if has_bar else f"{text} by interpolation, and that of meshes unknown"
