"""The same queries in C: the same numbers, the same refusals; sanitizers find nothing, and C++ takes it as well."""

import ctypes
import shutil
import subprocess
from math import nan
from pathlib import Path

import numpy as np
import pytest

from tests.realtime.synthetic import write_random

SOURCES = Path(__file__).parents[2] / "realtime"
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror")
SHAPES = ("disc", "sphere", "cone", "blade", "disc")

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


class Query(ctypes.Structure):
    _fields_ = (
        ("shape", ctypes.c_int), ("radius", ctypes.c_double), ("angle", ctypes.c_double), ("at", ctypes.c_double * 3),
        ("axis", ctypes.c_double * 3), ("depth", ctypes.c_double), ("young", ctypes.c_double),
        ("poisson", ctypes.c_double), ("length", ctypes.c_double), ("width", ctypes.c_double),
        ("along", ctypes.c_double * 3),
    )  # fmt: skip


class Touch(ctypes.Structure):
    _fields_ = (
        ("status", ctypes.c_int), ("force", ctypes.c_double * 3), ("force_error", ctypes.c_double),
        ("stiffness", ctypes.c_double), ("contact_radius", ctypes.c_double),
    )  # fmt: skip


def compiled(*arguments: object) -> None:
    found = subprocess.run([*map(str, arguments)], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr


def assert_same(found, expected, within):
    """All numbers of two touches, of forces ``within`` that share of the whole one, of others of themselves."""
    values, known = (
        np.array([*touch.force, touch.force_error, touch.stiffness, touch.contact_radius])
        for touch in (found, expected)
    )
    scale = np.array([*[np.linalg.norm(expected.force)] * 3, *known[3:]])
    assert np.all((np.abs(values - known) <= within * scale) | np.isnan(known))
    assert np.array_equal(np.isnan(values), np.isnan(known))


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("realtime") / "libepsmesh.so"
    compiled("cc", *STRICT, "-fPIC", "-shared", SOURCES / "epsmesh.c", "-o", path, "-lm")
    found = ctypes.CDLL(str(path))
    found.epsmesh_touch_at.restype, found.epsmesh_word.restype = Touch, ctypes.c_char_p
    return found


@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"is_round": True},
        {"turned": True},
        {"is_even": False},
        {"curved": True, "turned": True},
        {"curved": True, "is_round": True},
    ],
)
def test_c_and_numpy_agree(library, tmp_path, kind):
    model = write_random(tmp_path / "model.nc", **kind)
    data, room = (tmp_path / "model.nc").read_bytes(), ctypes.create_string_buffer(1 << 20)
    without = data.replace(b"bend_error", b"bend_other")
    assert (library.epsmesh_load(room, without, ctypes.c_size_t(len(data))) == 0) != ("curved" in kind)
    assert library.epsmesh_load(room, data, ctypes.c_size_t(len(data))) == 0
    rng, seen = np.random.default_rng(7), set()
    for number in range(600):
        shape = number % 5
        x, y = rng.uniform(-1.05, 1.05, 2) * model.table.reach
        spot = model.face.at(model.table, x, y)
        at = model.origin + np.array([x, y, spot.height]) @ model.axes
        along = rng.standard_normal(3)
        depth, radius = rng.uniform(-5e-5, 1e-3), (2e-3, 6e-3, 5e-3, 2e-3, 2e-3)[shape] * rng.uniform(0.5, 2)
        young, poisson = rng.uniform(1e3, 1e5), rng.uniform(0.29, 0.5)
        if number % 23 == 0:
            depth, at[2] = (nan, at[2]) if number % 2 else (depth, at[2] + 1e-3)
        asked = {"at": at, "depth": depth, "radius": radius, "angle": 1.1, "young": young, "poisson": poisson}
        asked |= {"length": 2 * radius, "width": 1e-3, "along": along, "axis": -spot.normal @ model.axes}
        asked |= {"contact": "bonded"} if shape == 4 else {}
        expected = model.query(SHAPES[shape], **asked)
        triple = ctypes.c_double * 3
        query = Query(shape, radius, 1.1, triple(*at), triple(*asked["axis"]), depth, young, poisson)
        query.length, query.width, query.along = 2 * radius, 1e-3, triple(*along)
        found = library.epsmesh_touch_at(room, ctypes.byref(query))
        assert library.epsmesh_word(found.status).decode() == expected.status
        if expected.status == "ok":
            place, below = triple(), ctypes.c_double()
            tip = triple(*(at - depth * np.array(spot.normal) @ model.axes))
            assert library.epsmesh_foot(room, tip, place, ctypes.byref(below)) == 0
            np.testing.assert_allclose([*place, below.value], [*at, depth], rtol=1e-9, atol=1e-14)
        assert_same(found, expected, 1e-12)
        seen.add(expected.status)
    assert seen >= {"ok", "lost", "outside", "poisson"}


