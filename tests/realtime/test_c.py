"""The evaluator in C by itself: C99 and C++, sanitizers, refusals of what C alone can be asked."""

import os
import shutil
import subprocess
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest

from epsmesh_realtime import BuildError, Query
from epsmesh_realtime import library as built
from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.table import Near
from tests.realtime.synthetic import random_model, random_surface

SOURCES = Path(__file__).parents[2] / "pipeline" / "epsmesh_realtime" / "c"
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
PARTS = sorted(SOURCES.glob("src/*.c"))
_TIPS = """
#include "epsmesh.h"
#include "epsmesh_patch.h"
#include <math.h>
#include <stdio.h>
static double bowl(double x, double y, void *user) { (void)user; return 30 * x * x + 120 * y * y; }
static double dent(double x, double y, void *user) { (void)user; return sqrt(sqrt(x * x + y * y)); }
int main(int count, char **words) {
    static epsmesh_model model;
    static epsmesh_patch patch;
    static double data[1 << 15];
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

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


def compiled(*arguments: object) -> str:
    found = subprocess.run([*map(str, arguments)], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    return found.stdout


def test_parts_are_short_and_names_are_those_of_the_headers(tmp_path):
    assert all(len(part.read_text().splitlines()) <= 400 for part in PARTS)
    compiled("cc", *STRICT, "-fPIC", "-c", SOURCES / "epsmesh.c", "-o", tmp_path / "epsmesh.o")
    listed = subprocess.run(["nm", "-g", "--defined-only", tmp_path / "epsmesh.o"], capture_output=True, check=True)
    assert {line.split()[-1].split("_")[0] for line in listed.stdout.decode().splitlines()} == {"epsmesh"}


@pytest.mark.parametrize(
    "compiler",
    ["gcc -std=c99", "clang -std=c99", *(f"{cpp} -std=c++{year}" for cpp in ("g++", "clang++") for year in (11, 17))],
)
def test_it_is_c_and_cpp_without_a_warning(tmp_path, compiler):
    name, standard = compiler.split()
    if shutil.which(name) is None:
        pytest.skip(f"there is no {name}")
    is_cpp = "++" in name
    programs = ("epsmesh.c", "test_epsmesh.c", "latency.c", "drag.c", *(["epsmesh_gradient.cpp"] if is_cpp else []))
    for program in programs:
        language = ("-x", "c++") if is_cpp else ()
        compiled(name, standard, *STRICT[1:], *language, "-c", SOURCES / program, "-o", tmp_path / "made.o")


def test_tools_at_once_are_of_one_tissue_and_not_too_many():
    evaluator, asked = random_model().evaluator, {"tool": "disc", "radius": 1e-3, "depth": 1e-4}
    places = [(x, 0.0, 0.0) for x in np.linspace(-0.025, 0.025, 17)]
    queries = [Query(at=at, **asked).packed(1e3, 0.4) for at in places]
    assert {touch.status for touch in evaluator.touch_all(queries)} == {"input"}
    assert {touch.status for touch in evaluator.touch_all(queries[:2])} <= {"ok", "near"}
    for other in ((2e3, 0.4), (1e3, 0.35)):
        mixed = [queries[0], Query(at=places[9], **asked).packed(*other)]
        assert [touch.status for touch in evaluator.touch_all(mixed)] == ["input", "input"]


@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"curved": True, "turned": True}])
def test_the_foot_of_a_tip_is_its_place_and_its_depth(kind):
    model, rng = random_model(**kind), np.random.default_rng(7)
    for _ in range(40):
        x, y = 0.7 * rng.uniform(-1, 1, 2) * model.table.reach
        spot, depth = model.spot(x, y), rng.uniform(1e-6, 1e-3)
        at = model.origin + np.array([x, y, spot.height]) @ model.axes
        status, place, below = model.foot(at - depth * spot.normal @ model.axes)
        assert status == "ok"
        np.testing.assert_allclose([*place, below], [*at, depth], rtol=1e-9, atol=1e-14)
        assert model.foot(at + 1e-4 * spot.normal @ model.axes)[0] == "no contact"
    gaps = np.ones((3, 2))
    gaps[:, 0] = at - depth * spot.normal @ model.axes
    np.testing.assert_array_equal(model.foot(gaps[:, 0])[1], place)
    assert model.foot((nan, 0.0, 0.0))[0] == "input"
    assert model.foot((0.0, 0.0))[0] == "input"


NEAR = Near(np.array([[[1.1, 0.08]], [[0.9, -0.1]]]), 1.2, 2e-3, 0.1, 0.08)
SANITIZE = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    """The evaluator and its derivatives with sanitizers, and the compiler that links them."""
    folder = tmp_path_factory.mktemp("objects")
    compiled("cc", *STRICT, *SANITIZE, "-c", SOURCES / "epsmesh.c", "-o", folder / "epsmesh.o")
    if shutil.which("c++") is None:
        return "cc", (), [folder / "epsmesh.o"]
    compiled("c++", *SANITIZE, "-O2", "-c", SOURCES / "epsmesh_gradient.cpp", "-o", folder / "gradient.o")
    return "c++", ("-DEPSMESH_GRADIENT",), [folder / "epsmesh.o", folder / "gradient.o"]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("program", "kind", "parts"),
    [
        ("test_epsmesh.c", {}, {}),
        ("test_epsmesh.c", {"curved": True, "is_even": False}, {}),
        ("test_epsmesh.c", {"is_round": True, "is_even": False}, {"relaxation": ((0.4, 2.0), (0.2, 30.0))}),
        ("test_epsmesh.c", {}, {"near": NEAR, "pairs": None}),
        ("tips.c", {}, {}),
    ],
)
def test_a_damaged_file_breaks_nothing(tmp_path, objects, program, kind, parts):
    """$EPSMESH_FUZZ_MODELS, of `make fuzz`, is the number of damaged files of each model; otherwise it is 30,000."""
    made = random_surface(**kind)
    write_model(tmp_path / "model.epsm", replace(made.model, **parts), {}, {"title": "random"}, made.table)
    (tmp_path / "tips.c").write_text(_TIPS)
    source = tmp_path / program if program == "tips.c" else SOURCES / program
    linker, defined, made_before = objects
    compiled("cc", *STRICT, *SANITIZE, *defined, "-I", SOURCES, "-c", source, "-o", tmp_path / "main.o")
    compiled(linker, *SANITIZE, tmp_path / "main.o", *made_before, "-o", tmp_path / "main", "-lm")
    files = [*filter(None, [os.environ.get("EPSMESH_FUZZ_MODELS")])] if program != "tips.c" else []
    print(compiled(tmp_path / "main", tmp_path / "model.epsm", *files))


@pytest.mark.parametrize(("compiler", "words"), [("", "there is no C compiler"), ("false", "does not compile")])
def test_without_a_compiler_a_sentence_says_what_to_install(tmp_path, monkeypatch, compiler, words):
    monkeypatch.setattr(built, "_PACKAGE", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.setattr(built, "_COMPILERS", {})
    monkeypatch.delenv("CC", raising=False)
    if compiler:
        monkeypatch.setenv("CC", compiler)
    built.library.cache_clear()
    try:
        with pytest.raises(BuildError, match=words):
            built.library()
        left = list((tmp_path / ".built" if compiler else tmp_path).iterdir())
        assert [path.name for path in left] == ([] if compiler else ["pyproject.toml"])
    finally:
        built.library.cache_clear()


def test_libraries_of_earlier_sources_are_removed_after_a_day(tmp_path, monkeypatch):
    (tmp_path / "pyproject.toml").touch()
    (tmp_path / "epsmesh.c").write_text("int one(void) { return 1; }\n")
    for folder in ("_PACKAGE", "_SOURCES"):
        monkeypatch.setattr(built, folder, tmp_path)
    first = built._built()
    (tmp_path / "epsmesh.c").write_text("int one(void) { return 2; }\n")
    second = built._built()
    assert first.exists()
    os.utime(first, (0, 0))
    of_other = second.with_name("epsmesh-other-machine-0.so")
    shutil.copy(first, of_other)
    os.utime(of_other, (0, 0))
    (tmp_path / "epsmesh.c").write_text("int one(void) { return 3; }\n")
    third = built._built()
    assert {*second.parent.iterdir()} == {third, second, of_other}
