"""Read a dataset that a run has written: by its own name, or by its study's."""

from pathlib import Path

import xarray as xr

from pipeline.report.table import DatasetError

# What every dataset of a study has, and figures and report are made from.
_NEEDED = (
    "force", "force_error", "force_ratio", "force_exact", "force_exact_error", "force_exact_message", "accuracy",
    "status", "message", "origin", "time_total", "reductions", "study",
)  # fmt: skip


def dataset_path(file: str | Path, output: str | Path = "results") -> Path:
    """Return the dataset meant by ``file``: itself, or ``<study>.nc`` in ``output`` for a study file.

    Raises:
        DatasetError: if there is none.
    """
    file = Path(file)
    path = file if file.suffix == ".nc" else Path(output) / f"{file.stem}.nc"
    if not path.is_file():
        study = file.with_suffix(".toml").name if file.suffix == ".nc" else file
        raise DatasetError(f"{path}: no such dataset; make it with `epsmesh run {study}`")
    return path


def read(file: str | Path, output: str | Path = "results") -> xr.Dataset:
    """Return the dataset meant by ``file``, in memory: a later run may write it anew.

    Raises:
        DatasetError: if there is none, or if it is not a study's.
    """
    path = dataset_path(file, output)
    try:
        dataset = xr.load_dataset(path)
    except Exception as error:  # of a damaged file the libraries raise many kinds
        why = next(iter(str(error).splitlines()), type(error).__name__)
        raise DatasetError(f"{path}: cannot be read as netCDF: {why}") from None
    if missing := [name for name in _NEEDED if name not in {*dataset.data_vars, *dataset.attrs}]:
        raise DatasetError(f"{path}: not a study's dataset: it has no {', '.join(missing)}")
    return dataset
