from pathlib import Path

import pytest

from epsmesh.shapes.files.read import read_surface
from epsmesh.shapes.triangles import SurfaceError
from tests.shapes.files.broken import Broken, corpus

FILES = corpus()


@pytest.mark.parametrize("broken", FILES, ids=lambda broken: broken.name)
def test_each_broken_file_is_refused_with_what_was_found(broken: Broken, tmp_path: Path):
    path = tmp_path / broken.name
    path.write_bytes(broken.data)
    with pytest.raises(SurfaceError) as refused:
        read_surface(path, broken.unit)
    for word in broken.words:
        assert word in str(refused.value)


def test_a_file_that_is_not_there_and_a_folder_are_refused(tmp_path: Path):
    with pytest.raises(SurfaceError, match="No such file"):
        read_surface(tmp_path / "liver.stl", 1e-3)
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(SurfaceError, match="directory"):
        read_surface(tmp_path / "folder.stl", 1e-3)
