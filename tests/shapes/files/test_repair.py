"""Broken surfaces are refused with what was found; effects of `repair = true` and `smooth`, and their notices."""

import sys
from pathlib import Path

import numpy as np
import pytest

from epsmesh.shapes.files.read import read_surface
from epsmesh.shapes.triangles import SurfaceError
from tests.shapes.files.broken import Broken, corpus
from tests.shapes.files.solids import ball, stl

VOLUME = 4 / 3 * np.pi * 40 * 30 * 20 * 1e-9


@pytest.mark.parametrize("broken", corpus(), ids=lambda broken: broken.name)
def test_a_broken_file_is_refused_with_what_was_found_and_is_repaired_if_it_can_be(broken: Broken, tmp_path: Path):
    path = tmp_path / broken.name
    path.write_bytes(broken.data)
    for repair in (False,) if broken.repairs else (False, True):
        with pytest.raises(SurfaceError) as refused:
            read_surface(path, broken.unit, repair=repair)
        assert repair or all(word in str(refused.value) for word in broken.words), refused.value
    if broken.repairs:
        loaded = read_surface(path, broken.unit, repair=True)
        assert loaded.triangles.volume == pytest.approx(VOLUME, rel=0.02)
        assert any(notice.startswith("repaired") for notice in loaded.notices)


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path: Path):
    with pytest.raises(SurfaceError, match="No such file"):
        read_surface(tmp_path / "liver.stl", 1e-3)
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(SurfaceError, match="directory"):
        read_surface(tmp_path / "folder.stl", 1e-3)


def test_a_good_file_is_left_as_it_is(tmp_path: Path):
    path = tmp_path / "organ.stl"
    path.write_bytes(stl(ball()))
    loaded = read_surface(path, 1e-3, repair=True)
    assert loaded.triangles.hash == read_surface(path, 1e-3).triangles.hash
    assert loaded.notices == ()


@pytest.mark.parametrize("splits", [4, 5])
def test_smoothing_takes_noise_off_and_leaves_the_shape(splits: int, tmp_path: Path):
    points, facets = ball(splits)
    points = points + 0.1 * np.random.default_rng(2).standard_normal(points.shape)
    path = tmp_path / "noisy.stl"
    path.write_bytes(stl((points, facets)))

    def roughness(smooth: float | None) -> float:
        place = 1e3 * read_surface(path, 1e-3, smooth=smooth).triangles.points / (40, 30, 20)
        level = np.linalg.norm(place, axis=1)
        return float(((level - 1) * level / np.linalg.norm(place / (40, 30, 20), axis=1)).std())

    assert roughness(2e-3) < 0.5 * roughness(None)
    loaded = read_surface(path, 1e-3, smooth=2e-3)
    assert loaded.triangles.volume == pytest.approx(read_surface(path, 1e-3).triangles.volume, rel=2e-3)
    assert any(notice.startswith("smoothed: volume") for notice in loaded.notices)


def test_smoothing_a_ball_shrinks_it_as_its_filter_says(tmp_path: Path):
    path = tmp_path / "ball.stl"
    path.write_bytes(stl(ball(4, (30.0, 30.0, 30.0))))
    radius = np.linalg.norm(read_surface(path, 1e-3, smooth=6e-3).triangles.points, axis=1)
    plain = np.linalg.norm(read_surface(path, 1e-3).triangles.points, axis=1)
    # Coordinates of a ball are waves with k² = 2 / R².
    assert np.allclose(radius / plain, 1 / (1 + 4 * 0.2**4), rtol=1e-3)


def test_too_much_smoothing_is_refused(tmp_path: Path):
    path = tmp_path / "organ.stl"
    path.write_bytes(stl(ball()))
    with pytest.raises(SurfaceError, match="would change the volume"):
        read_surface(path, 1e-3, smooth=20e-3)


def test_without_meshfix_it_is_said_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pymeshfix._meshfix", None)
    path = tmp_path / "open.stl"
    points, facets = ball()
    path.write_bytes(stl((points, facets[1:])))
    with pytest.raises(SurfaceError, match="pip install pymeshfix"):
        read_surface(path, 1e-3, repair=True)
    path.write_bytes(stl((points, np.vstack([facets[:1, ::-1], facets[1:]]))))
    assert "repaired: 1 inverted facets turned" in read_surface(path, 1e-3, repair=True).notices
