"""Load a dataset that may be damaged, or no dataset at all."""

from math import prod
from pathlib import Path

import xarray as xr

from pipeline.printable import printable
from pipeline.report.table import DatasetError

# Twice what the most cases that a study may have take.
_LARGEST = 1_000_000_000  # bytes
_POINTER = 8  # to a text


def load(path: Path) -> xr.Dataset:
    """Return the dataset at ``path``, in memory; every array is compared with its checksum.

    Raises:
        DatasetError: if it is damaged, no netCDF, or beyond what any study has.
    """
    try:
        # A few bytes of a packed file may stand for any number of values.
        if (size := _size(path)) > _LARGEST:
            raise DatasetError(f"{path}: would take {size / 1e9:.3g} GB: no study's dataset has more than 1")
        return xr.load_dataset(path)
    except DatasetError:
        raise
    except Exception as error:  # of a damaged file the libraries raise many kinds
        why = next(iter(str(error).splitlines()), type(error).__name__)
        raise DatasetError(
            f"{path}: cannot be read as netCDF: {printable(why)}: it is damaged, or no dataset; "
            "`epsmesh run` writes that of a study again, of what the case store holds"
        ) from None


def _size(path: Path) -> int:
    """Return how many bytes the variables of a file take in memory, without reading them."""
    from netCDF4 import Dataset  # noqa: PLC0415 (xarray loads it, too)

    with Dataset(path) as file:
        kinds = [(variable.shape, variable.dtype) for variable in file.variables.values()]
        return sum(prod(map(int, shape)) * getattr(kind, "itemsize", _POINTER) for shape, kind in kinds)
