"""Pictures show the body: something is drawn, at the size that is promised, in colours of the scale."""

import ctypes
import os
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from tests.cases import study
from tests.commands import epsmesh

pytest.importorskip("pyvista", reason="an optional extra: make setup EXTRAS=view")
if not os.environ.get("DISPLAY"):
    try:
        ctypes.CDLL("libEGL.so.1")
    except OSError:
        pytest.skip("no libEGL to draw without a display", allow_module_level=True)


def fields(mesh_only=False, **changes):
    from epsmesh.run.solved import solve_alone
    from epsmesh.view.compute import compute_fields

    made = study(**changes)
    (case,) = made.cases()
    return compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=mesh_only)


def colours(path):
    """Shares of the picture that are white, black and red."""
    from matplotlib.image import imread

    image = imread(path)[..., :3]
    assert image.shape == (720, 1200, 3)
    red = (image[..., 0] > 0.7) & (image[..., 1:].max(axis=-1) < 0.35)
    return np.mean(image.min(axis=-1) > 0.99), np.mean(image.max(axis=-1) < 0.1), np.mean(red)


@pytest.mark.parametrize(
    "changes",
    [
        {"mesh": {"epsilon": "8 mm"}},
        {"mesh": {"epsilon": "8 mm", "outside": "free"}},
        {"probe": {"at": ["5 mm", "-3 mm"]}, "mesh": {"epsilon": "6 mm"}},
        {"body": {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}},
    ],
)
def test_body_epsilon_and_probe_are_drawn(changes, tmp_path):
    from epsmesh.view.picture import draw_deformed, draw_mesh

    found = fields(**changes)
    deformed, factor = draw_deformed(found, tmp_path / "deformed.png", "a case")
    for path in (draw_mesh(found, tmp_path / "mesh.png", "a case"), deformed):
        white, _, red = colours(path)
        assert 0.2 < white < 0.75
        assert red > 1e-3
    # The deepest point of the dent is about 3 mm of a body of 20 mm.
    assert 0.05 * 20e-3 < factor * 0.2e-3 <= 0.15 * 20e-3


def test_epsilon_is_drawn_where_there_is_one(tmp_path):
    from epsmesh.view.picture import draw_mesh

    black = [
        colours(draw_mesh(fields(mesh_only=True, mesh={"epsilon": epsilon}), tmp_path / "mesh.png", "a case"))[1]
        for epsilon in ("8 mm", "full")
    ]
    assert black[0] > 1.1 * black[1]


def test_command_writes_both_pictures_and_says_the_factor(tmp_path):
    file = Path(__file__).parents[2] / "studies/quick.toml"
    folders = ["--output", str(tmp_path / "out"), "--meshes", str(tmp_path / "meshes")]
    done = epsmesh("view", file, "3", *folders)
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"quick_3_mesh.png", "quick_3_deformed.png"}
    assert "quick_3_deformed.png (displacement 10 × as large)" in done.output


def test_there_is_no_deformation_of_a_mesh(tmp_path):
    from epsmesh.view.picture import draw_deformed

    with pytest.raises(ValueError, match="meshed only"):
        draw_deformed(fields(mesh_only=True), tmp_path / "deformed.png", "a case")
