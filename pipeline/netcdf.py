"""netCDF files, put together in memory and then written as any other file: HDF5 does not survive a full disk."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pipeline.files import atomic

if TYPE_CHECKING:
    import xarray as xr

# Bytes: it grows. What is more than a classic file needs would stand behind its end.
_FIRST_BUFFER = 1


def write_netcdf(
    dataset: "xr.Dataset",
    path: Path,
    kind: Literal["NETCDF4", "NETCDF3_64BIT"],
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write ``dataset`` to ``path`` in one piece or not at all.

    A file whose disk fills while HDF5 writes it cannot be closed, and what cannot be closed ends the process by a
    fault of memory once Python frees it.

    Raises:
        OSError: if it cannot be written.
    """
    import netCDF4  # noqa: PLC0415 (slow to load, and wanted last)
    from xarray.backends import NetCDF4DataStore  # noqa: PLC0415

    file = netCDF4.Dataset(path.name, mode="w", format=kind, memory=_FIRST_BUFFER)
    dataset.dump_to_store(NetCDF4DataStore(file), encoding=encoding)
    content = file.close()
    with atomic(path) as temporary:
        temporary.write_bytes(content)
