"""Values in the words and units that people use: mm, kPa, mN, per cent."""

from math import inf, isnan
from typing import Any

import numpy as np
import xarray as xr

# Factor and unit of what people do not read in SI.
_DISPLAY = {"m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "N": (1e3, "mN"), "J": (1e6, "µJ"), "bytes": (1e-6, "MB")}
# Numbers without a unit that are read in per cent.
_PER_CENT = ("mesh_accuracy", "force_error", "force_exact_error", "max_strain")
_SYMBOLS = {"epsilon": "ε", "poisson": "ν", "young": "E", "depth": "d", "mesh_accuracy": "accuracy"}
# What an axis of a figure says: shorter than the dataset's long names.
_HEADINGS = {
    "epsilon": "ε-mesh radius ε", "fine": "element size within ε", "coarse": "element size far away",
    "rim": "element size at the rim", "growth": "growth of the element size", "degree": "degree of the elements",
    "young": "Young's modulus E", "poisson": "Poisson's ratio ν", "depth": "depth d",
    "outside": "outside of ε", "probe_radius": "radius of the probe",
}  # fmt: skip


def scale(array: xr.DataArray) -> tuple[float, str]:
    """Return the factor from the array's unit to the one that people read, and that one's name ('': none)."""
    if array.name in _PER_CENT:
        return 100.0, "%"
    return _DISPLAY.get(str(array.attrs.get("units", "")), (1.0, _plain(array)))


def number(array: xr.DataArray, value: Any) -> str:
    """Write one value of ``array`` with its unit: ``10 mm``, ``full``, ``coarse``; '' where there is none."""
    if isinstance(value, str):
        return value
    if value == inf:
        return "full"
    factor, unit = scale(array)
    return "" if isnan(value) else f"{value * factor:.6g} {unit}".rstrip()


def choice(coordinate: xr.DataArray, value: Any) -> str:
    """Write a choice along a dimension: ``ν = 0.45``, ``ε = full``, ``outside free``, or a table's own name."""
    if isinstance(value, str):
        return value if coordinate.name in ("probe", "body") else f"{symbol(coordinate)} {value}"
    return f"{symbol(coordinate)} = {number(coordinate, value)}"


def choices(dataset: xr.Dataset, selection: dict[str, Any]) -> str:
    """Write a choice along several dimensions."""
    return ", ".join(choice(dataset[name], value) for name, value in selection.items())


def symbol(coordinate: xr.DataArray) -> str:
    """Return the letter or the word for a dimension."""
    return _SYMBOLS.get(str(coordinate.name), str(coordinate.name).replace("_", " "))


def heading(coordinate: xr.DataArray) -> str:
    """Return what an axis of a figure says: name and unit."""
    name = str(coordinate.name)
    text = _HEADINGS.get(name) or str(coordinate.attrs.get("long_name", name))
    unit = scale(coordinate)[1]
    return f"{text} ({unit})" if unit else text


def is_numeric(array: xr.DataArray) -> bool:
    """Tell numbers from words."""
    return bool(np.issubdtype(array.dtype, np.number))


def _plain(array: xr.DataArray) -> str:
    unit = str(array.attrs.get("units", ""))
    return "" if unit == "1" else unit
