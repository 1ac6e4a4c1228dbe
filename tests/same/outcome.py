"""The results of a study: what became of it, and every variable of its dataset with its unit and its error bar."""

import tempfile
import traceback
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import xarray as xr

from tests.pairs import Study

# Of a case that was solved: how, and at which cost.
_OF_THE_RUN = {"iterations", "memory", "machine_load", "balance", "speedup", "dofs", "cells"}
_WHOLE: Mapping[str, int] = MappingProxyType({})


@dataclass(frozen=True)
class Value:
    """A variable of a dataset of one case: its numbers, its unit, its error bars (NaN: it has none), its dimensions."""

    numbers: np.ndarray
    unit: str
    bars: np.ndarray
    dims: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What became of a study: ``kind`` is taken, refused, failed or traceback; the values are those of its dataset.

    ``origin`` is how F was obtained, ``of_bar`` the share of the time that its bar took.
    """

    kind: str
    message: str = ""
    values: dict[str, Value] = field(default_factory=dict)
    cells: int = 0
    dofs: int = 0
    origin: str = field(default="", compare=False)
    of_bar: float = field(default=0.0, compare=False)

    @property
    def is_taken(self) -> bool:
        """Whether it has results."""
        return self.kind == "taken"

    def only(self, names: Collection[str]) -> "Outcome":
        """Return the outcome with the values of these names."""
        return replace(self, values={name: value for name, value in self.values.items() if name in names})


def solve(study: Study, folder: Path, store: Path | None = None, at: Mapping[str, int] = _WHOLE) -> Outcome:
    """Run a study, whose files are in ``folder``; of a study that sweeps, ``at`` has the place along its dimensions.

    Records are read from ``store`` and kept there, if it is given.
    """
    from mpi4py import MPI

    from epsmesh import workflow
    from epsmesh.run.store import StoreError
    from epsmesh.study.problems import StudyError
    from epsmesh.study.read import read_mapping

    with tempfile.TemporaryDirectory() as scratch:
        try:
            declared = read_mapping(study, "same", folder)
            dataset = workflow.solve(declared, MPI.COMM_SELF, store or Path(scratch) / "cases.sqlite")
        except StudyError as error:  # of its text, or of its plan
            return Outcome("refused", " | ".join(str(problem) for problem in error.problems))
        except (StoreError, Exception):
            return Outcome("traceback", traceback.format_exc(limit=-3))
    return of_dataset(dataset, at)


def of_dataset(dataset: xr.Dataset, at: Mapping[str, int] = _WHOLE) -> Outcome:
    """Return the outcome that a dataset has: of one case, or of the one ``at`` a place along dimensions."""
    dataset = dataset.isel(dict(at), missing_dims="raise")
    states = {str(word) for word in dataset["status"].values.ravel()}
    if states != {"ok"}:
        messages = sorted({str(text) for text in np.atleast_1d(dataset["message"].values).ravel() if str(text)})
        return Outcome("failed", f"{', '.join(sorted(states))}: {' | '.join(messages)}")
    values = {}
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind == "f" and not is_of_the_run(str(name)) and not str(name).endswith("_error"):
            numbers = np.asarray(variable.values, dtype=float)
            bar = f"{name}_error"
            bars = dataset[bar].broadcast_like(variable).values if bar in dataset else np.full(numbers.shape, np.nan)
            values[str(name)] = Value(
                numbers,
                str(variable.attrs.get("units", "?")),
                np.asarray(bars, dtype=float),
                (*map(str, variable.dims),),
            )
    origin = str(np.atleast_1d(dataset["origin"].values).ravel()[0]) if "origin" in dataset else ""
    shown, bar = (float(dataset[name].sum()) if name in dataset else 0.0 for name in ("time_total", "time_error"))
    of_bar = bar / (shown + bar) if bar > 0 else 0.0
    return Outcome("taken", "", values, int(dataset["cells"].max()), int(dataset["dofs"].max()), origin, of_bar)


def is_of_the_run(name: str) -> bool:
    """Return whether a variable tells how a case was solved, not what it is."""
    return name in _OF_THE_RUN or (name.startswith("time_") and name != "time")
