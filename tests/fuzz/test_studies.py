"""Any study file is accepted, and its numbers are those of its text, or refused with messages that one can read."""

import re
import tomllib
import unicodedata
from decimal import Decimal, InvalidOperation
from math import inf, isfinite, prod
from typing import Any

import pytest
from hypothesis import given

from epsmesh.plan.describe import summary
from epsmesh.plan.plan import make_plan
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse, read_study
from epsmesh.study.sweep import Study
from tests.cases import raw, study
from tests.fuzz.profile import thrown
from tests.fuzz.studies import extreme, near, studies, texts, toml

# What a line of a message may hold: it is for a person to read.
_LONGEST = 2000
# More cases than these are not planned here: the plan's own time is another matter.
_PLANNED = 200
_FACTORS = {"mm": "1e-3", "m": "1", "cm": "1e-2", "µm": "1e-6", "kPa": "1e3", "Pa": "1", "MPa": "1e6", "%": "1e-2"}
_SIMPLE = {
    "body": ("size", "radius", "height", "axes"), "material": ("young", "poisson"),
    "probe": ("radius", "depth", "length", "width", "axes", "tip"),
    "mesh": ("epsilon", "fine", "coarse", "rim", "growth", "accuracy"),
}  # fmt: skip


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("thrown") / "thrown.toml"


@given(raw=studies)
@thrown()
def test_any_study_is_accepted_or_refused_in_words(file, raw):
    file.write_text(toml(raw), encoding="utf-8")
    judge(file)


@given(raw=extreme())
@thrown(0.4)
def test_any_order_of_magnitude_is_planned_or_refused_in_words(file, raw):
    file.write_text(toml(raw), encoding="utf-8")
    judge(file)


@given(data=texts())
@thrown(0.3)
def test_any_bytes_are_accepted_or_refused_in_words(file, data):
    file.write_bytes(data)
    judge(file)


@given(raw=near())
@thrown(0.4)
def test_what_is_accepted_has_the_numbers_of_the_text(file, raw):
    file.write_text(toml(raw), encoding="utf-8")
    study = judge(file)
    if study is not None:
        compare(study, tomllib.loads(file.read_text(encoding="utf-8")))


def judge(file) -> Study | None:
    """Read and plan a study, None if it was refused; whatever else happens is a failure."""
    try:
        study = read_study(file)
    except StudyError as refused:
        lines = str(refused).split("\n")
        assert len(lines) == len(refused.problems), lines
        for line in lines:
            assert line.startswith(f"{file}: "), line
            assert len(line) < _LONGEST, line
            assert not any(map(is_control, line)), line
        return None
    assert not any(map(is_control, study.title))
    count = 1
    for axis in study.axes:
        assert len(set(axis.labels)) == len(axis) > 0
        count *= 1 if axis.is_stage else len(axis)
    if prod(study.shape) <= _PLANNED and not study.lacking:
        assert summary(make_plan(study))["cases"] == count
    return study


def is_control(letter: str) -> bool:
    """Tell what moves the cursor, or the direction of writing."""
    return unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") or letter == "\u202e"


def compare(study: Study, raw: dict[str, Any]) -> None:
    """Assert that plain keys have, over all cases, the numbers that stand in the text, read by a way of their own."""
    for section, names in _SIMPLE.items():
        tables = raw.get(section, {})
        if not isinstance(tables, dict):
            continue
        for key in set(names) & set(tables):
            value = tables[key]
            vector = key in ("size", "axes")
            swept = value if isinstance(value, list) and (not vector or isinstance(value[0], list)) else [value]
            found = {getattr(variant, key) for variant in study.sections[section]}
            if any(isinstance(v, dict) for v in swept):
                expected = sorted({one for v in swept for one in (spread(v) if isinstance(v, dict) else [number(v)])})
                assert sorted(found) == pytest.approx(expected, rel=1e-11), (section, key)
            else:
                assert found == {tuple(map(number, v)) if isinstance(v, list) else number(v) for v in swept}, key


