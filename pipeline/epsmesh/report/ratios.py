"""Forces beside those of the full order: F_max, F/F_max, F/F_exact and the speed-up."""

from collections.abc import Mapping, Sequence
from math import nan

import numpy as np
import xarray as xr

from epsmesh.plan.plan import Plan
from epsmesh.quantities import MESH_DIMENSIONS, attributes
from epsmesh.report.values import at_full_order
from epsmesh.study.sweep import Study


def add_ratios(dataset: xr.Dataset, plan: Plan) -> xr.Dataset:
    """Add F_max, F/F_max and speed-up: against the full-order case of the same scene and mesh settings."""
    force, seconds = dataset["force"], dataset["time_total"]
    full_force = _of_full_order(dataset, "force")
    if plan.study.gives_force:
        full_force = full_force * _by_depth(dataset, plan)
    ratios = {
        "force_exact_ratio": force / dataset["force_exact"],
        "force_ratio": force / full_force,
        "speedup": _of_full_order(dataset, "time_total") / seconds,
    }
    for name in ("energy_release", "load_force"):
        if name in dataset:
            ratios[f"{name}_ratio"] = dataset[name] / _of_full_order(dataset, name)
    if "law" in dataset.dims and "linear" in dataset["law"].values:
        ratios["linear_ratio"] = force / force.sel(law="linear", drop=True)
    ratios = {name: values.transpose(*force.dims, missing_dims="ignore") for name, values in ratios.items()}
    full = {"epsilon": int(np.argmax(dataset["epsilon"].values))} if "epsilon" in dataset.dims else {}
    alike = {} if plan.study.gives_force else shared(plan.study, plan.keys, full)
    ratios["force_max"] = full_force.isel(alike, drop=True)
    return dataset.assign({name: values.assign_attrs(attributes(name)) for name, values in ratios.items()})


def _by_depth(dataset: xr.Dataset, plan: Plan) -> xr.DataArray:
    """Return the factor of the full order's force from its own depth to that of each case, by F's power of the depth.

    At one force the depths of meshes differ; F_max is the force at the same depth.
    """
    powers = [found.exponent if (found := plan.depths_at_force.get(i)) else nan for i in plan.study.indices()]
    power = dataset["depth"].copy(data=np.array(powers).reshape(dataset["depth"].shape))
    return (dataset["depth"] / _of_full_order(dataset, "depth")) ** power


def _of_full_order(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable of the full-order case of the same scene and mesh settings."""
    values = dataset[name]
    if "epsilon" in values.dims:
        return at_full_order(values)
    return values.where(bool(dataset.attrs["epsilon_is_full"]))


def shared(study: Study, keys: Sequence[str], at: Mapping[str, int] | None = None) -> dict[str, int]:
    """Return dimensions of meshes along which ``keys``, one a case, are the same, each with its first place.

    ``at`` has the place along a dimension that is not asked about.
    """
    dims = [axis.name for axis in study.axes]
    table = xr.DataArray(np.array(keys, dtype=object).reshape(study.shape), dims=dims).isel(at or {})
    return {str(dim): 0 for dim in table.dims if dim in MESH_DIMENSIONS and bool((table == table.isel({dim: 0})).all())}
