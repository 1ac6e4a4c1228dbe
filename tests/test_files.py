"""Files appear whole or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from epsmesh.files import atomic, why_not_writable, write_new, write_whole
from epsmesh.netcdf import most_bytes, write_netcdf


@pytest.mark.parametrize("name", ["a.nc", "a.b.svg", "plain"])
def test_a_file_is_whole_or_as_it_was(tmp_path, name):
    path = tmp_path / "deep" / name
    for text in ("first", "second"):
        with atomic(path) as temporary:
            temporary.write_text(text)
            assert temporary.suffix == path.suffix
            assert temporary.parent == path.parent
            assert path.exists() == (text == "second")
        assert path.read_text() == text
    with pytest.raises(ValueError, match="torn"), atomic(path) as temporary:
        temporary.write_text("half")
        raise ValueError("torn")
    assert path.read_text() == "second"
    assert [file.name for file in path.parent.iterdir()] == [name]


def test_two_who_write_at_once_write_two_files(tmp_path):
    """On two machines, too, where both may be the process of one number."""
    with atomic(tmp_path / "a") as mine, atomic(tmp_path / "a") as yours:
        mine.write_text("mine")
        yours.write_text("yours")
    assert (tmp_path / "a").read_text() == "mine"
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_it_is_on_disk_before_it_takes_the_place_of_another(tmp_path, monkeypatch):
    done = []
    for name in ("fsync", "replace"):
        call = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *args, name=name, call=call: (done.append(name), call(*args))[1])
    with atomic(tmp_path / "a") as temporary:
        temporary.write_text("text")
    assert done == ["fsync", "replace"]


def test_what_was_not_written_replaces_nothing(tmp_path):
    (tmp_path / "a").write_text("kept")
    with pytest.raises(FileNotFoundError), atomic(tmp_path / "a"):
        pass
    assert (tmp_path / "a").read_text() == "kept"


def test_a_new_file_leaves_an_existing_one_alone(tmp_path):
    write_new(tmp_path / "deep" / "a.toml", "first")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "deep" / "a.toml", "second")
    assert {file.name: file.read_text() for file in (tmp_path / "deep").iterdir()} == {"a.toml": "first"}


def test_what_is_wrong_is_wrong_with_the_file_that_was_asked_for(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(IsADirectoryError) as folder:
        write_whole(tmp_path / "a", "text")
    assert folder.value.filename == str(tmp_path / "a")
    with pytest.raises(OSError, match="No space left") as full, atomic(tmp_path / "b"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert full.value.filename == str(tmp_path / "b")
    with pytest.raises(FileNotFoundError) as other, atomic(tmp_path / "b"):
        (tmp_path / "none").read_text()
    assert other.value.filename == str(tmp_path / "none")


def test_a_place_is_tried_and_left_as_it_was(tmp_path):
    assert not why_not_writable(tmp_path / "deep" / "a")
    assert why_not_writable(Path("/dev/full/a")).startswith("/dev/full/a: cannot be written: /dev/full is a file")
    assert not list(tmp_path.rglob("*a*"))


WORDS = np.array(["ü" * (number % 9) for number in range(2_000)], dtype=object)
DATASETS = {
    "empty": xr.Dataset(),
    "numbers": xr.Dataset({"b": (("x", "y"), np.eye(300, 40)), "a": ("x", np.ones(300, bool))}),
    "words": xr.Dataset({"a": ("x", WORDS)}),
    "a long study": xr.Dataset({"a": ("x", np.arange(5.0))}, attrs={"study": "ü" * 200_000}),
    "many": xr.Dataset({f"v{i}": (f"x{i}", np.zeros(2), {"units": "m"}) for i in range(100)}),
}


@pytest.mark.parametrize("name", DATASETS)
def test_a_dataset_is_written_as_it_is_and_takes_no_more_room_than_was_seen_to(tmp_path, monkeypatch, name):
    """Its variables in their order; the text of its study, however long."""
    dataset, path, room, encode = DATASETS[name], tmp_path / "a.nc", [], xr.conventions.encode_dataset_coordinates

    def begun(some):
        (file,) = tmp_path.iterdir()
        room.append(512 * file.stat().st_blocks)
        return encode(some)

    monkeypatch.setattr(xr.conventions, "encode_dataset_coordinates", begun)
    write_netcdf(dataset, path, {"run": DATASETS["numbers"]})
    assert room[0] >= most_bytes(dataset)
    assert room[1] >= most_bytes(DATASETS["numbers"])
    with xr.open_dataset(path, group="run", decode_times=False) as read:
        assert read.identical(DATASETS["numbers"])
    monkeypatch.undo()
    write_netcdf(dataset, path)
    assert path.stat().st_size <= most_bytes(dataset)
    with xr.open_dataset(path, decode_times=False) as read:
        assert read.identical(dataset)
        assert list(read.variables) == list(dataset.variables)
    assert len(list(tmp_path.iterdir())) == 1


# A limit of the size of files stands for a full disk: HDF5 finds it when it writes, and again when it closes the file.
ON_A_FULL_DISK = """
import resource, sys
from pathlib import Path
import numpy as np
import xarray as xr
from epsmesh.netcdf import write_netcdf
resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
dataset = xr.Dataset({"a": (("x",), np.random.default_rng(1).random(100_000))})
try:
    write_netcdf(dataset, Path(sys.argv[1]))
except OSError as error:
    print(error)
"""


def test_a_dataset_on_a_full_disk_is_an_error_and_no_crash(tmp_path):
    path = tmp_path / "a.nc"
    path.write_text("kept")
    done = subprocess.run([sys.executable, "-c", ON_A_FULL_DISK, path], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, f"[Errno 27] File too large: '{path}'")
    assert path.read_text() == "kept"
    assert len(list(tmp_path.iterdir())) == 1
