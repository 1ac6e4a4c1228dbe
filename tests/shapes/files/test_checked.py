"""Cache of checked surfaces: each is checked once, and the cached surface is the same."""

import nrrd
import numpy as np
import pytest

from epsmesh.shapes.files import checked, image, read
from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.read import read_surface
from epsmesh.shapes.triangles import SurfaceError
from tests.organs import ellipsoid, write_stl


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(checked, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(checked, "_SMALL", 1000)
    read._load.cache_clear()
    image._load.cache_clear()
    return tmp_path


def again(path, unit=1e-3, **given):
    read._load.cache_clear()
    return read_surface(path, unit, **given)


def refuse(*_):
    raise AssertionError("was checked again")


def test_a_surface_is_checked_once(folder, monkeypatch):
    path = write_stl(folder / "body.stl", *ellipsoid(8))
    first = read_surface(path, 1e-3)
    monkeypatch.setattr(read, "made_whole", refuse)
    second = again(path)
    assert second.triangles.hash == first.triangles.hash and second.notices == first.notices
    for other in ({"unit": 1e-2}, {"repair": True}, {"smooth": 1e-3}):
        with pytest.raises(AssertionError, match="checked again"):
            again(path, **other)
    write_stl(path, *ellipsoid(9))
    with pytest.raises(AssertionError, match="checked again"):
        again(path)


def test_what_is_cut_short_is_made_again(folder):
    path = write_stl(folder / "body.stl", *ellipsoid(8))
    first = read_surface(path, 1e-3)
    (kept,) = (folder / "cache" / "surfaces").glob("*.npz")
    whole = kept.read_bytes()
    for content in (b"", whole[:200], whole[: len(whole) // 2]):
        kept.write_bytes(content)
        assert again(path).triangles.hash == first.triangles.hash
        assert kept.read_bytes()[:4] == whole[:4]


def test_what_is_refused_is_refused_again(folder):
    points, facets = ellipsoid(8)
    path = write_stl(folder / "open.stl", points, facets[1:])
    for _ in range(2):
        with pytest.raises(SurfaceError):
            again(path)
    assert not np.any([*(folder / "cache").glob("surfaces/*")])


def write_ball(path, radius=9.0):
    places = np.stack(np.meshgrid(*[np.arange(25)] * 3, indexing="ij"), -1)
    ball = (np.linalg.norm(places - 12, axis=-1) < radius).astype(np.uint8)
    header = {"space": "left-posterior-superior", "space directions": np.eye(3), "space origin": np.zeros(3)}
    nrrd.write(str(path), ball + ball * (places[..., 0] > 12), header)
    return path


def image_again(path, label=1, **given):
    image._load.cache_clear()
    return read_image(path, label, **given)


@pytest.mark.parametrize("name", ["ball.nrrd", "ball.nhdr"])
def test_the_surface_round_a_label_is_made_once(name, folder, monkeypatch):
    path = write_ball(folder / name)
    first = image_again(path)
    monkeypatch.setattr(image, "surface_of", refuse)
    second = image_again(path)
    assert second.triangles.hash == first.triangles.hash and second.notices == first.notices
    for other in ({"label": 2}, {"unit": 1e-3}, {"smooth": 1e-3}):
        with pytest.raises(AssertionError, match="checked again"):
            image_again(path, **other)
    monkeypatch.setattr(image, "_METHOD", image._METHOD + 1)
    with pytest.raises(AssertionError, match="checked again"):
        image_again(path)


def test_the_data_that_a_header_names_count(folder):
    """If only the data file beside a header changes, the surface changes: within one process, and on disk."""
    path = write_ball(folder / "ball.nhdr")
    header, first = path.read_bytes(), read_image(path, 1).triangles
    write_ball(path, radius=8.0)
    path.write_bytes(header)  # the library writes the time of day into a comment
    second = read_image(path, 1).triangles
    assert second.volume < 0.8 * first.volume
    assert image_again(path).triangles.hash == second.hash
    (folder / "ball.raw.gz").unlink()
    with pytest.raises(SurfaceError, match=r"data file of its header, .*ball\.raw\.gz`, cannot be read: No such file"):
        image_again(path)
