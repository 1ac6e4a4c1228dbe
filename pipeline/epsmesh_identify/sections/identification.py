"""Reading of ``[[measurement]]`` and ``[identify]``: measurements, unknowns, and every mistake by its key."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from epsmesh.study.problems import Problems, nearest, tuples
from epsmesh.study.text import check_text
from epsmesh.units import canonical, parse_quantity
from epsmesh_identify.sections.measurement import Hidden, Identify, Measurement
from epsmesh_identify.sections.parameters import Parameter

_MOST = 1000
# Bounds of a value with an error: this many times the error, which is two standard deviations.
_ERRORS = 2.5
# Ends of the names of what is a property of the tissue, not of one specimen or tool.
_OF_TISSUE = ("young", "scale", "poisson")
# A range, and a value, as a study writes them, by SI unit.
_EXAMPLES = {
    "Pa": ('["1 kPa", "1 MPa"]', '"10 kPa"'),
    "1": ("[0.2, 0.5]", "0.4"),
    "m": ('["1 mm", "3 mm"]', '"2 mm"'),
    "s": ('["0.1 s", "100 s"]', '"2 s"'),
    "N": ('["-1 mN", "1 mN"]', '"1 mN"'),
    "N/m": ('["50 N/mm", "64 N/mm"]', '"60 N/mm"'),
    "N/s": ('["-1 mN/s", "1 mN/s"]', '"1 mN/s"'),
}


@dataclass(frozen=True)
class Sought:
    """A parameter that is not known: its range (SI units), and mean and standard deviation of what is known of it.

    ``is_wanted`` tells those that the study asks for from those that widen the error bars of others only.
    """

    parameter: Parameter
    low: float
    high: float
    prior: tuple[float, float] | None = None
    is_wanted: bool = True


@dataclass(frozen=True)
class Identification:
    """What is to be found: the unknowns, and what the body may have that is not declared."""

    sought: tuple[Sought, ...] = ()
    may_hide: tuple[Hidden, ...] = get_args(Hidden)


def read_measurements(raw: Any, problems: Problems) -> tuple[Measurement, ...]:
    """Return the measurements of ``[[measurement]]`` tables."""
    if not isinstance(raw, list) or not raw:
        problems.error("measurement", raw, "must be an array of tables: write [[measurement]]")
        return ()
    if len(raw) > _MOST:
        problems.error("measurement", None, f"has {len(raw)} tables: at most {_MOST}; a folder of curves is one file")
        return ()
    found = []
    for number, table in enumerate(raw, start=1):
        where = f"measurement[{number}]"
        if not isinstance(table, dict):
            problems.error(where, table, "must be a table: write [[measurement]]")
            continue
        if "approach" in table:
            allowed = "unknown key; give the part of the curve as `segment`, a range of depth or time as `window`"
            problems.error(f"{where}.approach", table["approach"], allowed)
            table = {key: value for key, value in table.items() if key != "approach"}  # noqa: PLW2901
        if "name" not in table and isinstance(file := table.get("file"), str):
            table = {**table, "name": _name_of(file)}  # noqa: PLW2901
        try:
            one = Measurement.model_validate({key: tuples(value) for key, value in table.items()})
        except ValidationError as error:
            problems.from_pydantic(where, error, Measurement, table)
            continue
        check_text(f"{where}.name", one.name, problems)
        check_text(f"{where}.file", one.file, problems)
        found.append(one)
    for name, count in Counter(one.name for one in found).items():
        if count > 1:
            problems.error("measurement.name", name, "is the name of several measurements: names must differ")
    return tuple(found)


def _name_of(file: str) -> str:
    """Return the name of a measurement of a file without its ending; of a pattern, the folder's."""
    path = Path(file)
    return (path.parent.name if "*" in path.name else path.stem) or "curve"


