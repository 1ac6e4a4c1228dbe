"""What a case is, as values of the study's keys: for telling which cases of two studies are the same."""

from collections.abc import Iterable, Iterator, Sequence
from math import isfinite
from typing import Any

from pydantic import BaseModel

from epsmesh.shapes.probe import Probe
from epsmesh.study.case import Case
from epsmesh.study.problems import unit_of

# Values by key, as mesh.fine or body.layer[1].young. A key that a shape does not have is not there.
Parameters = dict[str, Any]

# Digits of a number that are distinguished: "3 mm" and "0.3 cm" are one length.
_DIGITS = 9
# Where a file lies is not what is in it: bodies of files are compared by their heights, volume and extent.
_FILE = "body.file"


def parameters_of(case: Case, tool: Probe | None = None) -> Parameters:
    """Return the values of all keys of a case, in SI units; ``tool`` is that of an insertion, of which it is a state.

    Where all of the body is kept, it does not matter what would have become of the rest: ``mesh.outside`` is then
    "coarse". Where it is not, ε is a key of the scene, ``kept.epsilon``. A depth at a given force is a result.
    """
    found = {key: value for key, value, _ in _rows(case, tool)}
    if case.probe.force is not None:
        del found["probe.depth"]  # it is found
    if _FILE in found:
        found[_FILE] = (*_rounded(case.body.heights), *_rounded((case.body.volume, case.body.extent)))
    if case.no_contact:
        return found  # off the body there is no frame to tell what is kept
    if case.is_truncated or case.is_closed:
        found["kept.epsilon"] = found["mesh.epsilon"]
    else:
        found["mesh.outside"] = "coarse"
    if case.is_full:
        found["mesh.epsilon"] = "full"
    return found


def units_of(case: Case, tool: Probe | None = None) -> dict[str, str]:
    """Return the SI units of those keys of a case that have one."""
    return {key: unit for key, _, unit in _rows(case, tool) if unit}


def varied(ours: Sequence[Parameters], theirs: Sequence[Parameters]) -> list[str]:
    """Return the keys that vary within one of two studies, or that only some of its cases have."""
    return [key for key in _keys(ours, theirs) if any(len(_values(cases, key)) > 1 for cases in (ours, theirs))]


def differing(
    ours: Sequence[Parameters], theirs: Sequence[Parameters]
) -> tuple[list[tuple[str, Any, Any]], list[tuple[str, Any, Any]]]:
    """Return the keys that have one value in each of two studies, and not the same: of the scene, and the others."""
    scene, settings = list[tuple[str, Any, Any]](), list[tuple[str, Any, Any]]()
    for key in _keys(ours, theirs):
        one, other = _values(ours, key), _values(theirs, key)
        if len(one) == len(other) == 1 and one != other:
            is_setting = (key.startswith("mesh.") and key != "mesh.outside") or key == "probe.insertion.steps"
            (settings if is_setting else scene).append((key, *one, *other))
    return scene, settings


def _keys(*studies: Iterable[Parameters]) -> list[str]:
    return list(dict.fromkeys(key for cases in studies for parameters in cases for key in parameters))


def _values(cases: Iterable[Parameters], key: str) -> set[Any]:
    return {parameters.get(key) for parameters in cases}


def _rows(case: Case, tool: Probe | None) -> Iterator[tuple[str, Any, str]]:
    """Yield key, value and unit of all keys of a case."""
    parts = {"body": case.body, "material": case.material, "probe": tool or case.probe}
    for name, part in (parts | {"mesh": case.mesh, "load": case.load}).items():
        yield from _flat(name, part)


def _flat(where: str, value: Any, unit: str = "") -> Iterator[tuple[str, Any, str]]:
    """Yield key, value and unit of all of a section, down to numbers, texts and lists of these; names are none."""
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            if name != "name":
                yield from _flat(f"{where}.{name}", getattr(value, name), unit_of(type(value), name))
    elif isinstance(value, tuple | list) and any(isinstance(one, BaseModel) for one in value):
        for number, one in enumerate(value, start=1):
            yield from _flat(f"{where}[{number}]", one)
    else:
        yield where, _plain(value), unit


def _plain(value: Any) -> Any:
    """Return a value that can be compared: numbers to so many digits, lists as tuples, None for none of them."""
    if isinstance(value, tuple | list):
        return tuple(_plain(one) for one in value) or None
    if isinstance(value, dict):
        return tuple((key, _plain(one)) for key, one in sorted(value.items()))
    if isinstance(value, float):
        return _rounded((value,))[0]
    return value


def _rounded(values: Iterable[float]) -> tuple[Any, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") if isfinite(value) else str(value) for value in values)
