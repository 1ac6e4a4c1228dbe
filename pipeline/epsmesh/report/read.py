"""Read a dataset that a run has written, which may be damaged: by its own name, or by its study's."""

import warnings
from collections.abc import Callable
from contextlib import suppress
from math import prod
from pathlib import Path
from shlex import quote

import numpy as np
import xarray as xr

from epsmesh.extensions import kind, kind_of
from epsmesh.printable import printable, printable_lines
from epsmesh.report.study import DatasetError, warnings_of
from epsmesh.report.values import with_words
from epsmesh.study.identified import FROM
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_study
from epsmesh.study.text import read_toml

# What every dataset of a study has, and figures and report are made from.
_NEEDED = (
    "force",
    "force_error",
    "force_ratio",
    "force_exact",
    "force_exact_error",
    "force_exact_message",
    "force_exact_ratio",
    "status",
    "message",
    "origin",
    "time_total",
    "reductions",
    "study",
)
# These distinguish it from other kinds.
_OF_CASES = ("force", "force_ratio", "force_exact")
# Twice what the most cases that a study may have take.
_LARGEST = 1_000_000_000  # bytes
_POINTER = 8  # to a text


def dataset_path(file: str | Path, output: str | Path = "results") -> Path:
    """Return the dataset meant by ``file``: itself, or ``<study>.nc`` in ``output`` for a study file.

    Raises:
        DatasetError: if there is none.
    """
    file = Path(file)
    if file.suffix not in (".nc", ".toml"):
        raise DatasetError(f"{file}: must be a dataset (.nc) or a study file (.toml)")
    path = file if file.suffix == ".nc" else Path(output) / f"{file.stem}.nc"
    if not path.is_file():
        if file.suffix == ".toml" and not file.is_file():
            raise DatasetError(f"{file}: no such study, and {path}: no such dataset")
        study = file.with_suffix(".toml").name if file.suffix == ".nc" else file
        raise DatasetError(f"{path}: no such dataset; make it with `epsmesh run {quote(str(study))}`")
    return path


def other_kind(dataset: xr.Dataset) -> str:
    """Return the kind of a dataset that is not of a study's cases: its name, "" if it is none that is known."""
    return "" if {*_OF_CASES} <= {*dataset.data_vars} else kind_of(dataset)


def check_kind(path: Path, own: str = "") -> None:
    """Check that a dataset may be written to ``path``: in place of none, of a damaged one, or of one of its own kind.

    Its ``own`` kind is "" for that of a study's cases.

    Raises:
        FileExistsError: if it would replace a dataset of another kind.
    """
    if not path.is_file():
        return
    try:
        with xr.open_dataset(path) as dataset:
            known = other_kind(dataset)
    except (OSError, ValueError, RuntimeError):  # damaged
        return
    if known != own:
        what = kind(known).content if known else "dataset of a study's cases"
        raise FileExistsError(f"{path}: is the {what}, and is not replaced by the other: give another output folder")


def read(file: str | Path, output: str | Path = "results", warn: Callable[[str], None] = warnings.warn) -> xr.Dataset:
    """Return the dataset meant by ``file``, in memory: a later run may write it anew.

    ``warn`` is called with each warning of the dataset's study, and if ``file`` is a study that has changed since.

    Raises:
        DatasetError: if there is none, or if it is not a study's.
    """
    dataset = read_any(file, output, warn)
    if other := other_kind(dataset):
        raise DatasetError(f"{file}: is {kind(other).title}, not a study's dataset: `epsmesh report` shows it")
    return dataset


def read_any(
    file: str | Path, output: str | Path = "results", warn: Callable[[str], None] = warnings.warn
) -> xr.Dataset:
    """Return the dataset of a study, see :func:`read`, or one of another kind.

    Raises:
        DatasetError: if there is none, or if it is of no kind.
    """
    path = dataset_path(file, output)
    dataset = _shown(read_file(path))
    if other_kind(dataset):
        return dataset
    if missing := [name for name in _NEEDED if name not in {*dataset.data_vars, *dataset.attrs}]:
        raise DatasetError(f"{path}: not a study's dataset: it has no {', '.join(missing)}")
    for warning in warnings_of(dataset):
        warn(warning)
    study = Path(file)
    if study != path and study.is_file() and _text_of(study) != dataset.attrs["study"]:
        warn(f"{study} has changed since {path} was made, which answers for the study as it was: run it again")
    return dataset


def read_file(path: Path) -> xr.Dataset:
    """Return the dataset at ``path``, its group ``run`` with it, in memory; every array is compared with its checksum.

    ``status`` is in words.

    Raises:
        DatasetError: if it is damaged, no netCDF, or beyond what any study has.
    """
    try:
        # A few bytes of a packed file may stand for any number of values.
        size, groups = _described(path)
        if size > _LARGEST:
            raise DatasetError(f"{path}: would take {size / 1e9:.3g} GB: no study's dataset has more than 1")
        # One that xarray has written again has no groups.
        parts = [xr.load_dataset(path, group=group) for group in (None, *({"run"} & groups))]
        return with_words(xr.merge(parts, join="outer", compat="no_conflicts", combine_attrs="override"))
    except DatasetError:
        raise
    except Exception as error:  # of a damaged file the libraries raise many kinds
        why = next(iter(str(error).splitlines()), type(error).__name__)
        raise DatasetError(
            f"{path}: cannot be read as netCDF: {printable(why)}: it is damaged, or no dataset; "
            "`epsmesh run` writes that of a study again, of what the case store holds"
        ) from None


def _described(path: Path) -> tuple[int, set[str]]:
    """Return how many bytes the variables of a file take in memory, without reading them, and its groups."""
    from netCDF4 import Dataset  # noqa: PLC0415 (xarray loads it, too)

    with Dataset(path) as file:
        parts = [file, *file.groups.values()]
        kinds = [(variable.shape, variable.dtype) for part in parts for variable in part.variables.values()]
        size = sum(prod(map(int, shape)) * getattr(kind, "itemsize", _POINTER) for shape, kind in kinds)
        return size, set(file.groups)


def _text_of(study: Path) -> str:
    """Return the text of a study, with what it reads from an identification, if that is there."""
    with suppress(StudyError):
        text = read_toml(study)[0]
        return read_study(study).text if FROM.search(text) else text
    return ""


def _shown(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose texts, but for the study's own, move no cursor of the terminal that shows them."""
    for held in (dataset, *dataset.variables.values()):
        texts = {name: text for name, text in held.attrs.items() if isinstance(text, str) and name != "study"}
        held.attrs.update({name: printable_lines(text) for name, text in texts.items()})
    of_text = {name: v for name, v in dataset.variables.items() if v.dtype.kind in "OU"}
    changed = {
        name: (
            v.dims,
            np.array([printable_lines(str(text)) for text in v.values.ravel()], dtype=object).reshape(v.shape),
        )
        for name, v in of_text.items()
        if not all(str(text).isprintable() for text in v.values.ravel())
    }
    return dataset.assign({name: (*values, dataset[name].attrs) for name, values in changed.items()})
