"""Piecewise polynomials on triangles, evaluated at any points: the solution on one mesh begins that on another."""

from dataclasses import dataclass
from math import isqrt

import numpy as np

from epsmesh.arrays import FloatArray, IntArray

# Points located together: for each, its place in every triangle is computed.
_TOGETHER = 400


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials on triangles with ``corners`` (m, 3, 2): ``values`` (m, k, c) at their k ``nodes`` (m, k, 2)."""

    corners: FloatArray
    nodes: FloatArray
    values: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values (n, c) at ``points`` (n, 2); outside of all triangles, those of the nearest one go on."""
        degree = (isqrt(8 * self.nodes.shape[1] + 1) - 3) // 2
        origin, inverse = self.corners[:, 0], _inverses(self.corners)
        cells = np.concatenate(
            [_located(origin, inverse, part) for part in np.array_split(points, len(points) // _TOGETHER + 1)]
        )
        local_nodes = np.einsum("mij,mkj->mki", inverse, self.nodes - origin[:, None])
        coefficients = np.linalg.solve(_monomials(local_nodes, degree), self.values)
        local = np.einsum("nij,nj->ni", inverse[cells], points - origin[cells])
        return np.asarray(np.einsum("nk,nkc->nc", _monomials(local, degree), coefficients[cells]))


def _inverses(corners: FloatArray) -> FloatArray:
    """Return the maps (m, 2, 2) from triangles to that with corners (0, 0), (1, 0), (0, 1)."""
    return np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))


def _located(origin: FloatArray, inverse: FloatArray, points: FloatArray) -> IntArray:
    """Return the triangle (n,) of each of the ``points`` (n, 2)."""
    first, second = (
        row[:, 0] * points[:, :1] + row[:, 1] * points[:, 1:] - np.einsum("mj,mj->m", row, origin)
        for row in np.swapaxes(inverse, 0, 1)
    )
    inside: IntArray = np.minimum(np.minimum(first, second), 1 - first - second).argmax(axis=1)
    return inside


def _monomials(local: FloatArray, degree: int) -> FloatArray:
    """Return the monomials (..., k) of two variables up to a ``degree`` at points (..., 2)."""
    x, y = local[..., 0], local[..., 1]
    return np.stack([x ** (total - power) * y**power for total in range(degree + 1) for power in range(total + 1)], -1)
