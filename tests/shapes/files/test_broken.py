from pathlib import Path

import numpy as np
import pytest

from pipeline.shapes.files.read import load_surface
from pipeline.shapes.triangles import SurfaceError
from tests.shapes.files.broken import Broken, corpus
from tests.shapes.files.solids import ball, obj, ply, stl, stl_text

FILES = corpus()


@pytest.mark.parametrize("broken", FILES, ids=lambda broken: broken.name)
def test_each_broken_file_is_refused_with_what_was_found(broken: Broken, tmp_path: Path):
    path = tmp_path / broken.name
    path.write_bytes(broken.data)
    with pytest.raises(SurfaceError) as refused:
        load_surface(path, broken.unit)
    for word in broken.words:
        assert word in str(refused.value)


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path: Path):
    with pytest.raises(SurfaceError, match="No such file"):
        load_surface(tmp_path / "liver.stl", 1e-3)
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(SurfaceError, match="directory"):
        load_surface(tmp_path / "folder.stl", 1e-3)


def test_a_file_with_any_bytes_wrong_is_read_or_refused_and_nothing_else(tmp_path: Path):
    random = np.random.Generator(np.random.PCG64(7))
    small = ball(1)
    files = {
        "b.stl": stl(small),
        "t.stl": stl_text(small),
        "b.ply": ply(small),
        "t.ply": ply(small, "ascii"),
        "t.obj": obj(small),
    }
    for number in range(300):
        ending = list(files)[number % len(files)]
        data = bytearray(files[ending])
        for _ in range(random.integers(1, 4)):
            start = int(random.integers(0, len(data) if number % 2 else min(len(data), 300)))
            stop = start + int(random.integers(0, 50))
            data[start:stop] = random.bytes(int(random.integers(0, 8)))
        path = tmp_path / f"{number}-{ending}"
        path.write_bytes(bytes(data))
        try:
            triangles = load_surface(path, 1e-3, repair=bool(number % 3)).triangles
        except SurfaceError as error:
            assert str(error)
        else:
            assert triangles.volume > 0
