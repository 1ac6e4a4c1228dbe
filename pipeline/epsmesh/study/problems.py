"""Problems of a study file: collected all at once, each with file, key, value, and what is allowed."""

import difflib
import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Literal, get_origin

from pydantic import BaseModel, ValidationError

from epsmesh.printable import printable
from epsmesh.shapes.section import Section, words_of
from epsmesh.shapes.tissue import Tissue
from epsmesh.shapes.varying import Varying
from epsmesh.study.howto import page_of
from epsmesh.study.meant import OTHER_VALUES, other_name

# Letters of a value, or of a key, that a message repeats.
_QUOTED = 200
# Problems of one table beyond these are counted only.
MOST_ERRORS = 50
# Values of a sweep beyond these are not listed in a warning.
_MOST_VALUES = 4
# Similarity from which a known name is suggested: `raster` is none for `step`.
_ALIKE = 0.65
# Types of errors that a list has where one value is expected.
_OF_ONE = ("bool_type", "float_type", "int_type", "literal_error", "quantity", "string_type")
_NAMED, _NUMBERED = re.compile(r"`(\w+)`"), re.compile(r"\[\d+\]")
# A number and its unit: warnings that differ in nothing else are one.
_NUMBER = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?\s?(%|mm\b)?")


@dataclass(frozen=True)
class Problem:
    """A problem of a study file: an error or, as a warning, a doubtful value.

    ``tables`` are those of arrays that it is about, by section and name: none where it is about all of them.
    """

    key: str
    found: Any
    allowed: str
    tables: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        found = "" if self.found is None else f" = {shortened(_toml(self.found))}"
        names = ", ".join(f'{section} "{name}"' for section, name in self.tables)
        key = f"{shortened(self.key)}{found}: " if self.key else ""  # else it is the whole file
        return printable(f"{key}{self.allowed}{f' ({shortened(names)})' if names else ''}")

    @property
    def value(self) -> Any:
        """The value in the file, as plain data."""
        if isinstance(self.found, _Raw):
            return json.loads(self.found)
        return str(self.found) if isinstance(self.found, str) else self.found

    @property
    def howto(self) -> str:
        """The page of the documentation about the key; "" if there is none."""
        return page_of(self.key)


class StudyError(Exception):
    """A study file that cannot be run, with every problem found in it."""

    def __init__(self, file: str, problems: Iterable[Problem]):
        self.file = file
        self.problems = tuple(dict.fromkeys(problems))
        super().__init__("\n".join(f"{file}: {problem}" for problem in self.problems))


