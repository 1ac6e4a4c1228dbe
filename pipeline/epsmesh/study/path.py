"""``[probe.path]``: the places along which a probe moves, and their coordinates in the dataset."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise, product
from math import cos, dist, pi, prod, sin
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Tag, ValidationError
from pydantic_core import PydanticCustomError

from epsmesh.shapes.section import Section, Words, in_mm
from epsmesh.study.problems import Problems, allowed, nearest, tuples
from epsmesh.units import Coordinate, Length, canonical

# Decimal places of a coordinate in metres: beyond, there is rounding only.
_DIGITS = 12
_MOST = 20_000  # places

Point = tuple[float, ...]


def _two_or_three(point: Point) -> Point:
    if len(point) not in (2, 3):
        raise PydanticCustomError("not_supported", 'must be a list of 2 or 3 lengths, such as ["5 mm", "0 mm"]')
    return point


def _several(points: Any) -> Any:
    if not isinstance(points, tuple) or len(points) < 2:
        raise PydanticCustomError("not_supported", "must be a list of at least two places; for one place, use `at`")
    return points


Place = Annotated[tuple[Coordinate, ...], AfterValidator(_two_or_three)]
Steps = Annotated[int, Field(ge=2, le=_MOST)]


class _Table(BaseModel):
    model_config = Section.model_config


class Line(_Table):
    """Places at equal distances on a straight line, both ends among them."""

    start: Annotated[Place, Field(alias="from")]
    to: Place
    steps: Steps


class Circle(_Table):
    """Places at equal distances on a level circle, the first one along x from its centre."""

    centre: Place
    radius: Length
    steps: Steps


class Range(_Table):
    """Coordinates at equal distances, both ends among them."""

    start: Annotated[Coordinate, Field(alias="from")]
    to: Coordinate
    steps: Steps


_OF_RASTER = "must be a list of at least two lengths, or a range {from, to, steps}"


def _kind(value: Any) -> str | None:
    """Return the form of coordinates; None if it is neither."""
    is_table, is_list = isinstance(value, dict | Range), isinstance(value, tuple) and len(value) > 1
    return "table" if is_table else "list" if is_list else None


Coordinates = Annotated[
    Annotated[tuple[Coordinate, ...], Field(max_length=_MOST), Tag("list")] | Annotated[Range, Tag("table")],
    Discriminator(_kind, custom_error_type="not_supported", custom_error_message=_OF_RASTER),
]


class Raster(_Table):
    """All places of a grid, seen from above."""

    x: Coordinates
    y: Coordinates


_POINT = "x and y of the highest surface point there, or x, y and z, moved to the nearest surface point"


class Path(_Table):
    """The section as the author of a study sees it: one of its forms, and the treatment of places off the body."""

    line: Annotated[
        Line | None,
        Words(
            f"Places on a straight line: `from` and `to` ({_POINT}), and `steps`, the number of places, both ends "
            "included. The dimension `path` is the distance along the line.",
            '{ from = ["-12 mm", "0 mm"], to = ["12 mm", "0 mm"], steps = 7 }',
            default="one of line, circle, raster and points is required",
        ),
    ] = None
    circle: Annotated[
        Circle | None,
        Words(
            "Places on a level circle: `centre`, `radius`, and `steps`, the number of places on the whole circle. The "
            "first place is along x from the centre. The dimension `path` is the distance along the circle.",
            '{ centre = ["0 mm", "0 mm"], radius = "8 mm", steps = 8 }',
            default="none",
        ),
    ] = None
    raster: Annotated[
        Raster | None,
        Words(
            "Places on a grid: `x` and `y`, each a rising list, or a range of `from`, `to` and `steps`. The "
            "dimensions are `x` and `y`.",
            '{ x = ["-5 mm", "0 mm", "5 mm"], y = { from = "-6 mm", to = "6 mm", steps = 5 } }',
            default="none",
        ),
    ] = None
    points: Annotated[
        tuple[Place, ...] | None,
        BeforeValidator(_several),
        Words(
            "List of places. The dimension `path` is the summed straight distance from the first place.",
            '[["0 mm", "0 mm"], ["3 mm", "0 mm"], ["8 mm", "2 mm"]]',
            default="none",
        ),
    ] = None
    off: Annotated[
        Literal["refuse", "no contact"],
        Words(
            "Places off the body. refuse: an error. no contact: F is 0 there. A tool across an edge has "
            "no F; `message` has the reason.",
            '"no contact"',
        ),
    ] = "refuse"


_FORMS = ("line", "circle", "raster", "points")


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
        """The places as a study file would list them."""
        return [[f"{c!r} m" for c in place] for place in self.places]


def read_path(raw: Any, where: str, problems: Problems) -> Way | None:
    """Return the way that the table ``raw`` describes, or None where it has problems, which are reported.

    ``where`` is the table's place in the study file.
    """
    if not isinstance(raw, dict):
        problems.error(where, raw, f"must be a table: write [{where}] and one of {', '.join(_FORMS)}")
        return None
    before, forms = len(problems.errors), [key for key in raw if key in _FORMS]
    if len(forms) != 1:
        found = f"has {' and '.join(forms)}" if forms else "has no places"
        problems.error(where, None, f"{found}: give one of {', '.join(_FORMS)}")
    try:
        path = Path.model_validate({key: tuples(value) for key, value in raw.items()})
    except ValidationError as error:
        for item in error.errors():
            _report(item, raw, where, problems)
    if len(problems.errors) > before:
        return None
    (form,) = forms
    if path.raster is not None:
        count = prod(v.steps if isinstance(v, Range) else len(v) for v in (path.raster.x, path.raster.y))
        if count > _MOST:
            problems.error(f"{where}.{form}", None, f"has {count} places: at most {_MOST} are allowed")
            return None
    way = _way_of(path)
    _check(way, raw[form], f"{where}.{form}", problems)
    return None if len(problems.errors) > before else way


# The tables within each table, by key; those of x and y are ranges.
_INNER: dict[str, type[BaseModel]] = {"line": Line, "circle": Circle, "raster": Raster, "x": Range, "y": Range}


def _report(item: Any, raw: Mapping[str, Any], where: str, problems: Problems) -> None:
    """Report one of pydantic's errors at the key, of a table within the path, that it is about."""
    found: Any = raw
    model: type[BaseModel] = Path
    for step in item["loc"]:
        if isinstance(step, str) and isinstance(found, dict) and step in found:
            found, where, model = found[step], f"{where}.{step}", _INNER.get(step, model)
        elif isinstance(step, int):
            found, where = found[step], f"{where}[{step + 1}]"
    keys = [field.alias or name for name, field in model.model_fields.items()]
    match item["type"]:
        case "missing":
            problems.error(f"{where}.{item['loc'][-1]}", None, "is required")
        case "extra_forbidden":
            problems.error(where, found, f"unknown key; {nearest(str(item['loc'][-1]), keys)}")
        case "model_type":
            problems.error(where, found, f"must be a table of {', '.join(keys)}")
        case "tuple_type":
            problems.error(where, found, 'must be a list of lengths, such as ["5 mm", "0 mm"]')
        case _:
            problems.error(where, found, allowed(item, model))


def _way_of(path: Path) -> Way:
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
    """Report places that are given twice, lists that do not rise, and places with different numbers of coordinates."""
    ends = [raw[key] for key in ("from", "to")] if "from" in raw else []
    if len({len(place) for place in way.places}) > 1 or len({len(end) for end in ends}) > 1:
        problems.error(where, raw, "must have two coordinates at all places, or three at all places")
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
            problems.error(where, [in_mm(c) for c in place], "is on the path more than once")
            return
        seen.add(place)


def _spread(start: float, to: float, steps: int) -> tuple[float, ...]:
    """Return ``steps`` numbers from ``start`` to ``to``, both among them."""
    return tuple(_round(start + (to - start) * n / (steps - 1)) for n in range(steps))


def _round(length: float) -> float:
    return canonical(round(length, _DIGITS)) + 0.0
