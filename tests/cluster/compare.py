"""Datasets of one study, run in different ways: what must agree in them."""

from pathlib import Path

import numpy as np
import xarray as xr

# Times, memory, iterations and round-off say how the work was done.
HOW = {"speedup", "memory", "iterations", "balance"}


def assert_same(one: Path, two: Path, *, rtol: float = 1e-7) -> None:
    """Assert that two datasets hold the same, but for what tells how they were made."""
    first, second = xr.load_dataset(one), xr.load_dataset(two)
    assert set(first) == set(second)
    assert first.sizes == second.sizes
    for name in set(first) - HOW:
        if str(name).startswith("time_"):
            continue
        if first[name].dtype == object:
            assert (first[name] == second[name]).all(), name
        else:
            largest = float(np.nanmax(np.abs(second[name].values), initial=0.0))
            np.testing.assert_allclose(first[name], second[name], rtol=rtol, atol=rtol * largest, err_msg=str(name))
    for name in ("study", "study_hash", "title", "epsilon_is_full", "version_dolfinx", "host", "ranks"):
        assert first.attrs[name] == second.attrs[name], name


def all_done(path: Path) -> bool:
    """Tell whether every case of a dataset has a force, or needs none."""
    return set(np.unique(xr.load_dataset(path)["status"])) <= {"ok", "skipped"}