@dataclass
class Problems:
    """A growing list of errors and warnings; the same one twice counts once.

    ``tables`` has the names of the tables of each section that is an array.
    """

    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    tables: dict[str, tuple[str, ...]] = field(default_factory=dict)
    _about: dict[str, str] = field(default_factory=dict)
    _places: dict[tuple[bool, str, Any, str], int] = field(default_factory=dict)
    _unread: set[str] = field(default_factory=set)

    @contextmanager
    def about(self, **sections: Section) -> Iterator[None]:
        """Name, in all that is reported within, the tables of arrays that ``sections`` are."""
        before = self._about
        named = {kind: one.name for kind, one in sections.items() if one.name in self.tables.get(kind, ())}
        self._about = before | named
        try:
            yield
        finally:
            self._about = before

    def each(self, check: Callable[..., Any], **sections: Iterable[Any]) -> None:
        """Call ``check`` with every combination of one of each of ``sections``, and with this list.

        What it reports names the tables of arrays that they are: see :meth:`about`.
        """
        for chosen in product(*sections.values()):
            with self.about(**dict(zip(sections, chosen, strict=True))):
                check(*chosen, self)

    def error(self, key: str, found: Any, allowed: str) -> None:
        """Add an error."""
        self._add(self.errors, self._problem(key, found, allowed))

    def unknown(self, key: str, found: Any, allowed: str) -> None:
        """Add the error of an unknown key. The rest of its section is still checked against the others."""
        self.error(key, found, allowed)
        self._unread.add(key)

    def warn(self, key: str, found: Any, allowed: str) -> None:
        """Add a warning."""
        self._add(self.warnings, self._problem(key, found, allowed))

    def warnings_once(self) -> Iterator[str]:
        """Yield the warnings. Those of a sweep, which differ in numbers only, are one."""
        groups: dict[tuple[str, str, tuple[tuple[str, str], ...]], list[Problem]] = {}
        for problem in self.named(self.warnings):
            groups.setdefault((problem.key, _NUMBER.sub("#", problem.allowed), problem.tables), []).append(problem)
        for first, *others in groups.values():
            values = [shortened(_toml(other.found)) for other in others if other.found != first.found]
            listed = (
                ", ".join(dict.fromkeys(values))
                if len(values) <= _MOST_VALUES
                else (f"{len(values)} more values up to {values[-1]}")
            )
            yield f"{first}; so for {printable(listed)}" if listed else str(first)

    def named(self, problems: Iterable[Problem]) -> list[Problem]:
        """Return ``problems``, without names of tables if they are about all tables of an array."""
        found = []
        for problem in problems:
            sections = [section for section, _ in problem.tables]
            some = {section for section in sections if sections.count(section) < len(self.tables[section])}
            found.append(replace(problem, tables=tuple(pair for pair in problem.tables if pair[0] in some)))
        return found

    def sound(self, sections: dict[str, tuple[Section, ...]]) -> dict[str, tuple[Section, ...]]:
        """Return ``sections`` without those that have an error, which cannot be checked against others.

        Of an array of tables, the others are left.
        """
        found = dict(sections)
        for section, number in {_section_of(error.key) for error in self.errors if error.key not in self._unread}:
            names = self.tables.get(section, ())
            bad = names[number - 1] if 0 < number <= len(names) else None
            found[section] = tuple(one for one in found.get(section, ()) if bad is not None and one.name != bad)
        return {name: found[name] for name in sections}

    def drop_consequences(self) -> None:
        """Drop errors of what is required where it is there, under an unknown name: that is reported."""
        meant = set()
        for error in self.errors:
            if error.allowed.startswith("unknown"):
                for section in (error.key.rpartition(".")[0], _NUMBERED.sub("", error.key).rpartition(".")[0]):
                    meant |= {f"{section}.{name}" if section else f"[{name}]" for name in _NAMED.findall(error.allowed)}

        def is_consequence(error: Problem) -> bool:
            section = error.key.rpartition(".")[0]
            ways = {error.key, *(f"{section}.{name}" for name in _NAMED.findall(error.allowed))}
            return "is required" in error.allowed and not meant.isdisjoint(ways)

        self.errors[:] = [error for error in self.errors if not is_consequence(error)]

    def _problem(self, key: str, found: Any, allowed: str) -> Problem:
        section, dot, rest = key.partition(".")
        if dot and section in self._about:
            key = f"{section}[{self.tables[section].index(self._about[section]) + 1}].{rest}"
        return Problem(key, _hashable(found), allowed, tuple(self._about.items()))

    def from_pydantic(self, prefix: str, error: ValidationError, model: type[BaseModel], raw: dict[str, Any]) -> None:
        """Translate pydantic's errors of the section ``prefix``, read from ``raw``, for the study's author."""
        found = error.errors(include_url=False, include_context=True, include_input=False)
        for item in found[:MOST_ERRORS]:
            self._from_item(prefix, item, item["loc"], model, raw)
        if len(found) > MOST_ERRORS:
            self.error(prefix, None, f"… and {len(found) - MOST_ERRORS} more")

    def _from_item(self, where: str, item: Any, place: tuple[Any, ...], model: type[BaseModel], raw: Any) -> None:
        """Translate an error at a ``place`` within the table ``raw``, or within one of its own arrays of tables."""
        key = str(place[0]) if place else ""
        inner, table = nested_model(model, key), table_model(model, key)
        found: Any = raw.get(key) if isinstance(raw, dict) else raw
        if inner is not None and len(place) > 1:
            self._from_item(f"{where}.{key}[{place[1] + 1}]", item, place[2:], inner, found[place[1]])
        elif table is not None and len(place) > 1 and isinstance(found, dict):
            self._from_item(f"{where}.{key}", item, place[1:], table, found)
        elif (inner is not None and item["type"] != "not_supported") or not isinstance(raw, dict):
            what = f"must be an array of tables: write [[{where}.{key}]]" if inner else "must be a table"
            self.error(f"{where}.{key}".rstrip("."), found, what)
        else:
            meant = other_name(where, key) if item["type"] == "extra_forbidden" else ""
            meant = meant or allowed({**item, "loc": place}, model)
            hint = OTHER_VALUES.get(key, {}).get(found.casefold(), "") if isinstance(found, str) else ""
            if isinstance(found, list) and item["type"] in _OF_ONE:
                meant = f"{meant.partition(', without')[0]}: a list of `{key}` is no sweep"
            self.error(f"{where}.{key}".rstrip("."), found, meant + hint)

    def _add(self, problems: list[Problem], problem: Problem) -> None:
        """Add a problem. If it is known for other tables, these are added to it."""
        same = (problems is self.errors, problem.key, problem.found, problem.allowed)
        place = self._places.setdefault(same, len(problems))
        if place == len(problems):
            problems.append(problem)
        else:
            tables = dict.fromkeys((*problems[place].tables, *problem.tables))
            problems[place] = replace(problems[place], tables=tuple(tables))


