"""What the dimensions of a study are about: the mesh or the scene; and the error that a mesh leaves."""

import numpy as np
import xarray as xr

from pipeline.quantities import MESH_DIMENSIONS
from pipeline.report.pareto import is_by_chance
from pipeline.report.words import is_numeric

# What refines a mesh, the most telling first: the rim rules the error.
_REFINEMENTS = ("epsilon", "rim", "fine", "coarse", "growth", "mesh_accuracy")


def mesh_dimensions(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions that change the mesh and not the scene."""
    return [str(dim) for dim in dataset["force"].dims if dim in MESH_DIMENSIONS]


def refinements(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions that refine the mesh."""
    return [name for name in _REFINEMENTS if dataset.sizes.get(name, 0) > 1]


def main_dimension(dataset: xr.Dataset) -> str | None:
    """Return the dimension that a study is about: what refines the mesh, else the first numbers, else the first."""
    dims = [str(dim) for dim in dataset["force"].dims]
    return next(iter([*refinements(dataset), *_numeric_dimensions(dataset), *dims]), None)


def with_error(dataset: xr.Dataset) -> tuple[str, xr.Dataset]:
    """Add ``error``, the relative error of F against F_exact, or against F_max where there is no F_exact.

    Beside it stand ``is_below``, whether F is less than that, and ``is_by_chance``. Returns the name of what the error
    is against, "exact" or "max". A case that is its own reference has no error.
    """
    is_exact = bool(np.isfinite(dataset["accuracy"]).any())
    signed = dataset["accuracy" if is_exact else "force_ratio"] - 1
    error = abs(signed) if is_exact else abs(signed).where(signed != 0)
    data = dataset.assign(error=error, is_below=signed < 0, is_by_chance=is_by_chance(error))
    return "exact" if is_exact else "max", data


def _numeric_dimensions(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions of numbers with more than one value, in the study's order."""
    return [str(d) for d in dataset["force"].dims if is_numeric(dataset[d]) and dataset.sizes[d] > 1]
