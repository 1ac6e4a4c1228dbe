"""The files of an insertion: its dataset and its figure."""

from pathlib import Path

import xarray as xr

from pipeline.insertion import ENDING
from pipeline.netcdf import write_netcdf
from pipeline.report.figures.insertion import draw


def publish(dataset: xr.Dataset, output: Path, name: str) -> list[Path]:
    """Write dataset and figure of the insertion of the study called ``name`` into ``output``, and return the files.

    Raises:
        OSError: if a file cannot be written.
    """
    stem = output / (name + ENDING)
    path = stem.with_name(f"{stem.name}.nc")
    write_netcdf(dataset, path, "NETCDF4")
    return [path, *draw(dataset, stem)]
