"""The scenes that NGSolve solves, too: their proportions, and what NGSolve is told of them."""

from pathlib import Path

import pytest

from benchmarks.strangers import for_ngsolve, scene
from tests.same.scenes import seconds


def test_a_seed_gives_its_scene_with_every_tool_and_mesh(tmp_path: Path) -> None:
    classes = [scene(seed, tmp_path)[1] for seed in range(30)]
    assert classes[:3] == [scene(seed, tmp_path)[1] for seed in range(3)]
    assert {c["tool"] for c in classes} == {"bonded disc", "frictionless disc", "ball"}
    assert {c["mesh"] for c in classes} == {"naive", "graded"}
    assert {c["order"] for c in classes} == {"1", "2", "3"}


def test_ngsolve_gets_the_layers_of_the_body_and_its_units(tmp_path: Path) -> None:
    layered = next(study for study, classes in (scene(s, tmp_path) for s in range(60)) if classes["layers"] == "3")
    job = for_ngsolve(layered)
    height = float(layered["body"]["height"].removesuffix(" mm"))
    assert len(job["layers"]) == 3
    assert sum(layer["thickness"] for layer in job["layers"]) == pytest.approx(height)
    young = float(layered["material"]["young"].removesuffix(" kPa"))
    assert job["layers"][-1]["young"] == pytest.approx(1e-3 * young)  # MPa
    assert job["layers"][0]["poisson"] == layered["body"]["layer"][0]["poisson"]
    assert seconds(layered, tmp_path) < float("inf")