def read_identify(
    raw: Any, measurements: tuple[Measurement, ...], known: Mapping[str, Parameter], problems: Problems
) -> Identification:
    """Return the unknowns of ``[identify]``, of the parameters that are ``known`` by name."""
    if not isinstance(raw, dict):
        problems.error("identify", raw, "must be a table: write [identify]")
        return Identification()
    own = {key: value for key, value in raw.items() if key in Identify.model_fields and key != "name"}
    try:
        identify = Identify.model_validate({key: tuples(value) for key, value in own.items()})
    except ValidationError as error:
        problems.from_pydantic("identify", error, Identify, own)
        return Identification()
    given: dict[str, Sought] = {}
    for key in (key for key in raw if key not in own):
        parameter = known_one(f"identify.{key}", raw[key], key, known, problems)
        is_asked = key in identify.unknown
        if parameter and (one := given_one("identify", parameter, raw[key], problems, is_asked=is_asked)):
            given[key] = one
    for name in identify.unknown:
        parameter = known_one("identify.unknown", name, name, known, problems)
        if parameter and name not in raw:
            given[name] = Sought(parameter, parameter.low, parameter.high)
    _add_implied(given, known, measurements, problems)
    _check_relaxation(given, measurements, problems)
    return Identification(tuple(given.values()), identify.may_hide)


def known_one(key: str, found: Any, name: str, known: Mapping[str, Parameter], problems: Problems) -> Parameter | None:
    """Return the parameter of a name; None if there is none, which is reported at the ``key``."""
    if name not in known:
        problems.error(key, found, f"`{name}` is no parameter of this study; {nearest(name, known)}")
    return known.get(name)


def given_one(
    section: str, parameter: Parameter, raw: Any, problems: Problems, *, is_asked: bool = False
) -> Sought | None:
    """Return a parameter with the range, or with the value and error, that a section of the study gives."""
    key, unit = f"{section}.{parameter.name}", parameter.unit
    ends, example = _EXAMPLES[unit]
    allowed = f'must be a range, such as {ends}, or a value with an error, such as {{value = {example}, error = "5 %"}}'
    try:
        if isinstance(raw, list) and len(raw) == 2:
            low, high = (number_in(end, unit) for end in raw)
            return _ranged(key, parameter, raw, low, high, problems)
        if isinstance(raw, dict) and raw.keys() == {"value", "error"}:
            value, error = number_in(raw["value"], unit), _error(raw["error"], raw["value"], unit)
            return with_error(key, parameter, raw, value, error, is_asked, problems)
        problems.error(key, raw, allowed)
    except PydanticCustomError as wrong:
        problems.error(key, raw, f"{allowed}: {wrong.message()}")
    return None


def _ranged(key: str, parameter: Parameter, raw: Any, low: float, high: float, problems: Problems) -> Sought | None:
    if low >= high:
        problems.error(key, raw, "must rise: its first value is not below its second")
    elif low < parameter.least or high > parameter.most or (parameter.is_logarithmic and low <= 0):
        problems.error(key, raw, f"must be within {_bounds(parameter)}")
    else:
        return Sought(parameter, low, high)
    return None


def with_error(
    key: str, parameter: Parameter, raw: Any, value: float, error: float, is_asked: bool, problems: Problems
) -> Sought | None:
    """Return a parameter that is known with an ``error`` (95 %); None, with a report, if it cannot be."""
    if error <= 0:
        problems.error(key, raw, "must have an error above 0; a parameter without an error is known: omit it here")
    elif not parameter.least <= value <= parameter.most:
        problems.error(key, raw, f"must be within {_bounds(parameter)}")
    elif parameter.is_logarithmic and error >= value / _ERRORS:
        problems.error(key, raw, f"must have an error below {1 / _ERRORS:.0%} of its value; for more, give a range")
    else:
        low, high = max(value - _ERRORS * error, parameter.least), min(value + _ERRORS * error, parameter.most)
        return Sought(parameter, canonical(low), canonical(high), (value, canonical(error / 2)), is_asked)
    return None