def spread(table: dict[str, Any]) -> list[float]:
    """Return the values of a range."""
    start, end, steps = number(table["from"]), number(table["to"]), table["steps"]
    return [start + (end - start) * n / (steps - 1) for n in range(steps)]


def number(value: Any) -> float:
    """Read a number with its unit, exactly, and round it to what two inputs are compared in."""
    if value == "full":
        return inf
    if isinstance(value, str):
        digits, unit = re.fullmatch(r"\s*(\S+?)\s*([A-Za-zµ%]+)\s*", value).groups()  # type: ignore[union-attr]
        try:
            value = float(f"{float(Decimal(digits) * Decimal(_FACTORS[unit])):.12g}")
        except InvalidOperation:
            raise AssertionError(f"{value!r} was accepted") from None
        assert isfinite(value)
    return value


HUGE = {
    "large": (b"# " + b"x" * 2_000_000, "is larger than 1 MB"),
    "nested lists": (b"a = " + b"[" * 20_000, "nested too deeply"),
    "nested keys": (b".".join([b"a"] * 20_000) + b" = 1", "nested more than 12 levels"),
    "nested tables": (b"a = " + b"[" * 20 + b"]" * 20, "nested more than 12 levels"),
    "digits": (b"a = 1" + b"0" * 5000, "TOML syntax"),
    "an integer": (b"a = 0x" + b"f" * 50_000, "more than 64 bits"),
    "another encoding": ("title = 'é'".encode("utf-16"), "is not UTF-8 text"),
    "NUL": (b"title = 'a'\0", "TOML syntax"),
}


@pytest.mark.parametrize("name", HUGE)
def test_what_is_no_study_by_its_size_is_refused_at_once(file, name):
    data, message = HUGE[name]
    file.write_bytes(data)
    with pytest.raises(StudyError, match=message):
        read_study(file)


LONG = {
    "values": ({"material": {"poisson": [n / 1e5 for n in range(10_001)]}}, "has 10001 values: at most 10000"),
    "combinations": (
        {"material": {"young": [f"{n} Pa" for n in range(1, 502)], "poisson": [n / 1e3 for n in range(400)]}},
        "material: sweeps more than 200000 combinations",
    ),
    "cases": (
        {"material": {"poisson": [n / 1e5 for n in range(1000)]},
         "mesh": {"fine": [f"{n / 100} mm" for n in range(1, 202)]}},
        "has 201000 cases (1000 poisson × 201 fine): at most 200000",
    ),
    "places": (
        {"probe": {"path": {"raster": {axis: {"from": "-1 mm", "to": "1 mm", "steps": 20_000} for axis in "xy"}}}},
        "has 400000000 places: at most 20000",
    ),
    "unknown keys": ({"mesh": {f"k{n}": 1 for n in range(200)}}, "… and 150 more"),
    "a value": ({"material": {"young": "9" * 300}}, "…: must be a pressure"),
}  # fmt: skip


@pytest.mark.parametrize("name", LONG)
def test_more_than_any_study_needs_is_refused_before_it_is_gone_through(name):
    changes, message = LONG[name]
    with pytest.raises(StudyError) as refused:
        study(**changes)
    assert message in str(refused.value)


FOUND = {
    "a body that is a number": ({"body": [5]}, "body[1] = 5: must be a table"),
    "no bodies": ({"body": []}, "body = []: is an empty list"),
    "an empty body": ({"body": [{}]}, "body[1].name: is required"),
    "a name that is a list": (
        {"probe": [{"name": ["a"], "shape": "disc", "radius": "2 mm", "depth": ["0.1 mm", "0.2 mm"]}]},
        "probe[1].name = [\"a\"]: ",
    ),
    "a title that moves the cursor": ({"title": "a\x1b[2Jb"}, "must be one line of text"),
    "a key that turns the writing": ({"mesh": {"\u202eenif": "1 mm"}}, "mesh.\\u202eenif"),
}  # fmt: skip


@pytest.mark.parametrize("name", FOUND)
def test_what_was_found_stays_mended(name):
    changes, message = FOUND[name]
    with pytest.raises(StudyError) as refused:
        parse(raw() | changes if "mesh" not in changes else raw(**changes))
    assert message in str(refused.value)
