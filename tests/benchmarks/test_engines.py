"""The comparison with simulators: one scene for all, its tables, and what fails is told."""

import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from benchmarks.engines import __main__ as engines
from benchmarks.engines import figure, scene
from benchmarks.engines.results import Truth, best, errors, scan_table, table, truths_table
from benchmarks.engines.settings import DEFAULTS, SCANS

TRUTH = Truth(0.5, 0.4, 0.001, 0.002, 3.1e-3)


def answer(up, dragged, *, failed="", **setting):
    if failed:
        return {"setting": setting, "failed": failed}
    found = scene.Outcome([0.0, 0.0, up], [0.01, 0.0, dragged], 0.0, 3e-3, math.nan, 4.0, 1e-3, 1215, "1.0")
    return {"setting": setting} | asdict(found)


def test_the_ball_goes_down_smoothly_stays_and_is_dragged():
    times = np.linspace(0, scene.END, 2001)
    along, depths = np.array([scene.place(t) for t in times]).T
    assert depths[0] == -scene.GAP
    assert depths.max() == depths[-1] == pytest.approx(scene.DEPTH)
    assert np.abs(np.diff(depths)).max() < 2 * scene.DEPTH / scene.RAMP * times[1]
    assert not along[depths < scene.DEPTH - 1e-12].any()
    assert along[-1] == pytest.approx(scene.WAY)


def test_tetrahedra_fill_the_pad():
    points, cells = scene.tetrahedra(5e-3)
    volumes = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(scene.SIDE**2 * scene.HEIGHT)
    faces = np.sort(cells[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    _, shared = np.unique(faces, axis=0, return_counts=True)
    assert set(shared) == {1, 2}
    assert (shared == 1).sum() == 2 * (2 * 8 * 8 + 4 * 8 * 4)


def test_an_outcome_is_of_the_ends_of_hold_and_drag():
    log = scene.Log(1e-3, "1.0", 10)
    for t in log.times():
        x, depth = scene.place(t)
        log.add(t, (0.0, 0.0, 5.0 + x if depth > scene.DEPTH - 1e-9 else 0.0), 2e-3, 0.0)
    log.spent = 0.8
    found = log.outcome()
    assert found.force == pytest.approx([0.0, 0.0, 5.0])
    assert found.dragged[2] == pytest.approx(5.0 + 0.95 * scene.WAY, rel=1e-3)
    assert found.step_ms == pytest.approx(1.0)
    log.add(0.3, (0.0, 0.0, math.nan))
    with pytest.raises(ArithmeticError, match="not stable"):
        log.outcome()


def test_the_best_has_the_smaller_of_the_larger_errors_and_failures_are_told(tmp_path):
    found = {
        "MuJoCo": [answer(0.1, 0.08), answer(0.55, 0.38, size=5e-3), answer(0.5, 0.2, size=4e-3)],
        "PyBullet": [answer(0, 0, failed="ArithmeticError: the simulation is not stable")],
    }
    chosen = best(found["MuJoCo"], TRUTH)
    assert chosen["setting"] == {"size": 5e-3}
    assert errors(chosen, TRUTH) == pytest.approx((0.1, -0.05, 0.025))
    assert best(found["PyBullet"], TRUTH) is None
    text = table(found, TRUTH)
    assert "| MuJoCo 1.0 | default | 0.100 | -80% |" in text
    assert "| MuJoCo 1.0 | best of 3 | 0.550 | +10% | 0.380 | -5% | +2.5% |" in text
    assert "| PyBullet | default | ArithmeticError: the simulation is not stable |" in text
    assert "size, mm 4" in scan_table(found, TRUTH)
    assert "0.5000 ± 0.0010" in truths_table({"linear": TRUTH})
    assert figure.draw(found, TRUTH, tmp_path / "engines.png").stat().st_size > 10_000


def test_what_has_run_is_kept(tmp_path, monkeypatch):
    asked = []

    def run(engine, settings, folder):
        asked.append(len(settings))
        for number, setting in enumerate(settings[:2]):  # it crashes in the second one
            yield answer(0.5, 0.4, **setting) if number == 0 else {"setting": setting, "failed": "it ended"}

    monkeypatch.setattr(engines, "run", run)
    monkeypatch.setattr(engines, "PYTHON", tmp_path)
    found = engines.answers("PyBullet", tmp_path, again=False)
    assert [one["setting"] for one in found] == [DEFAULTS["PyBullet"], *SCANS["PyBullet"]]
    count = len(asked)
    assert json.dumps(engines.answers("PyBullet", tmp_path, again=False)) == json.dumps(found)
    assert len(asked) == count


@pytest.mark.nightly
@pytest.mark.skipif(not engines.PYTHON.exists(), reason="scripts/engines.sh has not been run")
def test_engines_answer(tmp_path):
    for engine in ("MuJoCo", "PyBullet"):
        (found,) = engines.run(engine, [{"size": 1e-2}], tmp_path)
        assert 0.05 < found["force"][2] < 5, found
