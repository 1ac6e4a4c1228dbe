"""Sections of a study file: tables, arrays of tables, and their sweeps."""

import itertools
from collections import Counter
from collections.abc import Mapping
from math import prod
from typing import Any

from pydantic import ValidationError

from epsmesh.shapes.history import deepest
from epsmesh.shapes.insertion import last_depth
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import specialised
from epsmesh.shapes.section import Section
from epsmesh.study.axis import Axis
from epsmesh.study.grasp import JAW, jaw_of, with_jaws
from epsmesh.study.meant import OTHER_SHAPES, other_name
from epsmesh.study.path import Way, read_path
from epsmesh.study.problems import MOST_ERRORS, Problems, closest, nearest, tuples
from epsmesh.study.ranges import without_ranges
from epsmesh.study.schema import NESTED, SECTIONS, SINGLE
from epsmesh.study.swept import Place, axis_of, placed, sweeps, written
from epsmesh.study.text import check_text

# Limits of a list and of a study. Each case costs a few hundred bytes and a tenth of a millisecond.
_MOST_VALUES = 10_000
# The depth of a tool that a file gives a force of, until one is expected.
ANY_DEPTH = "1 µm"
MOST_CASES = 200_000


def read_section(name: str, raw: Any, problems: Problems) -> tuple[list[Axis], tuple[Section, ...]]:
    """Return the axes of a section and every combination of their values."""
    if name not in SINGLE:
        raw = without_ranges(raw, name, problems)
    if name == "probe":
        raw = with_jaws(_reaching(raw, problems), problems)
        raw, way = _walked(raw, problems)
        axes, variants = _read_tables(name, raw, problems)
        return (_axes_of(way, axes) if way else axes), variants
    return _read_tables(name, raw, problems)


def _reaching(raw: Any, problems: Problems) -> Any:
    """Return the probe's tables with the depth that a table of a history, or an insertion, reaches.

    Where a force is given, the depth is found, and any number takes its place.
    """
    if isinstance(raw, list):
        return [_reaching(table, problems) for table in raw]
    history, insertion = (raw.get(key) if isinstance(raw, dict) else None for key in ("history", "insertion"))
    if isinstance(insertion, dict):
        depth, own = last_depth(insertion), "[probe.insertion]: its last depth is `to`"
    elif isinstance(history, dict) and "table" in history:
        depth, own = deepest(history["table"]), "`table` in [probe.history], which has depths of its own"
    elif isinstance(raw, dict) and "force" in raw:
        depth, own = ANY_DEPTH, "`force`, whose depth is computed: give one of both"
    else:
        return raw
    if "depth" in raw:
        problems.error("probe.depth", raw["depth"], f"excludes {own}")
        return raw
    return raw if depth is None else {**raw, "depth": depth}


