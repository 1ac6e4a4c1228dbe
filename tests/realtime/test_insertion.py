"""Insertions in C: no motion gains energy, what is refused, and files that are damaged."""

import shutil
import subprocess
from math import inf, nan

import numpy as np
import pytest

from epsmesh_realtime import Insertion, ModelError, PathModel
from epsmesh_realtime.file import pack
from tests.realtime.test_c import SOURCES, STRICT, compiled

# A needle by formulas: F = K d² before the puncture, then constant forces of the shaft, and friction that grows.
K, STORED, TORN, RUB, PUNCTURE, END = 2e4, 6e-3, 3e-3, 7.5, 1.1e-3, 6e-3
_FUZZ = """
#include "epsmesh_insertion.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static unsigned char whole[1 << 16], bytes[1 << 16];
static double room[1 << 13]; /* aligned */
int main(int count, char **words) {
    static epsmesh_path path;
    epsmesh_insertion state;
    FILE *file = fopen(words[1], "rb");
    size_t size = file ? fread(whole, 1, sizeof whole, file) : 0;
    int i, k, loaded = 0, rounds = count > 2 ? atoi(words[2]) : 1000;
    if (!size) return 2;
    fclose(file);
    srand(1);
    for (i = 0; i < rounds; i++) {
        size_t length = size;
        memcpy(bytes, whole, size);
        for (k = rand() % 4; k >= 0; k--) bytes[(size_t)rand() % size] = (unsigned char)rand();
        if (i % 7 == 0) length = (size_t)rand() % size;
        memcpy(room, bytes, length);
        if (epsmesh_path_load(&path, room, length) != EPSMESH_OK) continue;
        loaded++;
        epsmesh_insertion_begin(&state, &path, i % 3 ? 0 : 1e-4);
        for (k = 0; k < 50; k++)
            epsmesh_insertion_to(&state, &path, k == 20 ? HUGE_VAL : 1e-5 * (rand() % 700) - 1e-3);
    }
    return loaded > rounds / 20 && loaded < rounds ? 0 : 3;
}
"""


def arrays(**changes):
    """Return the tables of a needle of formulas, with some rows changed."""
    intact, cut = np.linspace(0, PUNCTURE, 80), np.linspace(PUNCTURE, END, 50)
    advance = np.zeros((130, 8))
    advance[:80, :2] = np.column_stack([intact, K * intact**2])
    advance[80:, :4] = np.column_stack([cut, 0 * cut + STORED, 0 * cut + TORN, RUB * cut])
    advance[80:, 5], advance[80:, 6] = cut, 1.0
    advance[:, 4] = 1e-4
    back = np.linspace(0, END, 40)
    ends = np.minimum(back / 0.5e-3, 1.0)
    table = np.column_stack([back, STORED * ends, RUB * back, 0 * back + 1e-4, 0 * back])
    punctures = [[PUNCTURE, 1e-5, K * PUNCTURE**2, 1e-4, STORED + TORN + RUB * PUNCTURE]]
    return {"path_advance": advance, "path_back": table, "path_punctures": punctures, "path_slip": 25e-6} | changes


def walked(rng, count, step):
    """Return depths (m) of a random walk, in the model's range and above the tissue."""
    depths, at = [], 0.0
    for _ in range(count):
        at = float(np.clip(at + rng.choice([-1, 1]) * step * rng.integers(1, 40), -1e-3, END))
        depths += np.linspace(depths[-1] if depths else 0.0, at, 40)[1:].tolist()
    return np.array(depths)


@pytest.mark.parametrize("slip", [None, 2e-4, 2e-3])
def test_no_motion_gains_energy(slip):
    """The work of the tool is positive from the first touch on: for small steps, on any way, however friction turns."""
    model = PathModel.of(arrays())
    for seed in range(6):
        depths = walked(np.random.default_rng(seed), 300, 4e-5)
        found = Insertion(model, slip=slip).query_many(depths)
        moved, force = np.diff(depths, prepend=0.0), found.force
        # At the end of each step, as for a tool that moves there at that force.
        work = np.cumsum(force * moved)
        assert work.min() > -1e-3 * K * PUNCTURE**3
        stored = STORED * END
        assert work[-1] > -stored


