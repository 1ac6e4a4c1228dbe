"""What was checked once is not checked again, and is the same."""

import numpy as np
import pytest

from pipeline.shapes.files import checked, read
from pipeline.shapes.files.read import load_surface
from pipeline.shapes.triangles import SurfaceError
from tests.organs import ellipsoid, write_stl


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("EPSMESH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(checked, "_SMALL", 1000)
    read._load.cache_clear()
    return tmp_path


def again(path, unit=1e-3, **given):
    read._load.cache_clear()
    return load_surface(path, unit, **given)


def refuse(*_):
    raise AssertionError("was checked again")


def test_a_surface_is_checked_once(folder, monkeypatch):
    path = write_stl(folder / "body.stl", *ellipsoid(8))
    first = load_surface(path, 1e-3)
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
    first = load_surface(path, 1e-3)
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