def _walked(raw: Any, problems: Problems) -> tuple[Any, Way | None]:
    """Return the probe's tables with the places of the path as a sweep of `at`, and the path, if there is one."""
    tables = raw if isinstance(raw, list) else [raw]
    having = [table for table in tables if isinstance(table, dict) and "path" in table]
    if not having:
        return raw, None
    where = "probe.path" if isinstance(raw, dict) else "probe[1].path"
    if any("at" in table for table in having):
        problems.error(where, None, "excludes `at`: give one of both")
    if len(having) < len(tables) or any(table["path"] != having[0]["path"] for table in having):
        problems.error("probe.path", None, "must be the same in all [[probe]] tables, since it is one sweep")
    way = read_path(having[0]["path"], where, problems)

    def walked(table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        # The sweep's place among the others is the path's.
        return {
            ("at" if k == "path" else k): (way.texts if k == "path" and way else v)
            for k, v in table.items()
            if k != "at" and (k != "path" or way)
        }

    return ([walked(table) for table in raw] if isinstance(raw, list) else walked(raw)), way


def _axes_of(way: Way, axes: list[Axis]) -> list[Axis]:
    """Return the axes; those of a path replace the axis of `at`."""
    own = [Axis("probe", name, labels, "m", off=way.off) for name, labels in way.axes]
    return [new for axis in axes for new in (own if axis.key == "at" else [axis])]


def _read_tables(name: str, raw: Any, problems: Problems) -> tuple[list[Axis], tuple[Section, ...]]:
    """Return the axes of a section, and every combination of their values."""
    if isinstance(raw, list) and name not in SINGLE:
        return _read_array(name, raw, problems)
    if not isinstance(raw, dict):
        problems.error(name, raw, f"must be a table: write [{name}]")
        return [], ()
    raw = _possible(name, raw, problems)
    model = _model(name, raw, problems)
    if model is None or (not raw and name not in SINGLE):
        return [], ()
    swept = {} if name in SINGLE else dict(sweeps(model, raw))
    for place, values in swept.items():
        if not values:
            problems.error(f"{name}.{written(place)}", values, "is an empty list: give at least one value")
        elif len(values) > _MOST_VALUES and place != ("at",):  # places are those of a path, which has its own limit
            problems.error(f"{name}.{written(place)}", None, f"has {len(values)} values: at most {_MOST_VALUES}")
    if not all(0 < len(values) <= _MOST_VALUES or place == ("at",) for place, values in swept.items()):
        return [], ()
    if prod(map(len, swept.values())) > MOST_CASES:
        problems.error(name, None, f"sweeps more than {MOST_CASES} combinations")
        return [], ()
    singles = _validate_each(name, model, raw, swept, problems)
    if singles is None:
        return [], ()
    axes = [
        axis_of(name, place, values, parsed, problems)
        for (place, values), parsed in zip(swept.items(), singles, strict=True)
    ]
    combinations = itertools.product(*swept.values())
    variants = [_validate(model, placed(raw, zip(swept, values, strict=True))) for values in combinations]
    return axes, tuple(variants)


def _read_array(name: str, tables: list[Any], problems: Problems) -> tuple[list[Axis], tuple[Section, ...]]:
    """Read ``[[name]]`` tables: a sweep over the section as a whole, labelled by the names of the tables.

    A key with the same list in all tables is a sweep of that key in each of them.
    """
    variants: list[list[Section]] = []
    read: list[dict[str, Any]] = []
    shared = _shared_sweeps(name, tables)
    if not _is_sane(name, tables, shared, problems):
        return [], ()
    for position, table in enumerate(tables, start=1):
        where = f"{name}[{position}]"
        if not isinstance(table, dict):
            problems.error(where, table, f"must be a table: write [[{name}]]")
            continue
        _check_name(f"{where}.name", table.get("name"), problems)
        table = _possible(name, table, problems, where)  # noqa: PLW2901 (the rest is checked)
        model = _model(name, table, problems, where)
        if model is None:
            continue
        for place, value in sweeps(model, table):
            if place not in shared:
                problems.error(
                    f"{where}.{written(place)}",
                    value,
                    "is a list in one table of an array: write a table for each value, or the same list in all tables",
                )
        try:
            combinations = itertools.product(*shared.values())
            filled = [placed(table, zip(shared, values, strict=True)) for values in combinations]
            variants.append([_validate(model, variant) for variant in filled])
            read.append(table)
        except ValidationError as error:
            problems.from_pydantic(where, error, model, table)
    if len(variants) < len(tables):
        return [], tuple(itertools.chain.from_iterable(variants))  # errors of the others are reported
    names = [first.name for first, *_ in variants]
    for label in sorted(name for name, count in Counter(names).items() if count > 1 and name):
        problems.error(
            f"{name}.name", label, "is the name of several tables: names must differ, since they label the sweep"
        )
    axes = [Axis(name, "", tuple(names), "")]
    if variants and shared:
        # The values do not depend on the table: the first one is read.
        kind, table = type(variants[0][0]), placed(read[0], ((place, given[0]) for place, given in shared.items()))
        for place, values in shared.items():
            parsed = [_validate(kind, placed(table, [(place, value)])) for value in values]
            axes.append(axis_of(name, place, values, parsed, problems))
    return axes, tuple(itertools.chain.from_iterable(variants))


def _check_name(key: str, name: Any, problems: Problems) -> None:
    if not isinstance(name, str) or not name:
        problems.error(key, name, "is required in an array of tables, since it labels the sweep")
    else:
        check_text(key, name, problems)


def _is_sane(name: str, tables: list[Any], shared: dict[Place, list[Any]], problems: Problems) -> bool:
    """Return whether there are tables, and not too many of them or of their sweeps."""
    if not tables:
        problems.error(name, tables, f"is an empty list: write [[{name}]] for each value")
    elif len(tables) > _MOST_VALUES:
        problems.error(name, None, f"has {len(tables)} tables: at most {_MOST_VALUES}")
    elif len(tables) * prod(map(len, shared.values())) > MOST_CASES:
        problems.error(name, None, f"sweeps more than {MOST_CASES} combinations")
    else:
        return True
    return False


def _shared_sweeps(name: str, tables: list[Any]) -> dict[Place, list[Any]]:
    """Return the lists of values that are the same in all tables of an array."""
    found: list[dict[Place, list[Any]]] = []
    for table in tables:
        model = SECTIONS[name]
        if isinstance(table, dict) and isinstance(model, Mapping):
            model = model.get(str(table.get("shape")), model)
        if isinstance(model, Mapping) or not isinstance(table, dict):
            return {}
        found.append(dict(sweeps(model, table)))
    first, *others = found or [{}]
    return {
        place: values
        for place, values in first.items()
        if all(isinstance(step, str) for step in place)
        and values
        and all(other.get(place) == values for other in others)
    }


def _possible(name: str, raw: dict[str, Any], problems: Problems, where: str = "") -> dict[str, Any]:
    """Return a section without its unknown keys, which are reported: the rest is checked all the same."""
    models, shape = SECTIONS[name], raw.get("shape")
    if isinstance(models, Mapping) and (not isinstance(shape, str) or shape not in models):
        return raw  # keys that no shape has are reported with it
    model = models[str(shape)] if isinstance(models, Mapping) else models
    lacking = [key for key in raw if key not in model.model_fields and key != JAW]
    for key in lacking[:MOST_ERRORS]:
        found = None if key in NESTED.get(name, {}) else raw[key]
        problems.unknown(f"{where or name}.{key}", found, _lacking(name, model, str(shape), key))
    if len(lacking) > MOST_ERRORS:
        problems.unknown(where or name, None, f"… and {len(lacking) - MOST_ERRORS} more")
    return {key: value for key, value in raw.items() if key in model.model_fields or key == JAW}


def _lacking(name: str, model: type[Section], shape: str, key: str) -> str:
    """Return the message about an unknown key: shapes that have it, or a similar key."""
    models = SECTIONS[name]
    if meant := other_name(name, key):
        return meant
    if not isinstance(models, Mapping):
        return f"unknown key; {nearest(key, model.model_fields)}"
    article = "an" if shape[0] in "aeiou" else "a"
    if having := _having(models, key):
        return f"{article} {shape} has no {key}: {having}"
    meant = closest(key, [*model.model_fields, *(known for kind in models.values() for known in kind.model_fields)])
    if meant and meant not in model.model_fields:
        return f"unknown key; did you mean `{meant}`? {article} {shape} has none: {_having(models, meant)}"
    return f"unknown key; {nearest(key, model.model_fields)}"


def _having(model: Mapping[str, type[Section]], key: str) -> str:
    """Return which shapes have a key, in words; "" if none has."""
    shapes = [shape for shape, kind in model.items() if key in kind.model_fields]
    if len(shapes) > 1:
        return f"{', '.join(shapes[:-1])} and {shapes[-1]} have"
    return f"{shapes[0]} has" if shapes else ""


def _model(name: str, raw: dict[str, Any], problems: Problems, where: str = "") -> type[Section] | None:
    """Return the model of a section, by its shape; None if the shape is wrong, which is reported.

    Keys that no shape has are reported, too.
    """
    where = where or name
    model = SECTIONS[name]
    if not isinstance(model, Mapping):
        return model
    shape = raw.get("shape")
    if isinstance(shape, str) and shape in model:
        return model[shape]
    supported = ", ".join(model)
    if shape is None:
        if raw:
            problems.error(f"{where}.shape", None, f"is required: one of {supported}")
    elif isinstance(shape, list):
        problems.error(
            f"{where}.shape", shape, f"must be one shape: for a sweep over shapes, write one [[{name}]] for each"
        )
    else:
        meant = OTHER_SHAPES.get(name, {}).get(str(shape).casefold()) or nearest(str(shape), model)
        problems.error(f"{where}.shape", shape, f"unknown shape; {meant}")
    known = dict.fromkeys(key for kind in model.values() for key in kind.model_fields)
    unknown = [key for key in raw if key not in known]
    for key in unknown[:MOST_ERRORS]:
        problems.error(
            f"{where}.{key}",
            raw[key],
            other_name(name, key) or f"unknown key; {nearest(key, known)}",
        )
    if len(unknown) > MOST_ERRORS:
        problems.error(where, None, f"… and {len(unknown) - MOST_ERRORS} more")
    return None


def _validate_each(
    name: str, model: type[Section], raw: dict[str, Any], swept: dict[Place, list[Any]], problems: Problems
) -> list[list[Section]] | None:
    """Validate each value of each sweep once, so that an error is reported once, not for each case."""
    before = len(problems.errors)
    first = placed(raw, ((place, values[0]) for place, values in swept.items()))
    singles: list[list[Section]] = []
    for place, values in swept.items() or {(): [None]}.items():
        singles.append([])
        for value in values:
            candidate = placed(first, [(place, value)]) if place else first
            try:
                singles[-1].append(_validate(model, candidate))
            except ValidationError as error:
                problems.from_pydantic(name, error, model, candidate)
    if len(problems.errors) > before:
        return None
    return singles if swept else []


def _validate(model: type[Section], raw: dict[str, Any]) -> Section:
    found = specialised(model.model_validate({key: tuples(value) for key, value in raw.items() if key != JAW}))
    return found.grasping(jaw_of(raw)) if isinstance(found, Probe) and JAW in raw else found
