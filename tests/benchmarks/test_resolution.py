"""The files that the benchmark of files compares are of one body."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.resolution import BENDS, LIVER, REFERENCE, File, relative, surface, write
from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.triangles import enclosed
from scripts.make_organs import liver


def test_points_of_a_surface_are_on_the_true_one():
    coarse, fine = (surface(LIVER, step) for step in (10, 5))
    assert np.abs(liver(coarse[0])).max() < 1e-9
    # What chords leave out falls with the square of their length.
    left_out = [427.09e3 - enclosed(*one) for one in (coarse, fine)]
    assert 3 < left_out[0] / left_out[1] < 5


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.5, 0.25, 0.0)])
def test_a_grid_that_is_moved_leaves_the_body_where_it_is(offset: tuple[float, float, float], tmp_path: Path):
    body = write(File("grid", "image", 4, offset=offset), LIVER, tmp_path)
    triangles = read_image(Path(body["file"]), 1).triangles
    assert 1e6 * triangles.volume == pytest.approx(427.09, rel=5e-3)
    truth = _centre(*surface(LIVER, 5))
    assert np.linalg.norm(_centre(1e3 * triangles.points, triangles.facets) - truth) < 0.5


def _centre(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the centre of what is within."""
    corners = points[facets]
    volumes = np.linalg.det(corners)
    return np.asarray((volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4 * volumes.sum()))


def test_noise_moves_each_file_the_same_way(tmp_path: Path):
    quiet, noisy = (write(File(str(n), "noise", 8, noise=n), LIVER, tmp_path)["file"] for n in (0.0, 0.3))
    assert Path(quiet).stat().st_size == Path(noisy).stat().st_size
    assert Path(quiet).read_bytes() != Path(noisy).read_bytes()


def test_forces_are_told_relative_to_the_reference():
    row = {BENDS: {"force": 2.0, "axis": [0, 0, -1]}}
    other = {BENDS: {"force": 2.1, "axis": [0, np.sin(np.radians(2)), -np.cos(np.radians(2))]}}
    assert relative(other, row)[BENDS] == pytest.approx((5, 2))
    assert np.isnan(relative({BENDS: {"refused": "too steep"}}, row)[BENDS]).all()
    assert not REFERENCE.noise
