"""``[probe.path]``: the places along which a probe moves, and the numbers that the dataset calls them by."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise, product
from math import cos, dist, pi, prod, sin
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from pipeline.shapes.section import Section, Words, in_mm
from pipeline.study.problems import Problems, nearest
from pipeline.units import Coordinate, Length, canonical

# Digits behind the point of a metre: what is less is rounding of sines and of shares of a line.
_DIGITS = 12
_MOST = 20_000  # places; more is a slip of the pen

Point = tuple[float, ...]


def _two_or_three(point: Point) -> Point:
    if len(point) not in (2, 3):
        raise PydanticCustomError("not_supported", 'must be a list of 2 or 3 lengths, such as ["5 mm", "0 mm"]')
    return point


Place = Annotated[tuple[Coordinate, ...], AfterValidator(_two_or_three)]
Steps = Annotated[int, Field(ge=2, le=_MOST)]


class Line(Section):
    """Places at equal distances on a straight line, both ends among them."""

    start: Annotated[Place, Field(alias="from")]
    to: Place
    steps: Steps


class Circle(Section):
    """Places at equal distances on a level circle, the first one along x from its centre."""

    centre: Place
    radius: Length
    steps: Steps


class Range(Section):
    """Coordinates at equal distances, both ends among them."""

    start: Annotated[Coordinate, Field(alias="from")]
    to: Coordinate
    steps: Steps


class Raster(Section):
    """All places of a grid, seen from above."""

    x: Annotated[tuple[Coordinate, ...], Field(min_length=2, max_length=_MOST)] | Range
    y: Annotated[tuple[Coordinate, ...], Field(min_length=2, max_length=_MOST)] | Range


_POINT = "two coordinates, of the highest point there, or three, from which the nearest point of the surface is taken"


class Path(Section):
    """The section as a study's author sees it: one of its forms, and what becomes of places off the body."""

    line: Annotated[
        Line | None,
        Words(
            f"Places on a straight line: `from` and `to` ({_POINT}), and `steps`, the number of places, both ends "
            "among them. The dimension `path` is the length along it.",
            '{ from = ["-12 mm", "0 mm"], to = ["12 mm", "0 mm"], steps = 7 }',
            default="one of line, circle, raster and points is required",
        ),
    ] = None
    circle: Annotated[
        Circle | None,
        Words(
            "Places on a level circle: `centre`, `radius`, and `steps`, the number of places all round, the first one "
            "along x. The dimension `path` is the length along it.",
            '{ centre = ["0 mm", "0 mm"], radius = "8 mm", steps = 8 }',
            default="none",
        ),
    ] = None
    raster: Annotated[
        Raster | None,
        Words(
            "All places of a grid: `x` and `y`, each a rising list, or a table of `from`, `to` and `steps`. They are "
            "the dimensions `x` and `y`.",
            '{ x = ["-5 mm", "0 mm", "5 mm"], y = { from = "-6 mm", to = "6 mm", steps = 5 } }',
            default="none",
        ),
    ] = None
    points: Annotated[
        tuple[Place, ...] | None,
        Words(
            "Places one by one. The dimension `path` is the length from the first one, straight from place to place.",
            '[["0 mm", "0 mm"], ["3 mm", "0 mm"], ["8 mm", "2 mm"]]',
            default="none",
        ),
    ] = None
    off: Annotated[
        Literal["refuse", "lost"],
        Words(
            "What becomes of places where the tool cannot stand: they are refused, or contact is `lost` there: nought "
            "where the tool is clear of the body, no force, and why, where it would stand over an edge.",
            '"lost"',
        ),
    ] = "refuse"


_FORMS: dict[str, type[Section] | None] = {"line": Line, "circle": Circle, "raster": Raster, "points": None}


@dataclass(frozen=True)
class Way:
    """Places (m) of a path, and the names and numbers (m) of the dimensions that they are arranged in.

    Of several dimensions the last one changes fastest. ``off`` says what becomes of places off the body.
    """

    places: tuple[Point, ...]
    axes: tuple[tuple[str, tuple[float, ...]], ...]
    off: str

    @property
    def texts(self) -> list[list[str]]:
        """The places as they would stand in a study file."""
        return [[f"{c!r} m" for c in place] for place in self.places]


def read_path(raw: Any, where: str, problems: Problems) -> Way | None:
    """Return the way that the table ``raw`` describes, or None where it has problems, which are reported.

    ``where`` is the table's place in the study file.
    """
    before = len(problems.errors)
    forms = _forms_of(raw, where, problems)
    if len(problems.errors) > before:
        return None
    (form,) = forms
    try:
        path = Path.model_validate({key: _tuples(value) for key, value in raw.items()})
    except ValidationError as error:
        _report(error, raw, where, problems)
        return None
    if path.raster is not None:
        count = prod(v.steps if isinstance(v, Range) else len(v) for v in (path.raster.x, path.raster.y))
        if count > _MOST:
            problems.error(f"{where}.{form}", None, f"has {count} places: at most {_MOST} are allowed")
            return None
    way = _way_of(path, form)
    _check(way, raw[form], f"{where}.{form}", problems)
    return None if len(problems.errors) > before else way


