"""Prolongation between degrees is exact for polynomials, and ignores prescribed dofs."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from epsmesh.solve.compiled import vector_space
from epsmesh.solve.kernels.multigrid import interpolation
from tests.solve.test_mixed import make_mesh


@dataclass(frozen=True)
class Side:
    space: Any
    prescribed: np.ndarray
    children: np.ndarray | None = None
    pairs: None = None


def polynomial(degree):
    def field(x):
        y = 1e3 * x
        return np.array([(y[0] - 0.3 * y[2]) ** degree, y[1] ** degree + 1, y[0] * y[2] ** (degree - 1)])

    return field


def carried(coarse, fine, degree):
    """Return the prolongation of the interpolant in ``coarse``, and the interpolant in ``fine``."""
    functions = [fem.Function(side.space) for side in (coarse, fine)]
    for function in functions:
        function.interpolate(polynomial(degree))
    given, expected = (f.x.array[: 3 * f.function_space.dofmap.index_map.size_local] for f in functions)
    found = np.zeros(len(expected), dtype=np.float32)
    interpolation(coarse, fine).prolong(given.astype(np.float32), found)
    return found, expected


@pytest.mark.mpi
@pytest.mark.parametrize(("low", "high"), [(1, 2), (2, 3), (3, 4), (1, 4)])
def test_polynomials_are_carried_over(low, high):
    """On straight cells a polynomial of the lower degree belongs to both spaces."""
    mesh = make_mesh(MPI.COMM_WORLD, mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh
    coarse, fine = (Side(vector_space(mesh, d), np.zeros(0, dtype=np.int32)) for d in (low, high))
    found, expected = carried(coarse, fine, low)
    assert np.abs(found - expected).max(initial=0.0) < 2e-6 * np.abs(expected).max(initial=1.0)


def test_prescribed_dofs_are_neither_read_nor_written():
    mesh = make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh
    spaces = [vector_space(mesh, d) for d in (1, 2)]
    coarse, fine = Side(spaces[0], np.array([4, 30])), Side(spaces[1], np.array([0, 7, 100]))
    between = interpolation(coarse, fine)
    sizes = [3 * space.dofmap.index_map.size_local for space in spaces]
    random = np.random.default_rng(2)
    given, residual = (random.standard_normal(size).astype(np.float32) for size in sizes)
    found, back = np.zeros(sizes[1], dtype=np.float32), np.empty(sizes[0], dtype=np.float32)
    between.prolong(given, found)
    between.restrict(residual, back)
    assert found @ residual == pytest.approx(given @ back, rel=1e-4)  # each is the other's transpose
    assert not found[fine.prescribed].any() and not back[coarse.prescribed].any()
    assert np.count_nonzero(found) > 0.95 * len(found)
    changed = given.copy()
    changed[coarse.prescribed] += 1.0
    again = np.zeros_like(found)
    between.prolong(changed, again)
    assert np.array_equal(again, found)