def _bounds(parameter: Parameter) -> str:
    """Write what a parameter may be."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    if isfinite(parameter.most):
        return f"{parameter.least:g} to {parameter.most:g}{unit}"
    return f"values above {parameter.least:g}{unit}"


def number_in(value: Any, unit: str) -> float:
    """Return a number in the SI ``unit``."""
    if unit != "1":
        return parse_quantity(value, unit)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise PydanticCustomError("quantity", "a number, without a unit or quotation marks")
    return float(value)


def _error(error: Any, value: Any, unit: str) -> float:
    """Return the error (95 %) of a value in the SI ``unit``; per cent are those of the value."""
    if isinstance(error, str) and error.rstrip().endswith("%"):
        return parse_quantity(error, "") * abs(number_in(value, unit))
    return number_in(error, unit)


def _add_implied(
    given: dict[str, Sought],
    known: Mapping[str, Parameter],
    measurements: tuple[Measurement, ...],
    problems: Problems,
) -> None:
    """Add moduli if nothing is asked for, contact point, baseline, and a machine's stiffness that is a range."""
    if not any(one.is_wanted and one.parameter.place for one in given.values()):
        for name, parameter in known.items():
            if parameter.is_modulus:
                asked = given.get(name, Sought(parameter, parameter.low, parameter.high))
                given[name] = replace(asked, is_wanted=True)
    for name in ("contact_point", "baseline"):
        given.setdefault(name, Sought(known[name], -inf, inf, is_wanted=False))
    _add_machine(given, known["machine_stiffness"], measurements, problems)


def _add_machine(
    given: dict[str, Sought], stiffness: Parameter, measurements: tuple[Measurement, ...], problems: Problems
) -> None:
    ranges = {one.machine_stiffness: n for n, one in enumerate(measurements, 1) if one.machine_compliance is None}
    if len(ranges) > 1:
        *_, (value, number) = ranges.items()
        key = f"measurement[{number}].machine_stiffness"
        problems.error(key, value, "must be the same in all measurements where it is not known: it is one unknown")
    for value, number in ranges.items():
        if stiffness.name in given and isinstance(value, tuple):
            key = f"measurement[{number}].machine_stiffness"
            problems.error(key, list(value), 'is also a key of [identify]: write "unknown" here, or omit it there')
        low, high = value if isinstance(value, tuple) else (stiffness.low, stiffness.high)
        given.setdefault(stiffness.name, Sought(stiffness, low, high, is_wanted=False))
    if stiffness.name in given and measurements and not ranges:
        allowed = 'is known: write machine_stiffness = "unknown" in the [[measurement]] where it is not'
        problems.error(f"identify.{stiffness.name}", None, allowed)


def check_shared(
    found: Identification, measurement: Measurement, known: Mapping[str, Parameter], problems: Problems
) -> None:
    """Report lengths and friction that are unknown, but that the scene of a ``measurement`` has others of.

    ``known`` are the parameters of its scene. A modulus may be declared differently: it is one unknown all the same.
    """
    for one in found.sought:
        own = known.get(one.parameter.name)
        if own is None or one.parameter.name.endswith(_OF_TISSUE) or not one.parameter.place:
            continue
        if own.value != one.parameter.value:
            problems.error(
                f"identify.{one.parameter.name}",
                None,
                f"is one unknown, {one.parameter.value:g} in [{one.parameter.place[0]}], but the measurement "
                f'"{measurement.name}" has its own, {own.value:g} (SI): give each an error in its [[measurement]], '
                f'such as errors = {{{one.parameter.name} = "5 %"}}',
            )


def _check_relaxation(given: Mapping[str, Sought], measurements: tuple[Measurement, ...], problems: Problems) -> None:
    """Report terms of relaxation that have no hold to be seen in, or a number without those before it."""
    names = [name for name in given if name.startswith("relaxation_")]
    for number, one in enumerate(measurements if names else (), start=1):
        if not one.segment.startswith("approach"):
            allowed = f'must begin with the approach, from which `{names[0]}` is relaxation: "approach+hold"'
            problems.error(f"measurement[{number}].segment", one.segment, allowed)
    if names and measurements and all("hold" not in one.segment for one in measurements):
        allowed = 'needs a [[measurement]] with segment = "approach+hold"'
        problems.error(f"identify.{names[0]}", None, allowed)
    for missing in sorted(_missing(names)):
        problems.error("identify.unknown", None, f"lacks `{missing}`: relaxation has shares and times, numbered from 1")


def _missing(names: list[str]) -> Iterator[str]:
    """Yield the shares and times of relaxation that are not among ``names``."""
    most = max((int(name.rpartition("_")[2]) for name in names), default=0)
    wanted = (f"relaxation_{kind}_{number}" for number in range(1, most + 1) for kind in ("share", "time"))
    return (name for name in wanted if name not in names)