@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"turned": True}, {"curved": True}])
def test_several_tools_are_those_of_numpy(library, tmp_path, kind):
    model = write_random(tmp_path / "model.nc", **kind)
    data, room = (tmp_path / "model.nc").read_bytes(), ctypes.create_string_buffer(1 << 20)
    assert library.epsmesh_load(room, data, ctypes.c_size_t(len(data))) == 0
    rng, seen, triple = np.random.default_rng(8), set(), ctypes.c_double * 3
    for number in range(250):
        count = int(rng.integers(1, 9)) if number % 2 else 2
        young, poisson = rng.uniform(1e3, 1e5), rng.uniform(0.295, 0.49)
        tools, queries = [], (Query * count)()
        for query in queries:
            shape = int(rng.integers(5))
            x, y = rng.uniform(-1.0, 1.0, 2) * model.table.reach / (np.sqrt(2) if "is_round" in kind else 1)
            at = model.origin + np.array([x, y, 0.0]) @ model.axes
            depth, radius = rng.uniform(-5e-5, 4e-4), (1e-3, 4e-3, 5e-3, 1e-3, 1e-3)[shape] * rng.uniform(0.3, 1)
            along, depth = rng.standard_normal(3), nan if rng.uniform() < 0.01 else depth
            tool = {"tool": SHAPES[shape], "at": at, "depth": depth, "radius": radius, "angle": 1.1, "along": along}
            tools.append(tool | {"length": 2 * radius, "width": 5e-4} | ({"contact": "bonded"} if shape == 4 else {}))
            query.shape, query.radius, query.angle, query.at, query.depth = shape, radius, 1.1, triple(*at), depth
            query.young, query.poisson, query.length, query.width = young, poisson, 2 * radius, 5e-4
            query.along = triple(*along)
        touches = (Touch * count)()
        library.epsmesh_touch_all(room, count, queries, touches)
        for found, expected in zip(touches, model.query_all(tools, young=young, poisson=poisson), strict=True):
            assert library.epsmesh_word(found.status).decode() == expected.status
            assert_same(found, expected, 1e-10)
            seen.add(expected.status)
    if "curved" in kind:
        assert seen >= {"alone", "off"}
        return
    assert seen >= {"ok", "lost", "near", "others", "poisson", "input"}
    good = list(queries)[:1] * 2
    for name, other in (("young", 2e3), ("poisson", 0.35)):
        queries = (Query * 2)(*good)
        for query in queries:
            query.young, query.poisson = 1e3, 0.4
        setattr(queries[1], name, other)
        touches = (Touch * 9)()
        library.epsmesh_touch_all(room, 2, queries, touches)
        assert [library.epsmesh_word(touch.status) for touch in touches[:2]] == [b"input", b"input"]
    library.epsmesh_touch_all(room, 9, (Query * 9)(*[good[0]] * 9), touches)
    assert {library.epsmesh_word(touch.status) for touch in touches} == {b"input"}


@pytest.mark.nightly
def test_a_damaged_file_breaks_nothing(tmp_path):
    write_random(tmp_path / "model.nc")
    program = tmp_path / "test_epsmesh"
    sanitize = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    compiled("cc", *STRICT, *sanitize, SOURCES / "epsmesh.c", SOURCES / "test_epsmesh.c", "-o", program, "-lm")
    compiled(program, tmp_path / "model.nc")


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler")
def test_it_is_cpp_as_well(tmp_path):
    strict = ("-std=c++11", *STRICT[1:])
    for name in ("epsmesh.c", "test_epsmesh.c"):
        compiled("c++", *strict, "-x", "c++", "-c", SOURCES / name, "-o", tmp_path / f"{name}.o")
