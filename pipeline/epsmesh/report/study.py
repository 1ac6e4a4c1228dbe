"""The study whose text a dataset carries, and its cases by their labels."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.study.case import Case
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_text
from epsmesh.study.sweep import Study
from epsmesh.study.text import toml_of

Labels = dict[str, Any]


class DatasetError(Exception):
    """A dataset that cannot answer what is asked of it."""


def study_of(dataset: xr.Dataset) -> Study | None:
    """Return the study whose text the dataset carries, or None if this version does not read it.

    The text may be a stranger's: it is held to all that a file is held to. Files of bodies are looked for in the
    study's folder, then, for a study that was moved, in the current one.
    """
    name = str(dataset.attrs.get("study_file", "")) or "study.toml"
    folder = str(dataset.attrs.get("study_folder", "."))
    text = str(dataset.attrs.get("study", ""))
    study = _read(text, f"{folder}/{name}") or _read(text, name)
    if study is None or not study.gives_force or "depth_error" not in dataset:
        return study
    found = dict(zip(study.indices(), dataset["depth"].values.ravel().tolist(), strict=True))
    return replace(study, depths={index: depth for index, depth in found.items() if isfinite(depth)}, seeks=False)


def warnings_of(dataset: xr.Dataset) -> list[str]:
    """Return the warnings of the dataset's study: what its forces leave out, which no error bar tells."""
    return str(dataset.attrs.get("warnings", "")).splitlines()


def _read(text: str, file: str) -> Study | None:
    try:
        return _study(text, file, tuple(_states(toml_of(text, file), Path(file).parent)))
    except StudyError:
        return None


@lru_cache(8)  # figures, report and guide of a dataset ask for it again and again
def _study(text: str, file: str, _files: tuple[tuple[str, int, int], ...]) -> Study:
    return read_text(text, file)


def _states(part: Any, folder: Path) -> Iterator[tuple[str, int, int]]:
    """Yield each file that a part of a study names, with the time of its last change (ns) and its size."""
    if isinstance(part, str):
        with suppress(OSError, ValueError):  # no file, or no name of one
            state = (folder / part).stat()
            yield part, state.st_ctime_ns, state.st_size
        return
    for one in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
        yield from _states(one, folder)


def case_at(dataset: xr.Dataset, study: Study | None, labels: Labels, free: str = "") -> Case | None:
    """Return the case of ``study`` that has the ``labels``, the first of those that differ in the section ``free``.

    None if there is none, or if the labels do not tell.
    """
    if study is None:
        return None
    # Of a dataset that somebody has selected from, a label may be left as a coordinate without dimension.
    known = {name: plain(dataset[name].values[()]) for name in dataset.coords if dataset[name].ndim == 0}
    known |= {name: plain(value) for name, value in labels.items()}
    index = []
    for axis in study.axes:
        if axis.is_stage:
            index.append(len(axis) - 1)
            continue
        if axis.section != free and known.get(axis.name) not in axis.labels:
            return None
        index.append(0 if axis.section == free else axis.labels.index(known[axis.name]))
    return study.case(tuple(index))


def plain(value: Any) -> Any:
    """Return a label as Python's own number."""
    return value.item() if isinstance(value, np.generic) else value