def nested_model(model: type[BaseModel], key: str) -> type[BaseModel] | None:
    """Return the model of the tables in an array of tables under ``key``, None if there is none."""
    annotation: Any = model.model_fields[key].annotation if key in model.model_fields else None
    if getattr(annotation, "__origin__", None) is not tuple:
        return None
    kind = annotation.__args__[0]
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def table_model(model: type[BaseModel], key: str) -> type[BaseModel] | None:
    """Return the model of an optional table under ``key``, None if there is none."""
    if key == "young" and issubclass(model, Tissue):  # a table may take the place of its value
        return Varying
    annotation: Any = model.model_fields[key].annotation if key in model.model_fields else None
    kind, *others = getattr(annotation, "__args__", None) or (None,)
    is_table = others == [type(None)] and isinstance(kind, type) and issubclass(kind, BaseModel)
    return kind if is_table else None


def unit_of(model: type[BaseModel], key: str) -> str:
    """Return the SI unit of a key: of a number, an optional one, or those of a list; "" if it has none."""
    info = model.model_fields[key]
    parts = getattr(info.annotation, "__args__", ())
    extras = [info.json_schema_extra] + [
        getattr(m, "json_schema_extra", None) for part in parts for m in getattr(part, "__metadata__", ())
    ]
    return next((str(extra["unit"]) for extra in extras if isinstance(extra, dict) and "unit" in extra), "")


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ``did you mean …`` with the nearest known name, or the list of all of them."""
    known = list(known)
    close = closest(name, known)
    return f"did you mean `{close}`?" if close else f"allowed are {', '.join(known)}"


def closest(name: str, known: Iterable[str]) -> str:
    """Return the known name that is similar to ``name``, or begins with it; "" if there is none."""
    known = list(known)
    begun = [other for other in known if other.startswith(name)] if len(name) > 1 else []
    return next(iter(difflib.get_close_matches(name, known, n=1, cutoff=_ALIKE) or begun), "")


def tuples(value: Any) -> Any:
    """Return a value of a study file as strict models take it: lists as tuples, within tables, too."""
    if isinstance(value, dict):
        return {key: tuples(v) for key, v in value.items()}
    return tuple(map(tuples, value)) if isinstance(value, list) else value


def allowed(item: Any, model: type[BaseModel]) -> str:
    """Return what one of pydantic's errors says is allowed at a key of ``model``."""
    context = item.get("ctx", {})
    match item["type"]:
        case "missing" if len(item["loc"]) == 1:
            return "is required"
        case "extra_forbidden":
            return f"unknown key; {nearest(str(item['loc'][-1]), model.model_fields)}"
        case "literal_error":
            return f"must be {context['expected']}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            bounds = {"gt": "greater than", "ge": "at least", "lt": "less than", "le": "at most"}
            unit = unit_of(model, str(item["loc"][0])) if item["loc"] and item["loc"][0] in model.model_fields else ""
            found = {
                bounds[k]: f"{100 * v:g} %" if unit == "1" else f"{v:g}" for k, v in context.items() if k in bounds
            }
            return "must be " + " and ".join(f"{word} {value}" for word, value in found.items())
        case "quantity":
            return f"must be {context['allowed']}"
        case "missing" | "too_short" | "too_long" | "tuple_type":
            return _list_of(model, str(item["loc"][0]))
        case "float_type" | "int_type" as kind:
            return f"must be a {'whole ' * (kind == 'int_type')}number, without a unit or quotation marks"
        case "string_type":
            return "must be text"
        case "bool_type":
            return "must be true or false, without quotation marks"
        case "string_pattern_mismatch":
            return "must begin with a letter, and have letters, digits, _ and - only"
        case "not_supported":
            return item["msg"]
        case _:
            return item["msg"].replace("Input should be", "must be").replace("Value error, ", "")


def _list_of(model: type[BaseModel], key: str) -> str:
    """Return what a list must have, by the type of its key, and an example."""
    annotation: Any = model.model_fields[key].annotation
    parts = (annotation, *getattr(annotation, "__args__", ()))
    items: tuple[Any, ...] = next((part.__args__ for part in parts if getattr(part, "__origin__", None) is tuple), ())
    if get_origin(items[0]) is tuple:
        return f"must be a list of rows, such as {words_of(model, key).example}"
    count = "" if get_origin(items[0]) is Literal else f" of {'2 or 3' if ... in items else len(items)} values"
    return f"must be a list{count}, such as {words_of(model, key).example}"


def _section_of(key: str) -> tuple[str, int]:
    """Return the section of a key, and the number of the table in an array, else 0."""
    match = re.match(r"\[*(\w+)(?:\[(\d+)\])?", key)
    return (match[1], int(match[2] or 0)) if match else ("", 0)


class _Raw(str):
    """A value as the file writes it."""


def _hashable(value: Any) -> Any:
    return value if value is None or isinstance(value, str | int | float | bool) else _Raw(_toml(value))


def shortened(text: str) -> str:
    """Return a text of the file as a message quotes it: its beginning, if it is long."""
    return text if len(text) <= _QUOTED else f"{text[:_QUOTED]}…"


def _toml(value: Any) -> str:
    return value if isinstance(value, _Raw) else json.dumps(value, default=str, ensure_ascii=False)
