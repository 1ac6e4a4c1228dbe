"""Which cell has a point, and where on the reference tetrahedron: straight, curved and quarter-point cells."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray

# A point is in a cell if no barycentric coordinate is below minus this: curved surfaces are approximated by parabolas.
INSIDE = 1e-3
# A curved cell may exceed the box of its nodes by this share of the box.
_BULGE = 0.1
# Newton's method for the inverse map: iterations, largest step on the reference cell, residual in cell sizes.
_MOST, _STEP, _LEFT = 40, 0.5, 1e-12
# Residual, in cell sizes, with which a point is found: at a quarter-point node the map is singular, and Newton slow.
_ENOUGH = 1e-7
_CENTRE = 0.25
# Cells are searched by classes of size, each at most this factor wide.
_CLASS = 2.0


@dataclass(frozen=True, eq=False)
class Located:
    """For n points: local ``cells``, ``reference`` coordinates (n, 3), and ``margin`` (n), the least barycentric one.

    Where this rank has no cell at a point its number is -1, and its margin minus infinity.
    """

    cells: IntArray
    reference: FloatArray
    margin: FloatArray

    @property
    def found(self) -> BoolArray:
        """Whether this rank has a cell at each point."""
        return np.asarray(self.cells >= 0)


class Locator:
    """Finds points in the cells that this rank owns of a dolfinx ``mesh`` of tetrahedra; nothing is collective.

    Points are those of the mesh with its nodes as ``imaged`` (m), if these are given. They are found in the ``chosen``
    cells (n) alone.
    """

    def __init__(self, mesh: Any, imaged: FloatArray | None = None, chosen: BoolArray | None = None):
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._own = np.asarray(mesh.geometry.x)[compat.geometry_dofs(mesh)[:owned]]
        self._nodes = self._own if imaged is None else imaged[compat.geometry_dofs(mesh)[:owned]]
        self.order = 1 if self._nodes.shape[1] == 4 else 2
        low, high = self._nodes.min(axis=1), self._nodes.max(axis=1)
        margin = (_BULGE if self.order > 1 else INSIDE) * (high - low).max(axis=1, initial=0.0, keepdims=True)
        self._low, self._high = low - margin, high + margin
        self._sizes = np.linalg.norm(self._high - self._low, axis=1)
        self._classes = list(self._by_size(np.arange(owned) if chosen is None else np.flatnonzero(chosen)))

    def _by_size(self, chosen: IntArray) -> Any:
        """Yield, by classes of size, ``chosen`` cells, a tree of their centres and the radius that holds each."""
        if not len(chosen):
            return
        sizes = self._sizes[chosen]
        number = np.floor(np.log(sizes / sizes.min()) / np.log(_CLASS)).astype(int)
        for each in np.unique(number):
            cells = chosen[number == each]
            centres = (self._low[cells] + self._high[cells]) / 2
            yield cells, cKDTree(centres), self._sizes[cells].max() / 2

    def find(self, points: FloatArray) -> Located:
        """Return the cell of each of ``points`` (n, 3), m; of several, the one in which a point is deepest."""
        count = len(points)
        cells, reference = np.full(count, -1), np.zeros((count, 3))
        margin = np.full(count, -np.inf)
        which, of = self._candidates(points)
        if not len(which):
            return Located(cells, reference, margin)
        at, left = self._inverse(of, points[which])
        least = np.minimum(at.min(axis=1), 1 - at.sum(axis=1))
        good = (left <= _ENOUGH) & (least >= -INSIDE)
        which, of, at, least = which[good], of[good], at[good], least[good]
        order = np.lexsort((least, which))
        last = np.append(which[order][1:] != which[order][:-1], True) if len(order) else np.empty(0, bool)
        best = order[last]
        cells[which[best]], reference[which[best]], margin[which[best]] = of[best], at[best], least[best]
        return Located(cells, reference, margin)

    def map(self, located: Located) -> tuple[FloatArray, FloatArray]:
        """Return, at the points found, the Jacobian dx/dX (k, 3, 3) and its inverse; NaN where it is singular."""
        cells, at = located.cells[located.found], located.reference[located.found]
        jacobian = np.einsum("rnk,nkd->ndr", table_of(self.order, at)[1:], self._own[cells])
        return jacobian, _inverse(jacobian)

    def _candidates(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Return pairs of points and cells whose box has the point."""
        pairs: list[tuple[IntArray, IntArray]] = [(np.empty(0, int), np.empty(0, int))]
        for cells, tree, radius in self._classes:
            near = tree.query_ball_point(points, radius)
            counts = np.array([len(each) for each in near], dtype=int)
            if not counts.sum():
                continue
            which, of = np.repeat(np.arange(len(points)), counts), cells[np.concatenate(near).astype(int)]
            inside = np.all((points[which] >= self._low[of]) & (points[which] <= self._high[of]), axis=1)
            pairs.append((which[inside], of[inside]))
        first, second = zip(*pairs, strict=True)
        return np.concatenate(first), np.concatenate(second)

    def _inverse(self, cells: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the reference coordinates of ``points`` in ``cells``, and the distance left, in cell sizes."""
        at = np.full((len(points), 3), _CENTRE)
        left = np.full(len(points), np.inf)
        todo = np.arange(len(points))
        for _ in range(_MOST):
            mapped, jacobian = self._map(cells[todo], at[todo])
            rest = points[todo] - mapped
            left[todo] = np.linalg.norm(rest, axis=1) / self._sizes[cells[todo]]
            keep = left[todo] > _LEFT
            todo, rest, jacobian = todo[keep], rest[keep], jacobian[keep]
            if not len(todo):
                break
            step = np.nan_to_num(np.einsum("nij,nj->ni", _inverse(jacobian), rest))
            longest = np.abs(step).max(axis=1, keepdims=True)
            at[todo] += step * np.minimum(1.0, _STEP / np.maximum(longest, _STEP))
        return at, left

    def _map(self, cells: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the places (n, 3) of reference points in cells, and the Jacobian (n, 3, 3)."""
        table = table_of(self.order, at)
        nodes = self._nodes[cells]
        return np.einsum("nk,nkd->nd", table[0], nodes), np.einsum("rnk,nkd->ndr", table[1:], nodes)


def table_of(degree: int, points: FloatArray) -> FloatArray:
    """Return values and derivatives (4, n, functions) of the Lagrange element at reference ``points`` (n, 3)."""
    return np.asarray(compat.reference_element(degree).tabulate(1, points)[:, :, :, 0])


def _inverse(matrices: FloatArray) -> FloatArray:
    """Return the inverses of matrices (n, 3, 3), NaN or infinite where they are singular."""
    rows = [np.cross(matrices[:, :, j], matrices[:, :, k]) for j, k in ((1, 2), (2, 0), (0, 1))]
    determinant = np.einsum("ni,ni->n", matrices[:, :, 0], rows[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.stack(rows, axis=1) / determinant[:, None, None])
