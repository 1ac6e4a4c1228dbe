"""The stiffness of cells with curved edges as a product, by quadrature: what dolfinx assembles, but no matrix.

At each point of the quadrature a cell has the gradient of its map; ``curved.c`` sums over the points, many cells side
by side.
"""

from typing import Any

import numpy as np

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array
from pipeline.solve.kernels.cells import LANES, Lanes, reference
from pipeline.solve.kernels.native import call


def quadrature_degree(degree: int) -> int:
    """Return up to which degree polynomials are integrated on curved cells of a space of ``degree``.

    The map of a quarter-point element varies within the cell, and 2p reads F up to 0.07 % low there; at p = 2, degree 4
    has points at which the map is singular.
    """
    return max(6, 2 * degree)


class CurvedCells:
    """The curved cells of this rank, laid out for products.

    ``maps`` (batches, quadrature, 9, lanes), ``signs`` of weights (quadrature) and ``gradients`` (quadrature, points,
    3) are in both precisions, ``roots`` (batches, quadrature, lanes) in double: see ``curved.c``.
    """

    def __init__(self, space: Any, which: Int32Array, dofs: Int32Array):
        """``which`` cells are curved, ``dofs`` (cells, points) are the points of all cells of this rank."""
        self.lanes, degree = Lanes(which, dofs), compat.degree(space)
        self._quadrature = quadrature_degree(degree)
        weights, _, of_geometry = reference(2, self._quadrature)
        nodes = space.mesh.geometry.x[compat.geometry_dofs(space.mesh)[which]]
        self.roots = np.zeros((self.lanes.batches, len(weights), LANES))
        maps = np.zeros((self.lanes.batches, len(weights), 9, LANES))
        call("map_curved", len(which), nodes.shape[1], len(weights), nodes, _by_points(of_geometry), weights,
                  maps, self.roots)  # fmt: skip
        self.maps = _in_both(maps)
        self.signs = _in_both(np.sign(weights))  # not all weights are positive
        self.gradients = _in_both(_by_points(reference(degree, self._quadrature)[2]))

    def values(self, degree: int) -> FloatArray:
        """Return the values (quadrature, functions) of a space of ``degree`` at the points of the quadrature."""
        return np.ascontiguousarray(reference(degree, self._quadrature)[1])

    @property
    def nbytes(self) -> int:
        """Bytes of all that products read."""
        return self.lanes.dofs.nbytes + sum(maps.nbytes for maps in self.maps.values())

    def add_product(self, lame: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add A x to ``y``, all in one precision; ``lame`` is of the lanes, what is prescribed is as any other."""
        end, kind = "_double" if x.dtype == np.float64 else "", x.dtype.name
        call(f"add_curved{end}", *self.sizes, self.lanes.dofs, self.maps[kind], lame, self.signs[kind],
                  self.gradients[kind], x, y)  # fmt: skip

    def add_diagonal(self, lame: FloatArray, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to ``blocks`` (local, 9)."""
        kind = "float64"
        call("add_curved_diagonal", *self.sizes, self.lanes.dofs, self.maps[kind], lame, self.signs[kind],
                  self.gradients[kind], blocks)  # fmt: skip

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Points of a cell, those of the quadrature, and batches."""
        return self.lanes.dofs.shape[1], self.maps["float64"].shape[1], self.lanes.batches


def _in_both(values: FloatArray) -> dict[str, np.ndarray]:
    return {"float64": values, "float32": values.astype(np.float32)}


def _by_points(gradients: FloatArray) -> FloatArray:
    """Return gradients (a, q, i) as (q, i, a)."""
    return np.ascontiguousarray(gradients.transpose(1, 2, 0))
