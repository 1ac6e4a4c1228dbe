"""A dataset as a table: a row for each mesh setting, a column for each scene, and why a cell cannot be judged."""

import itertools
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import isfinite, isinf
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from epsmesh.quantities import MESH_DIMENSIONS
from epsmesh.report.sinking import LOADS, PLACES, Sinking
from epsmesh.report.values import by_case, elastic, relative
from epsmesh.states import OK, PENDING, STATES
from epsmesh.study.case import Case
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_text
from epsmesh.study.sweep import Study
from epsmesh.study.text import toml_of

Labels = dict[str, Any]
# What F is compared with, by its name: the variable of the dataset.
EXACT, MAX = "F_exact", "F_max"
_VARIABLES = {EXACT: "force_exact", MAX: "force_max"}


class DatasetError(Exception):
    """A dataset that cannot answer what is asked of it."""


@dataclass(frozen=True)
class Table:
    """Mesh settings (rows) against scenes (columns); all arrays have that shape, NaN where ``why`` is not empty.

    ``reference`` names the force that F is compared with, ``exact``: "F_exact", or "F_max" of a dataset without it.
    ``ratio`` is F over it and ``bar`` what the error bars of both add to its distance from 1, ``force_bar`` and
    ``exact_bar`` are those relative bars, 0 beside F_max, which has the same elements; ``share`` is F/F_max;
    ``seconds`` what a case costs alone, ``dofs`` and ``cells`` those of the whole body.
    """

    reference: str
    settings: tuple[Labels, ...]
    scenes: tuple[Labels, ...]
    axes: dict[str, np.ndarray]  # scene axis: the position of each scene's label
    force: np.ndarray
    exact: np.ndarray
    ratio: np.ndarray
    bar: np.ndarray
    force_bar: np.ndarray
    exact_bar: np.ndarray
    share: np.ndarray
    seconds: np.ndarray
    dofs: np.ndarray
    cells: np.ndarray
    why: np.ndarray
    meshes: tuple[Labels, ...]  # element sizes of each setting: what is swept and what is not
    cases: tuple[Case | None, ...]  # of each scene, with some mesh; None if the study does not tell
    sinking: pd.DataFrame  # of each scene's tool, a column for each field of Sinking
    tools: tuple[str, ...]  # the axes that make a tool what it is, and
    loads: tuple[str, ...]  # those that only say how far it moves

    @cached_property
    def is_judged(self) -> np.ndarray:
        """Where there is a force, its error bar and F_exact (settings × scenes)."""
        return np.asarray(self.why == "")

    @cached_property
    def uncovered(self) -> np.ndarray:
        """The scenes that no setting can be judged on: claims leave them out."""
        return np.asarray(~self.is_judged.any(axis=0))

    @cached_property
    def missing(self) -> np.ndarray:
        """For each setting, the number of scenes, of those that are covered, that it cannot be judged on."""
        return np.asarray((~self.is_judged & ~self.uncovered).sum(axis=1))


def arrange(dataset: xr.Dataset) -> Table:
    """Return the table of ``dataset``.

    Raises:
        DatasetError: if it holds neither F_exact nor F_max.
    """
    dataset = elastic(dataset)
    reference = _reference(dataset)
    dims = [str(dim) for dim in dataset["force"].dims]
    rows, columns = [d for d in dims if d in MESH_DIMENSIONS], [d for d in dims if d not in MESH_DIMENSIONS]
    settings, scenes = _labels(dataset, rows), _labels(dataset, columns)
    keep = _distinct(settings)

    dataset = dataset.assign(
        force_bar=relative(dataset, "force_error"), exact_bar=relative(dataset, "force_exact_error")
    )

    def matrix(name: str) -> np.ndarray:
        values = by_case(dataset, name).transpose(*rows, *columns).values
        return np.asarray(values.reshape(len(settings), len(scenes))[keep])

    exact = matrix(_VARIABLES[reference])
    why = _reasons(matrix("status"), matrix("message"), matrix("force_bar"), exact, reference)
    blank = np.where(why == "", 0.0, np.nan)
    force, exact = matrix("force") + blank, exact + blank
    force_bar, exact_bar = (
        blank + (matrix(name) if reference == EXACT else 0.0) for name in ("force_bar", "exact_bar")
    )
    counts = np.indices([dataset.sizes[d] for d in columns]).reshape(len(columns), len(scenes))
    study = study_of(dataset)
    cases = tuple(case_at(dataset, study, labels, "mesh") for labels in scenes)
    of_probe = (
        {axis.name for axis in study.axes if axis.section == "probe" and axis.name in columns} if study else set()
    )
    return Table(
        reference=reference,
        settings=tuple(settings[i] for i in keep),
        scenes=tuple(scenes),
        axes=dict(zip(columns, counts, strict=True)),
        force=force,
        exact=exact,
        ratio=force / exact,
        bar=force / exact * (force_bar + exact_bar),
        force_bar=force_bar,
        exact_bar=exact_bar,
        share=matrix("force_ratio") + blank,
        seconds=matrix("time_total") + blank,
        dofs=matrix("dofs") + blank,
        cells=matrix("cells") + blank,
        why=why,
        meshes=tuple(_mesh(dataset, study, settings[i]) for i in keep),
        cases=cases,
        sinking=pd.DataFrame([Sinking.of(case) for case in cases]),
        tools=tuple(sorted(of_probe - LOADS - PLACES)),
        loads=tuple(sorted(of_probe & LOADS)),
    )


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


