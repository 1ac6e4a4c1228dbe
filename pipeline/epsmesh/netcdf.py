"""netCDF files: written whole or not at all, with a checksum behind every array of numbers or letters."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from epsmesh.files import atomic

if TYPE_CHECKING:
    import xarray as xr

# Bytes at most: of a file's own, and of the description of a variable or an attribute.
_FILE, _DESCRIPTION = 50_000, 2_000


def write_netcdf(dataset: "xr.Dataset", path: Path, groups: "Mapping[str, xr.Dataset] | None" = None) -> None:
    """Write ``dataset`` to ``path`` as netCDF4 in one piece or not at all; arrays have a Fletcher-32 checksum.

    ``groups`` are written to groups of those names.

    Texts become arrays of characters, which checksums cover, too: HDF5 keeps texts of varying length elsewhere. Single
    numbers (arrays without a dimension) and attributes have no checksum: HDF5 filters work on arrays stored in chunks.
    HDF5 ends the process if the disk fills while it writes: each part is written where room was taken for it. It gives
    back what it does not need.

    Raises:
        OSError: if it cannot be written.
    """
    import netCDF4  # noqa: PLC0415 (slow to load)

    with atomic(path) as temporary:
        temporary.write_bytes(bytes(_FILE))
        netCDF4.Dataset(temporary, "w").close()
        for group, part in ((None, dataset), *(groups or {}).items()):
            with temporary.open("rb+") as file:  # a new file, opened to write, would lose it
                os.posix_fallocate(file.fileno(), 0, temporary.stat().st_size + most_bytes(part))
            guarded = {name: _guarded(part[name]) for name in part.variables}
            part.to_netcdf(temporary, mode="a", group=group, engine="netcdf4", encoding=guarded)


def _guarded(array: "xr.DataArray") -> dict[str, Any]:
    # A coordinate has no missing values: one that says what they would be breaks the CF conventions.
    text = {"dtype": "S1"} if array.dtype.kind in "OU" else {"_FillValue": None} if array.name in array.dims else {}
    return text | {"fletcher32": True} if array.size and (array.ndim or text) else text


def most_bytes(dataset: "xr.Dataset") -> int:
    """Return the bytes that a file of ``dataset`` takes at most."""
    held = [dataset.attrs, *(variable.attrs for variable in dataset.variables.values())]
    values = [*dataset.variables.values(), *(value for attributes in held for value in attributes.values())]
    return _FILE + sum(_DESCRIPTION + _bytes_of(np.asarray(value)) for value in values)


def _bytes_of(values: Any) -> int:
    """Return the bytes of an array; each text takes as many as the longest, of up to four bytes a letter."""
    return int(values.astype(str).nbytes if values.dtype.kind in "OU" else values.nbytes)
