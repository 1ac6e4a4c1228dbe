"""Lengths that one measurement has alone, with errors of their own: unknowns that widen the bars of all others."""

from collections.abc import Mapping
from dataclasses import replace

from pydantic_core import PydanticCustomError

from epsmesh.study.problems import Problems
from epsmesh.units import parse_quantity
from epsmesh_identify.sections.identification import Identification, known_one, number_in, with_error
from epsmesh_identify.sections.measurement import Measurement
from epsmesh_identify.sections.parameters import Parameter


def own_errors(
    found: Identification,
    measurement: Measurement,
    where: str,
    known: Mapping[str, Parameter],
    problems: Problems,
) -> Identification:
    """Return the unknowns with the lengths that a ``measurement`` has with errors of its own: see :func:`own_length`.

    ``known`` are the parameters of its scene.
    """
    lengths = {name: one for name, one in known.items() if one.place and one.unit == "m"}
    added = []
    for name, error in (measurement.errors or {}).items():
        key = f"{where}.errors.{name}"
        parameter = known_one(key, error, name, lengths, problems)
        if parameter is None:
            continue
        if any(one.parameter.name == name for one in found.sought):
            problems.error(key, error, "is also a key of [identify]: leave one of them out")
            continue
        try:
            value = parameter.value
            own = replace(parameter, name=own_length(name, measurement.name), is_logarithmic=True)
            size = parse_quantity(error, "") * value if error.endswith("%") else number_in(error, parameter.unit)
            one = with_error(key, own, error, value, size, False, problems)
            added += [one] if one else []
        except PydanticCustomError as wrong:
            problems.error(key, error, f'must be an error, such as "5 %" or "0.2 mm": {wrong.message()}')
    return replace(found, sought=(*found.sought, *added))


def own_length(name: str, measurement: str) -> str:
    """Return the name of an unknown length that one measurement has alone."""
    return f"{name} of {measurement}"
