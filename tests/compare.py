"""Datasets of one study, run in different ways: what must agree in them."""

from pathlib import Path

import numpy as np

from epsmesh.report.read import read_file

# Times, memory, iterations and round-off say how the work was done.
HOW = {"speedup", "machine_load", "memory", "iterations", "balance"}


def assert_same(one: Path, two: Path, *, rtol: float = 1e-7, alike: bool = True) -> None:
    """Assert that two datasets hold the same, but for what tells how the work was done.

    ``alike``: none of it was read back from a store, and it was done on as many ranks.
    """
    first, second = read_file(one), read_file(two)
    as_many = first.attrs["ranks"] == second.attrs["ranks"]
    assert set(first) == set(second)
    assert first.sizes == second.sizes
    for name in set(first) - HOW:
        if str(name).startswith("time_") or (name == "origin" and not alike):
            continue
        if not np.issubdtype(first[name].dtype, np.number):
            assert (first[name] == second[name]).all(), name
        else:
            largest = float(np.nanmax(np.abs(second[name].values), initial=0.0))
            # The sweeps of an error bar are preconditioned rank by rank.
            close = rtol if as_many or not str(name).endswith("_error") else 1e-2
            # The largest strain is linear in the solver's error, which depends on where a solve begins.
            close = 1e-4 if name == "max_strain" else close
            np.testing.assert_allclose(first[name], second[name], rtol=close, atol=close * largest, err_msg=str(name))
    attributes = ["study", "study_hash", "title", "epsilon_is_full", "version_dolfinx", "host"]
    for name in [*attributes, "ranks"] if alike else attributes:
        assert first.attrs[name] == second.attrs[name], name


def all_done(path: Path) -> bool:
    """Tell whether every case of a dataset has a force, or needs none."""
    return set(np.unique(read_file(path)["status"])) <= {"ok", "skipped"}
