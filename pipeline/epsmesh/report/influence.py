"""The variables of a dataset that tell where the force is decided: by region, and by distance from the touch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.quantities import attributes
from epsmesh.run.record import Record
from epsmesh.study.case import Case
from epsmesh.study.influence import DECIDED
from epsmesh.study.sweep import Study

SPREAD = "force_uncertainty_tissue"
# A normal distribution has 95 % within so many standard deviations.
OF_NORMAL = 1.959964
# What is given, each with its dimension.
_GIVEN = {"force_share": "region", "poisson_effect": "region", "influence_radius": "decided"}


def add_influence(
    dataset: xr.Dataset, study: Study, cases: Sequence[Case], records: Sequence[Record | None]
) -> xr.Dataset:
    """Return the dataset with what the ``records`` of its ``cases`` have of the influence, if the study asks for it.

    The regions are those of all bodies; a body without one of them has NaN there.
    """
    if not study.solve.influence:
        return dataset
    names = list(dict.fromkeys(name for case in cases for name in _regions(case)))
    labels: dict[str, list[Any]] = {"region": names, "decided": list(DECIDED)}
    found: dict[str, Any] = {}
    for base, dim in _GIVEN.items():
        for name in (base, f"{base}_error"):
            values = [_of(case, record, name, dim, labels[dim]) for case, record in zip(cases, records, strict=True)]
            dims = (*(axis.name for axis in study.axes), dim)
            found[name] = dims, np.array(values).reshape(*study.shape, -1), attributes(name)
    if any(tissue.spread for case in cases for tissue in case.tissues):
        found |= _spread(dataset, study, cases, records)
    return dataset.assign(found).assign_coords({dim: (dim, labels[dim], attributes(dim)) for dim in labels})


def _spread(
    dataset: xr.Dataset, study: Study, cases: Sequence[Case], records: Sequence[Record | None]
) -> dict[str, tuple[Any, ...]]:
    """Return half of the range that holds 95 % of the forces (N), whose logarithm is normally distributed, and its bar.

    The bar has the errors of F, and of the mean and the deviation of ln F.
    """
    unknown = (np.nan, np.nan)
    pairs = [[_known(record, f"tissue_{name}") or unknown for record in records] for name in ("mean", "spread")]
    (mean, off_mean), (deviation, off_deviation) = np.moveaxis(np.array(pairs), 2, 1).reshape(2, 2, *study.shape)
    named = [
        f"{name} {tissue.spread}"
        for case in cases
        for name, tissue in zip(case.body.region_names, case.tissues, strict=True)
        if tissue.spread
    ]
    dims = [axis.name for axis in study.axes]
    force, bar = (abs(dataset[name].transpose(*dims).values) for name in ("force", "force_error"))
    wide = OF_NORMAL * deviation
    values = force * np.exp(mean) * np.sinh(wide)
    error = values * np.sqrt((bar / force) ** 2 + off_mean**2 + (OF_NORMAL * off_deviation / np.tanh(wide)) ** 2)
    of_values = attributes(SPREAD) | {"comment": "; ".join(dict.fromkeys(named))}
    return {SPREAD: (dims, values, of_values), f"{SPREAD}_error": (dims, error, attributes(f"{SPREAD}_error"))}


def _known(record: Record | None, name: str) -> tuple[float, ...] | None:
    return record.influence.get(name) if record and record.is_ok else None


def _regions(case: Case) -> dict[str, int]:
    """Return the regions that have cells, with their numbers."""
    names = {name: number for number, name in enumerate(case.body.region_names)}
    return {name: number for name, number in names.items() if number or not case.body.is_filled}


def _of(case: Case, record: Record | None, name: str, dim: str, labels: Sequence[Any]) -> np.ndarray[Any, Any]:
    known = _known(record, name)
    if known is None:
        return np.full(len(labels), np.nan)
    if dim == "decided":
        return np.array(known)
    places = _regions(case)
    return np.array([known[places[label]] if label in places else np.nan for label in labels])
