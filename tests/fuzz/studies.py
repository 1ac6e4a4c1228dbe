"""Study files to throw at the reader: good ones, good ones with something wrong in them, and nonsense."""

import copy
import datetime
import json
import tomllib
from math import inf, isinf, isnan, nan
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

# The project's own studies; bodies from files are thrown in tests/fuzz/test_files.py.
GOOD = [
    raw
    for path in sorted([*Path("studies").glob("*.toml"), *Path("docs/scenes").glob("*.toml")])
    if "file =" not in (text := path.read_text(encoding="utf-8"))
    for raw in [tomllib.loads(text)]
]
# Measurements name files that are read by `epsmesh identify` only.
GOOD.append(tomllib.loads(Path("studies/identify-two-punches.toml").read_text(encoding="utf-8")))
_UNITS = (
    "mm", "m", "cm", "µm", "kPa", "Pa", "MPa", "%", "deg", "s", "kg/m^3", "m/s^2", "kpa", "mmHg", "N/mm", "mN", "",
)  # fmt: skip
_NUMBERS = (
    "0", "-1", "1", "10", "0.5", "1e308", "-1e308", "1e-308", "5e-324", "1e999", "nan", "inf", "10,5", "−3", "٣",
)  # fmt: skip
_WORDS = (
    "full", "coarse", "free", "fixed", "halfspace", "green", "bonded", "frictionless", "unilateral", "pierce",
    "cut", "box", "cylinder", "ellipsoid", "disc", "blade", "sphere", "cone", "wedge", "cad", "surface",
    "image", "bottom", "sides", "all", "neo-hookean", "../../etc/passwd", "/dev/zero", "a\0b",
    "\x1b]0;title\x07", "\u202eevil", "é" * 300, "", "💥",
)  # fmt: skip
_KEYS = (
    "name", "shape", "size", "radius", "axes", "fixed", "young", "poisson", "density", "law", "action", "depth",
    "at", "axis", "contact", "motion", "epsilon", "fine", "coarse", "rim", "growth", "outside", "degree",
    "element", "model", "accuracy", "mesh_depths", "method", "energy_tolerance", "reduced_basis_error",
    "exact", "timing", "repeats",
    "without", "stop_near_exact", "gravity", "traction", "layer", "inclusion", "path", "file", "unit", "slice",
    "incision", "title", "measurement", "identify", "columns",
    "window", "sign", "machine_stiffness", "unknown", "may_hide",
    "body", "mesh", "probe", "x", "épsilon", "a b", "", "\0", "\u202e",
)  # fmt: skip

quantities = st.builds("{} {}".format, st.one_of(st.sampled_from(_NUMBERS), st.integers(-99, 99).map(str)),
                       st.sampled_from(_UNITS))  # fmt: skip
numbers = st.one_of(
    st.sampled_from([nan, inf, -inf, 1e308, 5e-324, 0, -0.0, 1, 2, 0.3, 0.45, 0.5, 10**30, -(2**63)]),
    st.integers(), st.floats(),
)  # fmt: skip
leaves: st.SearchStrategy[Any] = st.one_of(
    quantities, numbers, st.sampled_from(_WORDS), st.booleans(), st.text(st.characters(codec="utf-8"), max_size=8),
    st.dates(), st.times(),
    st.datetimes(min_value=datetime.datetime(1000, 1, 1)),
)  # fmt: skip
keys = st.one_of(st.sampled_from(_KEYS), st.text(st.characters(codec="utf-8"), max_size=5))
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(keys, inner, max_size=4)),
    max_leaves=12,
)
# What is near to what stood there: most of it is accepted.
_GENTLE = {
    "mm": st.floats(1e-6, 1e3).map(lambda v: f"{v:.6g} mm"),
    "kPa": st.floats(1e-6, 1e6).map(lambda v: f"{v:.6g} kPa"),
    "deg": st.floats(1, 89).map(lambda v: f"{v:.6g} deg"),
}


@st.composite
def near(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a good study of which one to three values are others of their kind, or lists of them."""
    raw = copy.deepcopy(draw(st.sampled_from(GOOD)))
    for _ in range(draw(st.integers(1, 3))):
        holder, key = draw(st.sampled_from(_places(raw)))
        value = holder[key]
        unit = value.split()[-1] if isinstance(value, str) and value.split() else ""
        kind = _GENTLE.get(unit, st.floats(0, 0.5) if isinstance(value, float) else st.just(value))
        holder[key] = draw(st.one_of(kind, kind, st.lists(kind, min_size=1, max_size=3)))
    return raw


@st.composite
def extreme(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a good study of which one or two quantities have another order of magnitude, up to what no double holds."""
    raw = copy.deepcopy(draw(st.sampled_from(GOOD)))
    measured = [
        (holder, key) for holder, key in _places(raw)
        if isinstance(holder[key], float) or (isinstance(holder[key], str) and holder[key].split()[-1:][0] in _GENTLE)
    ]  # fmt: skip
    for _ in range(draw(st.integers(1, 2))):
        holder, key = draw(st.sampled_from(measured))
        power, value = draw(st.one_of(st.integers(-40, 40), st.integers(-320, 308))), holder[key]
        holder[key] = float(f"1e{power}") if isinstance(value, float) else f"3e{power} {value.split()[-1]}"
    return raw


@st.composite
def broken(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a good study with one to four things wrong: values, keys, sections, lists, doublets."""
    raw = copy.deepcopy(draw(st.sampled_from(GOOD)))
    for _ in range(draw(st.integers(1, 4))):
        places = _places(raw)
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        match draw(st.integers(0, 7)):
            case 0 | 1:
                holder[key] = draw(trees)
            case 2:
                del holder[key]
            case 3:
                holder[key] = [holder[key]]
            case 4:
                holder[key] = [holder[key]] * draw(st.integers(0, 3))
            case 5 if isinstance(holder, dict):
                holder[draw(keys)] = draw(trees)
            case 6:
                holder[key] = draw(leaves)
            case _:
                other, source = draw(st.sampled_from(places))
                holder[key] = copy.deepcopy(other[source])
    return raw


nonsense = st.dictionaries(keys, trees, max_size=6)
studies = st.one_of(near(), extreme(), broken(), broken(), nonsense)


@st.composite
def texts(draw: st.DrawFn) -> bytes:
    """Draw the bytes of a file: a study's, cut off, flipped, doubled, or with something put in."""
    data = bytearray(toml(draw(st.sampled_from(GOOD))).encode())
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        match draw(st.integers(0, 3)):
            case 0:
                del data[at:]
            case 1 if data:
                data[at] ^= 1 << draw(st.integers(0, 7))
            case 2:
                data += data[at:]
            case _:
                data[at:at] = draw(
                    st.one_of(st.binary(max_size=6), st.sampled_from([b"\0", b"[[", b"\xff\xfe", b'"""']))
                )
    return bytes(data)


def toml(raw: dict[str, Any]) -> str:
    """Write a study as TOML, one line a key of a section."""
    return "".join(f"{_text(key)} = {inline(value)}\n" for key, value in raw.items())


def inline(value: Any) -> str:
    """Write a value as TOML, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_text(k)} = {inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "nan" if isnan(value) else ("-inf" if value < 0 else "inf") if isinf(value) else repr(value)
    return value.isoformat() if isinstance(value, datetime.date | datetime.time) else str(value)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """Return every place of a tree, as what holds it and its key there."""
    found: list[tuple[Any, Any]] = []
    for key, value in list(tree.items() if isinstance(tree, dict) else enumerate(tree)):
        found.append((tree, key))
        if isinstance(value, dict | list):
            found += _places(value)
    return found
