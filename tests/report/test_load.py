"""A dataset is read whole, or said to be damaged: whatever byte of it has changed, whoever wrote it."""

import subprocess
from threading import Thread

import netCDF4
import numpy as np
import pytest
import xarray as xr

from pipeline.netcdf import is_as_written
from pipeline.report import load as loading
from pipeline.report.dataset import write
from pipeline.report.load import load
from pipeline.report.table import DatasetError
from tests.report.synthetic import FIGURE, dataset


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "known.nc"
    write(dataset(**FIGURE), path)
    return path


def cut_off(path):
    """Take away what only this program writes behind a file's end."""
    data = path.read_bytes()
    path.write_bytes(data[: data.rindex(b"epsmesh:sha256:")])


def test_any_bit_that_has_flipped_is_told(file):
    data = file.read_bytes()
    length, random = data.rindex(b"epsmesh:sha256:"), np.random.default_rng(7)
    for at in random.integers(0, length, 200):
        changed = bytearray(data)
        changed[at] ^= 1 << int(random.integers(8))
        file.write_bytes(changed)
        with pytest.raises(DatasetError, match=r"known.nc: is damaged: .*`epsmesh run` writes it again"):
            load(file)


def test_what_another_program_has_changed_is_read(file):
    with netCDF4.Dataset(file, "a") as changed:
        changed.note = "looked at"
    assert b"sha256" not in file.read_bytes()
    found = load(file)
    assert found.attrs["note"] == "looked at"
    xr.testing.assert_equal(found["force"], dataset(**FIGURE)["force"])


def test_what_another_program_wrote_is_tried_in_a_process_of_its_own(file, monkeypatch):
    cut_off(file)
    tried = []

    def run_alone(program, *arguments, **_options):
        tried.append((program, *arguments))
        return subprocess.CompletedProcess(tried[-1], -6, "", "double free")

    monkeypatch.setattr(loading, "run_alone", run_alone)
    with pytest.raises(DatasetError, match=r"known.nc: cannot be read as netCDF: it is damaged$"):
        load(file)
    assert tried == [("pipeline.report.load", str(file))]


def test_a_file_that_a_run_replaces_meanwhile_is_never_taken_for_a_damaged_one(file, tmp_path):
    write(dataset(), tmp_path / "other.nc")
    contents, written = [file.read_bytes(), (tmp_path / "other.nc").read_bytes()], tmp_path / "written"

    def replace():
        for number in range(1000):
            written.write_bytes(contents[number % 2])
            written.replace(file)

    writer, found = Thread(target=replace), set()
    writer.start()
    while writer.is_alive():
        found.add(is_as_written(file))
    writer.join()
    assert found == {True}


def test_what_is_wrong_is_said_as_it_was_found_there(file):
    cut_off(file)
    file.write_bytes(file.read_bytes()[:9000])
    with pytest.raises(DatasetError, match=r"known.nc: cannot be read as netCDF: .*HDF error"):
        load(file)
