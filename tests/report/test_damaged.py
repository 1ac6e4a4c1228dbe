"""A dataset is read whole, or said to be damaged."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

from epsmesh.report.dataset import write
from epsmesh.report.read import read_file
from epsmesh.report.study import DatasetError
from tests.report.synthetic import FIGURE, dataset


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "known.nc"
    write(dataset(**FIGURE), path)
    return path


@pytest.mark.parametrize("name", ["force_vector", "status", "epsilon"])
def test_a_bit_that_has_flipped_in_an_array_is_told(file, name):
    """Numbers, counts, texts, coordinates: each array has a checksum behind it."""
    with netCDF4.Dataset(file) as opened:
        opened.set_auto_maskandscale(False)
        opened.set_auto_chartostring(False)
        values = np.ascontiguousarray(opened[name][:]).tobytes()
    data = file.read_bytes()
    start, random = data.index(values), np.random.default_rng(7)
    for at in random.integers(start, start + len(values), 8):
        changed = bytearray(data)
        changed[at] ^= 1 << int(random.integers(8))
        file.write_bytes(changed)
        with pytest.raises(DatasetError, match=r"known.nc: cannot be read as netCDF: .*damaged.*`epsmesh run` writes"):
            read_file(file)


def test_what_another_program_has_changed_is_read(file):
    with netCDF4.Dataset(file, "a") as changed:
        changed.note = "looked at"
    found = read_file(file)
    assert found.attrs["note"] == "looked at"
    xr.testing.assert_equal(found["force"], dataset(**FIGURE)["force"])


def test_a_file_that_ends_early_is_refused(file):
    file.write_bytes(file.read_bytes()[:9000])
    with pytest.raises(DatasetError, match=r"known.nc: cannot be read as netCDF: .*damaged"):
        read_file(file)
