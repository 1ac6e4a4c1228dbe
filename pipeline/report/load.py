"""Load a dataset that may be damaged: ``python -m pipeline.report.load FILE`` tries it, in a process of its own.

The program prints what is wrong with the file; its exit status is then 3, or that of a process that HDF5 has ended.
"""

import subprocess
import sys
from math import prod
from pathlib import Path

import xarray as xr

from pipeline.launcher import run_alone
from pipeline.netcdf import is_as_written
from pipeline.report.table import DatasetError
from pipeline.visible import visible

# Twice what the most cases that a study may have take.
_LARGEST = 1_000_000_000  # bytes
_POINTER = 8  # to a text
_LONGEST = 300  # s
_REFUSED = 3
# Memory that is freed has every byte set, with glibc: what is used all the same is then used by no luck.
_NO_LUCK = {"MALLOC_PERTURB_": "165"}


def load(path: Path) -> xr.Dataset:
    """Return the dataset at ``path``, in memory.

    Raises:
        DatasetError: if it is damaged, no netCDF, or beyond what any study has.
    """
    try:
        known = is_as_written(path)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read: {error.strerror or error}") from None
    if known is None:
        _try(path)
    elif not known:
        raise DatasetError(
            f"{path}: is damaged: these are not the bytes that were written; "
            "`epsmesh run` writes it again, of records that the case store has"
        )
    return _loaded(path)


def _try(path: Path) -> None:
    try:
        done = run_alone(__name__, str(path), timeout=_LONGEST, variables=_NO_LUCK)
    except subprocess.TimeoutExpired:
        raise DatasetError(f"{path}: cannot be read as netCDF within {_LONGEST} s: it is damaged") from None
    if done.returncode == _REFUSED:
        raise DatasetError(done.stdout.strip())
    if done.returncode:
        raise DatasetError(f"{path}: cannot be read as netCDF: it is damaged")


def _loaded(path: Path) -> xr.Dataset:
    try:
        # A few bytes of a packed file may stand for any number of values.
        if (size := _size(path)) > _LARGEST:
            raise DatasetError(f"{path}: would take {size / 1e9:.3g} GB: no study's dataset has more than 1")
        return xr.load_dataset(path)
    except DatasetError:
        raise
    except Exception as error:  # of a damaged file the libraries raise many kinds
        why = next(iter(str(error).splitlines()), type(error).__name__)
        raise DatasetError(f"{path}: cannot be read as netCDF: {visible(why)}") from None


def _size(path: Path) -> int:
    """Return how many bytes the variables of a file take in memory, without reading them."""
    from netCDF4 import Dataset  # noqa: PLC0415 (xarray loads it, too)

    with Dataset(path) as file:
        kinds = [(variable.shape, variable.dtype) for variable in file.variables.values()]
        return sum(prod(map(int, shape)) * getattr(kind, "itemsize", _POINTER) for shape, kind in kinds)


if __name__ == "__main__":
    try:
        _loaded(Path(sys.argv[1]))
    except DatasetError as refused:
        print(refused)
        sys.exit(_REFUSED)