def _labels(dataset: xr.Dataset, dims: list[str]) -> list[Labels]:
    values = ([_plain(value) for value in dataset[dim].values] for dim in dims)
    return [dict(zip(dims, labels, strict=True)) for labels in itertools.product(*values)]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _distinct(settings: list[Labels]) -> list[int]:
    """Return which settings to keep: at full order nothing is outside, so that one value of it stands for all."""
    seen, keep = [], []
    for number, labels in enumerate(settings):
        same = {k: v for k, v in labels.items() if k != "outside"} if isinf(labels.get("epsilon", 0)) else labels
        if same not in seen:
            seen.append(same)
            keep.append(number)
    return keep


def _reference(dataset: xr.Dataset) -> str:
    """Return the first force that is known of those which F may be compared with."""
    for name, variable in _VARIABLES.items():
        if variable in dataset and bool(np.isfinite(dataset[variable]).any()):
            return name
    raise DatasetError(
        "the dataset holds no F_exact, against which a guide compares each mesh: "
        'run its study with `exact = true` in [solve], or with "full" in epsilon, for F_max'
    )


def _reasons(status: np.ndarray, message: np.ndarray, bar: np.ndarray, exact: np.ndarray, reference: str) -> np.ndarray:
    """Return, cell by cell, why a case cannot be judged; "" if it can."""
    why = np.full(status.shape, "", dtype=object)
    reason = np.where(message == "", "", ": " + message.astype(object))
    why[~np.isfinite(exact)] = f"{reference} is not known"
    why[~(bar >= 0)] = ("no error bar" + reason)[~(bar >= 0)]
    for state in (one for one in STATES if one != OK):
        text = "not yet run" if state == PENDING else state
        why[status == state] = (text + reason)[status == state]
    return why


def case_at(dataset: xr.Dataset, study: Study | None, labels: Labels, free: str = "") -> Case | None:
    """Return the case of ``study`` that has the ``labels``, the first of those that differ in the section ``free``.

    None if there is none, or if the labels do not tell.
    """
    if study is None:
        return None
    # Of a dataset that somebody has selected from, a label may be left as a coordinate without dimension.
    known = {name: _plain(dataset[name].values[()]) for name in dataset.coords if dataset[name].ndim == 0}
    known |= {name: _plain(value) for name, value in labels.items()}
    index = []
    for axis in study.axes:
        if axis.is_stage:
            index.append(len(axis) - 1)
            continue
        if axis.section != free and known.get(axis.name) not in axis.labels:
            return None
        index.append(0 if axis.section == free else axis.labels.index(known[axis.name]))
    return study.case(tuple(index))


def _mesh(dataset: xr.Dataset, study: Study | None, labels: Labels) -> Labels:
    """Return ε, outside, element sizes (m) and elements of a setting, as far as they are known; a rim left to the
    program is None.
    """
    scene = {axis.name: axis.labels[0] for axis in study.axes if axis.section != "mesh"} if study else {}
    case = case_at(dataset, study, scene | labels)
    if case is None:
        return dict(labels)
    mesh = case.mesh
    if mesh.accuracy is not None:
        own = {"epsilon": mesh.epsilon} if "epsilon" in labels else {}
        return {"accuracy": mesh.accuracy, **own, "outside": mesh.outside}
    outside = {"outside": mesh.outside} if not isinf(mesh.epsilon) else {}
    return {
        "epsilon": mesh.epsilon,
        **outside,
        "fine": mesh.fine,
        "coarse": mesh.coarse,
        "rim": mesh.rim,
        "growth": mesh.growth,
        "degree": mesh.degree,
        "element": mesh.element,
    }
