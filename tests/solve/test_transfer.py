"""Interpolation between degrees carries polynomials over exactly, and leaves prescribed dofs alone."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from pipeline.solve.compiled import vector_space
from pipeline.solve.transfer import transfer
from tests.solve.test_mixed import make_mesh


@dataclass(frozen=True)
class Side:
    space: Any
    prescribed: np.ndarray


def polynomial(degree):
    def field(x):
        y = 1e3 * x
        return np.array([(y[0] - 0.3 * y[2]) ** degree, y[1] ** degree + 1, y[0] * y[2] ** (degree - 1)])

    return field


def carried(coarse, fine, degree):
    """Return what the matrix makes of the interpolation in ``coarse``, and the interpolation in ``fine``."""
    functions = [fem.Function(side.space) for side in (coarse, fine)]
    for function in functions:
        function.interpolate(polynomial(degree))
    matrix = transfer(coarse, fine)
    columns, rows = matrix.createVecs()
    columns.array[:] = functions[0].x.array[: columns.getLocalSize()]
    matrix.mult(columns, rows)
    values = rows.array.copy(), functions[1].x.array[: rows.getLocalSize()]
    for item in (columns, rows, matrix):
        item.destroy()
    return values


@pytest.mark.mpi
@pytest.mark.parametrize(("low", "high"), [(1, 2), (2, 3), (3, 4), (1, 4)])
def test_polynomials_are_carried_over(low, high):
    """On a mesh of straight cells a polynomial of the lower degree belongs to both spaces."""
    mesh = make_mesh(MPI.COMM_WORLD, mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh
    coarse, fine = (Side(vector_space(mesh, d), np.zeros(0, dtype=np.int32)) for d in (low, high))
    found, expected = carried(coarse, fine, low)
    assert np.abs(found - expected).max(initial=0.0) < 1e-11 * np.abs(expected).max(initial=1.0)


def test_prescribed_dofs_are_neither_read_nor_written():
    mesh = make_mesh(mesh={"degree": 1, "fine": "8 mm", "rim": "3 mm"}).mesh
    spaces = [vector_space(mesh, d) for d in (1, 2)]
    coarse, fine = Side(spaces[0], np.array([4, 30])), Side(spaces[1], np.array([0, 7, 100]))
    matrix = transfer(coarse, fine)
    offsets, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    nonzero = values != 0
    assert not np.isin(rows[nonzero], fine.prescribed).any()
    assert not np.isin(columns[nonzero], coarse.prescribed).any()
    others = np.setdiff1d(np.arange(matrix.getSize()[0]), fine.prescribed)
    assert len(np.intersect1d(rows[nonzero], others)) > 0.95 * len(others)
    matrix.destroy()
