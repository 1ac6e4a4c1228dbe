"""netCDF files, for which there is room before they are begun, and of which one can tell whether they are damaged.

HDF5 survives neither a full disk nor, one time in ten, a damaged file: it frees what it has not read.
"""

from collections.abc import Mapping
from hashlib import sha256
from os import SEEK_END
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np

from pipeline.files import atomic

if TYPE_CHECKING:
    import xarray as xr

# Bytes at most: of a file's own, of a variable's or an attribute's description, and of what points to a text.
_FILE, _DESCRIPTION, _POINTER = 50_000, 2_000, 64
# What a file ends with, behind all that is HDF5's: this word, and the SHA-256 of what is before it. Libraries do not
# look there, and one that changes the file cuts it off.
_SEAL, _SUM = b"epsmesh:sha256:", 32
_PIECE = 1 << 20  # bytes


def write_netcdf(
    dataset: "xr.Dataset",
    path: Path,
    kind: Literal["NETCDF4", "NETCDF3_64BIT"],
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write ``dataset`` to ``path`` in one piece or not at all.

    A file whose disk fills while HDF5 writes it cannot be closed, and what cannot be closed ends the process by a
    fault of memory once Python frees it. So as many bytes as it may take are written in its place first. A file that
    is put together in HDF5's memory would have attributes of 64 kB at most, and its variables sorted by name.

    Raises:
        OSError: if it cannot be written.
    """
    with atomic(path) as temporary:
        temporary.write_bytes(bytes(most_bytes(dataset)))
        dataset.to_netcdf(temporary, format=kind, engine="netcdf4", encoding=encoding)
        if kind == "NETCDF4":
            with temporary.open("rb+") as file:
                file.write(_seal(file, file.seek(0, SEEK_END)))


def is_as_written(path: Path) -> bool | None:
    """Tell whether a file has the bytes it was written with; None if others wrote it, changed it, or cut it off.

    Raises:
        OSError: if it cannot be read.
    """
    with path.open("rb") as file:  # once: a run may put a new one in its place meanwhile
        length = file.seek(0, SEEK_END) - len(_SEAL) - _SUM
        if length < 0:
            return None
        file.seek(length)
        found = file.read()
        return found == _seal(file, length) if found.startswith(_SEAL) else None


def _seal(file: BinaryIO, length: int) -> bytes:
    """Return what belongs behind the first ``length`` bytes of a file, which is then read up to there."""
    file.seek(0)
    found = sha256()
    for start in range(0, length, _PIECE):
        found.update(file.read(min(_PIECE, length - start)))
    return _SEAL + found.digest()


def most_bytes(dataset: "xr.Dataset") -> int:
    """Return the bytes that a file of ``dataset`` takes at most."""
    held = [dataset.attrs, *(variable.attrs for variable in dataset.variables.values())]
    values = [*dataset.variables.values(), *(value for attributes in held for value in attributes.values())]
    return _FILE + sum(_DESCRIPTION + _bytes_of(np.asarray(value)) for value in values)


def _bytes_of(values: Any) -> int:
    """Return the bytes of an array's numbers, or of its texts, of up to four bytes a letter."""
    if values.dtype.kind not in "OU":
        return int(values.nbytes)
    return sum(_POINTER + 4 * len(str(text)) for text in values.flat)
