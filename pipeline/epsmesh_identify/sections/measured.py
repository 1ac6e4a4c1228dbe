"""What a study of measured curves need not declare: meshes, the tool's depth, and values of what is to be found."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from math import sqrt
from typing import Any

from pydantic_core import PydanticCustomError

from epsmesh.extensions import Filled
from epsmesh.study.plausible import UNSAID
from epsmesh.study.problems import Problem
from epsmesh.units import parse_quantity

# The mesh with which a scene without one is checked: forces over the ranges of unknowns have meshes of their own.
_MESH = {"accuracy": "1 %"}
# The command that does without what the cases lack.
_DOES = "epsmesh identify"
OF_ONE_FORCE = "[[measurement]], [identify] and [sensitivity]"
"""The sections that are of one force of a case, as messages name them."""

# Values of what has no range yet: forces are proportional to the one, and the default range has the other in it.
_ANY = {"young": "10 kPa", "poisson": 0.4}
_UNITS = {"young": "Pa", "thickness": "m"}
_ABSENT = "is required for the study's cases; only `epsmesh identify` does without it"
_OF_MEASUREMENTS = (
    "is that of each measurement, and required for the study's cases; only `epsmesh identify` does without it"
)
_BOTH = (
    "is found from the curves; material.{key} is not used for that, but for the study's cases and `epsmesh plan --next`"
)
_VALUES = "has no value of what [identify] is to find; only `epsmesh identify` does without it"


def completed(study: Filled) -> Filled:
    """Return a study with the mesh, the depth and the values that it leaves out, and what its cases lack, as errors."""
    whole, lacking = _completed(study.whole)
    given, _ = _completed(study.given)
    whole.setdefault("mesh", _MESH)
    return replace(
        study,
        given=given,
        whole=whole,
        lacking=(*study.lacking, *lacking),
        doubts=tuple(_declared_too(study.given)),
        does=_DOES,
        of_one_force=OF_ONE_FORCE,
    )


def _declared_too(raw: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield a warning for each value of the material of which [identify] has a range, too."""
    material, identify = raw.get("material"), raw.get("identify")
    if isinstance(material, dict) and isinstance(identify, dict):
        for key in material.keys() & identify.keys() & _ANY.keys():
            yield Problem(f"identify.{key}", None, _BOTH.format(key=key))


def with_borrowed(study: Filled) -> Filled:
    """Return a study with the sections that it leaves out since every measurement has its own."""
    own = borrowed(study.given)
    lacking = tuple(Problem(f"[{section}]", None, _OF_MEASUREMENTS) for section in own)
    whole, where = {**study.whole, **own}, dict.fromkeys(own, "measurement[1]")
    return replace(study, whole=whole, lacking=(*study.lacking, *lacking), borrowed={**study.borrowed, **where})


def _completed(raw: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Problem, ...]]:
    """Return a study with the depth and the values that it leaves out, and what its cases lack, as errors."""
    found = dict(raw)
    lacking = [] if "mesh" in raw else [Problem("[mesh]", None, _ABSENT)]
    values = _values(raw)
    if "probe" in raw:
        found["probe"] = _each(raw["probe"], _pressed)
    if "body" in raw:
        found["body"] = _each(raw["body"], lambda body: _with_pieces(body, values))
    if isinstance(material := raw.get("material", {}), dict) and ("material" in raw or not _has_pieces(raw)):
        found |= {"material": own} if (own := _filled(material, "", values)) else {}
    remedies = {"probe": ("probe.depth", _ABSENT), "body": ("[body]", _VALUES), "material": ("[material]", _VALUES)}
    changed = (remedies[section] for section in remedies if found.get(section) != raw.get(section))
    return found, (*lacking, *(Problem(key, None, why) for key, why in changed))


def borrowed(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sections that a study leaves out since every measurement has its own: those of the first one."""
    tables = raw.get("measurement")
    if not (isinstance(tables, list) and tables and all(isinstance(table, dict) for table in tables)):
        return {}
    sections = [key for key in ("body", "probe") if key not in raw]
    return {key: tables[0][key] for key in sections if all(isinstance(table.get(key), dict) for table in tables)}


def _each(tables: Any, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Any:
    """Return a section with every table of it changed."""
    if isinstance(tables, list):
        return [change(table) if isinstance(table, dict) else table for table in tables]
    return change(tables) if isinstance(tables, dict) and tables else tables


def _pressed(probe: dict[str, Any]) -> dict[str, Any]:
    """Return a probe with a depth to be checked with: forces are computed to that of the curves.

    Those of a table of a history, and of an insertion, are their own. A given force has one, too; it is refused.
    """
    history = probe.get("history")
    has_depth = bool({"insertion", "force"} & probe.keys()) or (isinstance(history, dict) and "table" in history)
    return probe if has_depth else {"depth": UNSAID} | probe


def _with_pieces(body: dict[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a body whose layers and inclusions have the values of their names."""
    kinds = [kind for kind in ("layer", "inclusion") if isinstance(body.get(kind), list)]
    return body | {
        kind: _each(body[kind], lambda piece: _filled(piece, f"{piece.get('name', '')}_", values)) for kind in kinds
    }


def _filled(table: dict[str, Any], prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table of a tissue with the values that it lacks."""
    keys = (*_ANY, "thickness") if prefix else _ANY
    return {key: values[f"{prefix}{key}"] for key in keys if f"{prefix}{key}" in values} | table


def _has_pieces(raw: Mapping[str, Any]) -> bool:
    """Return whether a body has layers or inclusions."""
    bodies = raw.get("body")
    tables = bodies if isinstance(bodies, list) else [bodies]
    return any(isinstance(table, dict) and ("layer" in table or "inclusion" in table) for table in tables)


def _values(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return a value of each parameter of [identify], as a study has it: about the middle of its range."""
    identify = raw.get("identify", {})
    if not isinstance(identify, dict):
        return {}
    asked = identify.get("unknown", [])
    names = [name for name in asked if isinstance(name, str)] if isinstance(asked, list) else []
    ranges = {key: given for key, given in identify.items() if key not in ("unknown", "may_hide")}
    if not _has_pieces(raw):
        names += [] if names or ranges else ["young"]
        ranges = {name: None for name in names if name in _ANY} | ranges
    return {name: _value(name.rpartition("_")[2], given) for name, given in ranges.items()}


def _value(key: str, given: Any) -> Any:
    """Return a value of a range, or of a value with an error; what is none of both is reported with [identify]."""
    if isinstance(given, dict) and "value" in given:
        return given["value"]
    unit = _UNITS.get(key)
    try:
        low, high = given
        if unit is None:
            return (low + high) / 2
        return f"{sqrt(parse_quantity(low, unit) * parse_quantity(high, unit)):.6g} {unit}"
    except (TypeError, ValueError, PydanticCustomError):
        return _ANY.get(key)
