"""Sweeps of a section: lists of values, their places in the file, and the axes that they become."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import BaseModel

from epsmesh.shapes.section import Section
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.axis import Axis
from epsmesh.study.problems import Problems, nested_model, table_model, unit_of

# Place of a value within a section: keys, and numbers in arrays of tables, from 0.
Place = tuple[str | int, ...]


def sweeps(model: type[BaseModel], raw: dict[str, Any], where: Place = ()) -> Iterator[tuple[Place, list[Any]]]:
    """Yield place and values of every sweep of a section, and of the arrays of tables within it."""
    for key, value in raw.items():
        inner = nested_model(model, key)
        if inner is not None:
            for number, table in enumerate(value if isinstance(value, list) else ()):
                if isinstance(table, dict):
                    yield from sweeps(inner, table, (*where, key, number))
        elif (table := table_model(model, key)) is not None and isinstance(value, dict):
            yield from sweeps(table, value, (*where, key))
        elif _is_sweep(model, key, value):
            yield (*where, key), value


def placed(raw: Any, values: Iterable[tuple[Place, Any]]) -> Any:
    """Return ``raw`` with each value at its place."""
    for (key, *rest), value in values:
        inner = placed(raw[key], [(tuple(rest), value)]) if rest else value
        raw = raw.copy()
        raw[key] = inner
    return raw


def _is_sweep(model: type[BaseModel], key: str, value: Any) -> bool:
    """Tell a list of values from a list that is one value (a point, a size)."""
    if not isinstance(value, list):
        return False
    info = model.model_fields.get(key)
    kinds = () if info is None else (info.annotation, *getattr(info.annotation, "__args__", ()))
    lists = [kind.__args__ for kind in kinds if getattr(kind, "__origin__", None) is tuple]
    if any(getattr(items[0], "__origin__", None) is tuple for items in lists):
        return False  # rows of a table
    if lists:
        return bool(value) and isinstance(value[0], list)
    return info is not None and key not in ("name", "shape")


def axis_of(section: str, place: Place, raw: list[Any], parsed: list[Section], problems: Problems) -> Axis:
    """Return the axis of a sweep: its values as given, its unit, and the table that it is in."""
    *outer, key = place
    owners = [_at(item, outer) for item in parsed]
    within = [_at(parsed[0], outer[: end + 1]) for end in range(len(outer))]
    names = [one.name for one in within if isinstance(one, Section) and one.name]
    values = [getattr(owner, str(key)) for owner in owners]
    unit = unit_of(type(owners[0]), str(key))
    if isinstance(values[0], tuple):
        labels = [" ".join(str(part) for part in value) for value in raw]
    elif any(isinstance(value, dict) for value in raw):
        labels = [_labelled(value) if isinstance(value, dict) else value for value in raw]
    else:
        labels = values
    for label, count in Counter(labels).items():
        if count > 1:
            problems.error(f"{section}.{written(place)}", raw[labels.index(label)], "is in the list more than once")
    if unit == "" and all(isinstance(label, float | int) for label in labels):
        unit = "1"
    if not outer:
        return Axis(section, str(key), tuple(labels), unit)
    return Axis(section, str(key), tuple(labels), unit, written(tuple(outer)), "_".join(names))


def _labelled(table: dict[str, Any]) -> str:
    """Write a table as a label: its keys and values, lists as their parts."""
    return " ".join(f"{k} {' '.join(map(str, v)) if isinstance(v, list) else v}" for k, v in table.items())


def _at(section: Any, place: list[str | int]) -> Any:
    """Return the value at a place within a section."""
    for step in place:
        if step == "young" and isinstance(section, Tissue):  # of the table that takes its place
            section = section.varying
            continue
        section = section[step] if isinstance(step, int) else getattr(section, step)
    return section


def written(place: Place) -> str:
    """Write a place as messages do: ``layer[2].young``."""
    return "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in place).removeprefix(".")
