"""The same patch in C: the same numbers and refusals, under sanitizers as well."""

import ctypes
import shutil
from dataclasses import replace
from math import nan

import numpy as np
import pytest

from pipeline.export.file import write_model
from pipeline.realtime import Patch, Tip
from tests.realtime.synthetic import random_model, write_random
from tests.realtime.test_c import SOURCES, STRICT, Query, Touch, compiled

HEIGHT = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_void_p)
ROOM = 1 << 20

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")

_PROGRAM = """
#include "epsmesh.c"
#include <stdio.h>
static double bowl(double x, double y, void *user) { (void)user; return 30 * x * x + 120 * y * y; }
static double dent(double x, double y, void *user) { (void)user; return sqrt(sqrt(x * x + y * y)); }
int main(int count, char **words) {
    static epsmesh_model model;
    static epsmesh_patch patch;
    static unsigned char data[1 << 18];
    FILE *file = fopen(words[count - 1], "rb");
    int i, k, seen = 0;
    if (!file || epsmesh_load(&model, data, fread(data, 1, sizeof data, file)) != EPSMESH_OK) return 2;
    fclose(file);
    if (epsmesh_patch_make(&patch, dent, NULL, 1e-3) != EPSMESH_INPUT) return 3;
    if (epsmesh_patch_make(&patch, NULL, NULL, 1e-3) != EPSMESH_INPUT) return 4;
    if (epsmesh_patch_make(&patch, bowl, NULL, 4e-3) != EPSMESH_OK) return 5;
    for (i = 0; i < 2000; i++) {
        epsmesh_query q = epsmesh_ask(&model);
        const double x = 1.1 * model.reach[0] * ((i * 7 % 41) / 20.0 - 1);
        for (k = 0; k < 3; k++) q.at[k] = model.origin[k] + x * model.axes[0][k];
        q.depth = i % 17 ? 1e-6 * (i % 500) : (i % 2 ? NAN : 1e300);
        seen |= 1 << epsmesh_patch_touch(&patch, &model, &q, i % 19 ? 0.1 * i : HUGE_VAL).status;
    }
    return seen & 1 && seen & 2 ? 0 : 6;
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("patch") / "libpatch.so"
    compiled("cc", *STRICT, "-fPIC", "-shared", SOURCES / "epsmesh.c", "-o", path, "-lm")
    found = ctypes.CDLL(str(path))
    found.epsmesh_patch_touch.restype = Touch
    found.epsmesh_patch_make.argtypes = [ctypes.c_void_p, HEIGHT, ctypes.c_void_p, ctypes.c_double]
    found.epsmesh_patch_touch.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double]
    found.epsmesh_word.restype = ctypes.c_char_p
    return found


@pytest.mark.parametrize("kind", [{}, {"turned": True}, {"is_round": True, "bare": True}])
def test_c_and_numpy_agree(library, tmp_path, kind):
    model = random_model(**{name: value for name, value in kind.items() if name != "bare"})
    if "bare" in kind:
        model = replace(model, table=replace(model.table, tensors=np.zeros((0, 1, 1, 1))))
    write_model(tmp_path / "model.nc", model, {}, {})
    data = (tmp_path / "model.nc").read_bytes()
    loaded, made = (ctypes.create_string_buffer(ROOM) for _ in range(2))
    assert library.epsmesh_load(loaded, data, ctypes.c_size_t(len(data))) == 0
    height = HEIGHT(lambda x, y, _: 30 * x**2 + 120 * y**2)
    assert library.epsmesh_patch_make(made, height, None, 4e-3) == 0
    patch, rng, seen = Patch(model, Tip(lambda x, y: 30 * x**2 + 120 * y**2, 4e-3)), np.random.default_rng(3), set()
    for number in range(60):
        x, y = rng.uniform(-1.02, 1.02, 2) * model.table.reach
        at, depth, turn = (
            model.origin + x * model.axes[0] + y * model.axes[1],
            rng.uniform(-2e-5, 4.9e-4),
            rng.uniform(0, 6),
        )
        depth = nan if number == 30 else depth
        expected = patch.query(at=at, depth=depth, turn=turn, young=2e4, poisson=0.4)
        triple = ctypes.c_double * 3
        query = Query(0, nan, nan, triple(*at), triple(0, 0, 0), depth, 2e4, 0.4)
        found = library.epsmesh_patch_touch(made, loaded, ctypes.byref(query), turn)
        assert library.epsmesh_word(found.status).decode() == expected.status
        seen.add(expected.status)
        if expected.status == "ok":
            size = np.linalg.norm(expected.force)
            assert np.abs(np.array(found.force) - expected.force).max() < (1e-6 if "bare" in kind else 1e-9) * size
            values = [found.force_error, found.stiffness, found.contact_radius]
            assert values == pytest.approx(
                [expected.force_error, expected.stiffness, expected.contact_radius], rel=1e-8
            )
    assert seen >= {"ok", "lost", "outside", "input"}


@pytest.mark.nightly
def test_nothing_breaks_it(tmp_path):
    write_random(tmp_path / "model.nc")
    (tmp_path / "main.c").write_text(_PROGRAM)
    sanitize = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    compiled("cc", *STRICT, *sanitize, "-I", SOURCES, tmp_path / "main.c", "-o", tmp_path / "main", "-lm")
    compiled(tmp_path / "main", tmp_path / "model.nc")


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler")
def test_it_is_cpp_as_well(tmp_path):
    strict = ("-std=c++11", *STRICT[1:])
    compiled("c++", *strict, "-x", "c++", "-c", SOURCES / "epsmesh.c", "-o", tmp_path / "patch.o")
