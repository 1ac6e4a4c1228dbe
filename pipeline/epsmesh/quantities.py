"""What is swept, measured and reported: unit, meaning and symbol of each quantity, in one table.

The long names and units of a dataset, the labels of the command line, the words of guide, figures and pages: all of
them are from here. Values are SI; people read mm, kPa, mN and per cent.
"""

import tomllib
from dataclasses import dataclass, replace
from math import inf, isnan, pi
from pathlib import Path
from typing import Literal

Value = float | int | str

# Strain goes like r^-½ at an edge: ``max_strain`` is read no nearer to one than this, in half widths of the probe.
CLEAR = 0.1


@dataclass(frozen=True)
class Quantity:
    """A dimension or a variable of a dataset.

    ``unit`` is SI's, "1" for plain numbers and "" for words; ``meaning`` is the long name in a dataset. ``symbol``
    stands for it where room is short (without one, its name does), ``axis`` at the axis of a figure (without one, its
    meaning). ``finest`` says at which end of its values the mesh is the finest.
    """

    name: str
    unit: str
    meaning: str
    symbol: str = ""
    axis: str = ""
    in_per_cent: bool = False
    finest: Literal["smallest", "largest", ""] = ""


def _table(*quantities: Quantity) -> dict[str, Quantity]:
    """Return quantities by name: a dataset has one namespace, so that no two may share a name."""
    table: dict[str, Quantity] = {}
    for quantity in quantities:
        if quantity.name in table:
            raise ValueError(f"two quantities of a dataset are called {quantity.name}")
        table[quantity.name] = quantity
    return table


def _read(section: str) -> tuple[Quantity, ...]:
    return tuple(Quantity(name=name, **content) for name, content in _TABLE[section].items())


_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_MESH, _LARGEST, _OF_PIECES = _read("mesh"), _read("largest"), _read("piece")
_RUN = _read("run")
_RESULTS = (*_read("result"), *_RUN, *_LARGEST)
QUANTITIES = _table(*_MESH, *_read("scene"), *_RESULTS)
# Names of the dataset's own variables and coordinates: no swept input may have them as its dimension.
RESERVED = frozenset(quantity.name for quantity in _RESULTS)
STRESSES = frozenset(quantity.name for quantity in _LARGEST if quantity.unit == "Pa")
LARGEST = tuple(quantity.name for quantity in _LARGEST)
# Variables of a dataset's group ``run``.
RUN = tuple(quantity.name for quantity in _RUN)
MESH_DIMENSIONS = tuple(quantity.name for quantity in _MESH)

# Factor and unit of what people do not read in SI.
_READ = {
    "m": (1e3, "mm"),
    "Pa": (1e-3, "kPa"),
    "N": (1e3, "mN"),
    "J": (1e6, "µJ"),
    "bytes": (1e-6, "MB"),
    "m2": (1e6, "mm²"),
    "J/m^2": (1.0, "J/m²"),
    "m-1": (1.0, "1/m"),
    "rad": (180 / pi, "°"),
    "1": (1.0, ""),
}


def quantity_of(name: str) -> Quantity | None:
    """Return the quantity of that name, those of layers and inclusions, too; None if there is none."""
    if name in QUANTITIES:
        return QUANTITIES[name]
    ends = [quantity for quantity in _OF_PIECES if name.endswith(f"_{quantity.name}")]
    if not ends:
        return None
    found = max(ends, key=lambda quantity: len(quantity.name))
    owner = name.removesuffix(f"_{found.name}")
    symbol, axis = (f"{text} of {owner}" if text else "" for text in (found.symbol or found.name, found.axis))
    return replace(found, name=name, meaning=f"{found.meaning} of {owner}", symbol=symbol, axis=axis)


def attributes(name: str) -> dict[str, str]:
    """Return the attributes of a variable in a dataset: long name and, of numbers, units."""
    quantity = QUANTITIES[name]
    units = {"units": quantity.unit} if quantity.unit else {}
    return {**units, "long_name": quantity.meaning}


def readable(name: str, unit: str | None = None) -> tuple[float, str]:
    """Return the factor from a quantity's unit to the one that people read, and that one's name ("": none).

    ``unit`` is for a quantity that the table may not hold; without either, a value is written as it is.
    """
    quantity = quantity_of(name)
    if quantity and quantity.in_per_cent:
        return 100.0, "%"
    if unit is None:
        unit = quantity.unit if quantity else ""
    return _READ.get(unit, (1.0, unit))


def write(name: str, value: Value, unit: str | None = None) -> str:
    """Write a value as people read it: ``10 mm``, ``12 kPa``, ``5 %``, ``full``, ``stick``; "" for what is unknown."""
    if isinstance(value, str):
        return value
    if value == inf:
        return "stick" if name.endswith("friction") else "full"
    factor, word = readable(name, unit)
    return "" if isnan(value) else f"{value * factor:.6g} {word}".rstrip()


def symbol(name: str) -> str:
    """Return the letter or the word for a quantity."""
    quantity = quantity_of(name)
    return (quantity.symbol if quantity else "") or name.replace("_", " ")
