"""A study in a dictionary, written as a study file.

A dataset contains the text of its study. So a study that a program declares is written as TOML, and read like any other
study, within the same limits.
"""

import json
import re
from collections.abc import Iterator, Mapping
from math import isinf, isnan
from numbers import Integral, Real
from os import PathLike, fspath
from typing import Any

from epsmesh.study.problems import Problem, Problems, StudyError
from epsmesh.study.text import LARGEST

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(study: Mapping[str, Any], file: str) -> str:
    """Return ``study`` as the text of a study file; ``file`` is for messages.

    Tables are mappings, arrays lists, tuples or numpy arrays, values texts, paths, numbers and booleans.

    Raises:
        StudyError: with every value that TOML has no way to write.
    """
    problems = Problems()
    lines = list(_table(study, "", "", problems))
    if problems.errors:
        raise StudyError(file, problems.errors)
    return "\n".join(lines) + "\n"


def to_line(key: str, value: Any) -> str:
    """Return a key and its value, which TOML can write, as one line: tables in line."""
    return f"{_key(key)} = {_value(value, key, Problems())}"


def _table(table: Mapping[Any, Any], heading: str, where: str, problems: Problems) -> Iterator[str]:
    """Yield the lines of a table: its values, then the tables in it; ``heading`` is as TOML writes it.

    Sweeps are dimensions in the order of the file: a table with values after it is written in line.
    """
    items: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(key, str):
            items[key] = _plain(value)
        else:
            problems.errors.append(Problem(f"{where}.{key}".lstrip("."), None, "keys must be text"))
    nested = [key for key, value in items.items() if isinstance(value, Mapping) or _is_array(value)]
    if where:
        nested = nested[len(nested) - _trailing(list(items), nested) :]
    for key, value in items.items():
        if key not in nested:
            yield f"{_key(key)} = {_value(value, f'{where}.{key}'.lstrip('.'), problems)}"
    for key in nested:
        name, place, value = f"{heading}.{_key(key)}".lstrip("."), f"{where}.{key}".lstrip("."), items[key]
        if isinstance(value, Mapping):
            yield f"\n[{name}]"
            yield from _table(value, name, place, problems)
        for number, one in enumerate(value if _is_array(value) else (), start=1):
            yield f"\n[[{name}]]"
            yield from _table(one, name, f"{place}[{number}]", problems)


def _trailing(keys: list[str], nested: list[str]) -> int:
    """Return how many of the last ``keys`` are all ``nested``."""
    return next((number for number, key in enumerate(reversed(keys)) if key not in nested), len(keys))


def _value(value: Any, place: str, problems: Problems) -> str:
    """Write a value; what cannot be is reported, and nothing written for it."""
    value = _plain(value)
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _text(value)
        case Integral() if -LARGEST <= int(value) < LARGEST:
            return str(int(value))
        case Integral():
            problems.errors.append(Problem(place, None, "has more than 64 bits: write 1e30 for a large number"))
            return ""
        case Real():
            number = float(value)
            return "nan" if isnan(number) else f"{'-' * (number < 0)}inf" if isinf(number) else repr(number)
        case list():
            return f"[{', '.join(_value(one, place, problems) for one in value)}]"
        case Mapping():
            pairs = (f"{_key(str(k))} = {_value(v, f'{place}.{k}', problems)}" for k, v in value.items())
            return f"{{{', '.join(pairs)}}}"
    allowed = 'write text with a unit, such as "10 mm", a number, a list, or a table'
    what = "None: leave the key out" if value is None else f"a {type(value).__name__} is no value of a study: {allowed}"
    problems.errors.append(Problem(place, None, what))
    return ""


def _plain(value: Any) -> Any:
    """Return a value of a library as plain data: lists for arrays, texts for paths."""
    if isinstance(value, PathLike):
        return fspath(value)
    if isinstance(value, tuple):
        return list(value)
    # Arrays and numbers of numpy, without importing it.
    return value.tolist() if type(value).__module__ == "numpy" and hasattr(value, "tolist") else value


def _is_array(value: Any) -> bool:
    """Tell an array of tables from an array of values."""
    return isinstance(value, list) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    """Write a text: JSON's signs are TOML's, but for one control character that JSON leaves as it is."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