def test_a_loop_in_the_channel_dissipates_its_friction():
    model, low, high = PathModel.of(arrays()), 2e-3, 5e-3
    tool = Insertion(model, slip=1e-5)
    tool.query_many(np.linspace(0, 5.5e-3, 500))
    loop = np.concatenate([np.linspace(high, low, 6001), np.linspace(low, high, 6001)[1:]])
    tool.query(high)
    found = tool.query_many(loop)
    work = float(np.sum((found.force[1:] + found.force[:-1]) / 2 * np.diff(loop)))
    assert work == pytest.approx(RUB * (high**2 - low**2), rel=0.01)


def test_friction_reverses_over_the_slip_and_the_bar_has_what_coulomb_says():
    slip = 1e-4
    tool = Insertion(PathModel.of(arrays()), slip=slip)
    tool.query_many(np.linspace(0, 4e-3, 200))
    for share in (0.25, 1.0, 1.75):
        found = tool.query(4e-3 - share * slip)
        rubs = RUB * (4e-3 - share * slip)
        assert found.friction == pytest.approx((1 - share) * rubs, abs=1e-9)
        assert found.cutting == pytest.approx(max(0.0, 1 - share) * TORN, abs=1e-12)
        law = STORED - rubs  # pulled out at once
        assert abs(found.force - law) <= found.force_error and found.stiffness > 0
    slid = tool.query(3.5e-3)
    assert slid.friction == pytest.approx(-RUB * 3.5e-3) and slid.force_error == pytest.approx(1e-4)


def test_near_the_puncture_the_bar_has_both_sides():
    tool = Insertion(PathModel.of(arrays()))
    jump = K * PUNCTURE**2 - STORED - TORN - RUB * PUNCTURE
    for depth in (PUNCTURE - 5e-6, PUNCTURE + 5e-6):
        assert tool.query(depth).force_error >= jump
    assert tool.query(PUNCTURE + 2e-5).force_error < 1e-3


def test_stiffness_is_the_change_of_the_force():
    step = 1e-9
    for depths in ([8e-4], [3e-3], [4e-3, 2e-3], [4e-3, 2e-3, 2.5e-3], [4e-3, 3.99e-3]):
        tool, other = (Insertion(PathModel.of(arrays())) for _ in range(2))
        way = np.sign(np.diff([0.0, *depths])[-1])
        for one in (tool, other):
            for depth in depths:
                found = one.query(depth)
        assert tool.query(depths[-1] + way * step).force - found.force == pytest.approx(
            found.stiffness * way * step, rel=1e-4
        )


def test_what_is_not_known_is_refused():
    tool = Insertion(PathModel.of(arrays()))
    assert tool.query(nan).status == "input" and tool.query(2e-3).status == "ok"
    deeper = tool.query(1.01 * END)
    assert deeper.status == "deep" and "larger" in deeper.message and np.isnan(deeper.force)
    lost = tool.query(2e-3)
    assert lost.status == "history" and np.isnan(lost.force_error)
    with pytest.raises(ValueError, match="slip must be a positive length"):
        Insertion(tool.model, slip=inf)
    with pytest.raises(ValueError, match="shape"):
        tool.query_many([[1e-3]])
    with pytest.raises(TypeError):
        tool.query("1 mm")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"path_slip": 0.0}, "path_slip has an invalid value"),
        ({"path_advance": arrays()["path_advance"][:, :7]}, "path_advance has an invalid type or shape"),
        ({"path_advance": arrays()["path_advance"][::-1]}, "path_advance has an invalid value"),
        ({"path_advance": -arrays()["path_advance"]}, "path_advance has an invalid value"),
        ({"path_back": arrays()["path_back"][:1]}, "path_back has an invalid value"),
        ({"path_punctures": [[nan] * 5]}, "path_punctures is not finite"),
    ],
)
def test_tables_that_are_none_are_refused(changes, told):
    with pytest.raises(ModelError, match=told):
        PathModel.of(arrays(**changes))


def test_other_files_are_no_insertions():
    for data, told in ((b"", "no real-time model"), (pack({"c_ref": 1.0}), "has no path_advance")):
        with pytest.raises(ModelError, match=told):
            PathModel(data)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_a_damaged_path_breaks_nothing(tmp_path):
    (tmp_path / "path.epsm").write_bytes(pack(arrays()))
    (tmp_path / "fuzz.c").write_text(_FUZZ)
    sanitize = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    sources = (SOURCES / "epsmesh.c", tmp_path / "fuzz.c")
    compiled("cc", *STRICT, *sanitize, "-I", SOURCES, *sources, "-o", tmp_path / "fuzz", "-lm")
    done = subprocess.run(
        [tmp_path / "fuzz", tmp_path / "path.epsm", "4000"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