def _forms_of(raw: Any, where: str, problems: Problems) -> list[str]:
    """Return the one form that a path has; report what else is wrong with its tables' keys."""
    if not isinstance(raw, dict):
        problems.error(where, raw, f"must be a table: write [{where}] and one of {', '.join(_FORMS)}")
        return []
    forms = [key for key in raw if key in _FORMS]
    for key in raw:
        if key not in Path.model_fields or key == "name":
            problems.error(f"{where}.{key}", raw[key], f"unknown key; {nearest(key, [*_FORMS, 'off'])}")
    if len(forms) != 1:
        found = f"has {' and '.join(forms)}" if forms else "has no place"
        problems.error(where, None, f"{found}: give one of {', '.join(_FORMS)}")
    for form in forms:
        model, table = _FORMS[form], raw[form]
        if model is None:
            if not isinstance(table, list) or len(table) < 2:
                problems.error(f"{where}.{form}", table, "must be a list of two places at least; for one, use `at`")
            continue
        _check_keys(table, model, f"{where}.{form}", problems)
        for key in ("x", "y") if model is Raster and isinstance(table, dict) else ():
            if isinstance(table.get(key), dict):
                _check_keys(table[key], Range, f"{where}.{form}.{key}", problems)
            elif key in table and (not isinstance(table[key], list) or len(table[key]) < 2):
                allowed = "must be a list of two lengths at least, or a table of from, to and steps"
                problems.error(f"{where}.{form}.{key}", table[key], allowed)
    return forms


def _check_keys(table: Any, model: type[Section], where: str, problems: Problems) -> None:
    keys = [field.alias or name for name, field in model.model_fields.items() if name != "name"]
    if not isinstance(table, dict):
        problems.error(where, table, f"must be a table of {', '.join(keys)}")
        return
    for key in table:
        if key not in keys:
            problems.error(f"{where}.{key}", table[key], f"unknown key; {nearest(key, keys)}")
    for key in keys:
        if key not in table:
            problems.error(f"{where}.{key}", None, "is required")


def _report(error: ValidationError, raw: Mapping[str, Any], where: str, problems: Problems) -> None:
    """Report pydantic's errors at the key, of a table within the path, that they are about."""
    for item in error.errors():
        found: Any = raw
        key = where
        for step in item["loc"]:
            if isinstance(step, str) and isinstance(found, dict) and step in found:
                found, key = found[step], f"{key}.{step}"
            elif isinstance(step, int) and isinstance(found, list) and step < len(found):
                found, key = found[step], f"{key}[{step + 1}]"
        if isinstance(found, dict) != ("Range" in item["loc"]) and key.endswith((".raster.x", ".raster.y")):
            continue  # of the other form
        context = item.get("ctx", {})
        if item["type"] == "quantity":
            allowed = f"must be {context['allowed']}"
        elif item["type"] in ("greater_than_equal", "less_than_equal", "greater_than"):
            words = {"ge": "at least", "le": "at most", "gt": "greater than"}
            allowed = "must be " + " and ".join(f"{words[k]} {v:g}" for k, v in context.items() if k in words)
        elif item["type"] == "tuple_type":
            allowed = 'must be a list of lengths, such as ["5 mm", "0 mm"]'
        else:
            allowed = item["msg"].replace("Input should be", "must be")
        problems.error(key, found, allowed)


def _way_of(path: Path, form: str) -> Way:
    if path.raster is not None:
        x, y = (_spread(v.start, v.to, v.steps) if isinstance(v, Range) else v for v in (path.raster.x, path.raster.y))
        return Way(tuple(product(x, y)), (("x", x), ("y", y)), path.off)
    if path.line is not None:
        line = path.line
        ends = zip(line.start, line.to, strict=False)
        places = tuple(zip(*(_spread(a, b, line.steps) for a, b in ends), strict=True))
        length = dist(line.start, line.to) if len(line.start) == len(line.to) else 0.0
        return Way(places, (("path", _spread(0.0, length, line.steps)),), path.off)
    if path.circle is not None:
        centre, radius, steps = path.circle.centre, path.circle.radius, path.circle.steps
        angles = [2 * pi * n / steps for n in range(steps)]
        places = tuple(
            (_round(centre[0] + radius * cos(a)), _round(centre[1] + radius * sin(a)), *centre[2:]) for a in angles
        )
        return Way(places, (("path", tuple(_round(radius * a) for a in angles)),), path.off)
    places = path.points or ()
    lengths = [0.0]
    for a, b in pairwise(places):
        lengths.append(lengths[-1] + (dist(a, b) if len(a) == len(b) else 0.0))
    return Way(places, (("path", tuple(map(_round, lengths))),), path.off)


def _check(way: Way, raw: Any, where: str, problems: Problems) -> None:
    """Report places that are given twice, lists that do not rise, and points of unlike numbers of coordinates."""
    ends = [raw[key] for key in ("from", "to")] if "from" in raw else []
    if len({len(place) for place in way.places}) > 1 or len({len(end) for end in ends}) > 1:
        problems.error(where, raw, "all places must have two coordinates, or all three")
        return
    for name, values in way.axes:
        if name != "path" and any(b <= a for a, b in pairwise(values)):
            problems.error(f"{where}.{name}", raw[name], "must rise from value to value")
            return
    if len(way.places) > _MOST:
        problems.error(where, None, f"has {len(way.places)} places: at most {_MOST} are allowed")
    seen: set[Point] = set()
    for place in way.places:
        if place in seen:
            problems.error(where, [in_mm(c) for c in place], "stands more than once on the path")
            return
        seen.add(place)


def _spread(start: float, to: float, steps: int) -> tuple[float, ...]:
    """Return ``steps`` numbers from ``start`` to ``to``, both among them."""
    return tuple(_round(start + (to - start) * n / (steps - 1)) for n in range(steps))


def _round(length: float) -> float:
    return canonical(round(length, _DIGITS)) + 0.0


def _tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _tuples(v) for key, v in value.items()}
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value
