"""Cells of a rank and their points, interleaved: one cell per vector lane of the C code.

Curved cells use quadrature, as in dolfinx: each stores the gradient of its map at every quadrature point, and
``curved.c`` sums over these. The ghost exchange uses dolfinx's own vectors (:class:`Ghosts`).
"""

from functools import cache, cached_property
from typing import Any

import basix
import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve.compiled import quadrature_degree
from epsmesh.solve.kernels.native import call, precision
from epsmesh.solve.physics import MaterialLaw, of_regions
from epsmesh.solve.variation import Factors

# Cells per batch, as in product.c.
LANES = 16


class Lanes:
    """Cells of a rank in batches of ``LANES``; the last batch is padded with zeros.

    ``which`` are the cells' numbers, ``dofs`` (batches, points, lanes) their points; padding repeats the first cell's.
    """

    def __init__(self, which: Int32Array, dofs: Int32Array):
        """``dofs`` (cells, points) are those of all cells of the rank."""
        self.which, self.batches = which, -(-len(which) // LANES)
        self.dofs = self.spread(dofs[which])

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return ``values`` (cells, n) of these cells as (batches, n, lanes)."""
        return filled(values)

    def lame(self, law: MaterialLaw, regions: Int32Array | None) -> FloatArray:
        """Return λ and μ (Pa), (batches, 2, lanes); ``regions`` are the regions' numbers of all cells of the rank."""
        of_cells = None if regions is None else regions[self.which]
        lame = [of_regions(values, of_cells, len(self.which)) for values in (law.lame_lambda, law.lame_mu)]
        return self.spread(np.column_stack(lame))


def filled(values: np.ndarray) -> np.ndarray:
    """Return ``values`` (cells, n) as (batches, n, lanes); padding is zero."""
    batches = -(-len(values) // LANES)
    found = np.zeros((batches * LANES, values.shape[1]), dtype=values.dtype)
    found[: len(values)] = values
    return np.ascontiguousarray(found.reshape(batches, LANES, values.shape[1]).transpose(0, 2, 1))


class StraightMaps:
    """The maps of the straight cells of a mesh, the same for spaces of all degrees.

    ``curved`` is a mask of local cells, or None if none is curved. ``factors`` are those of the energy: they count
    as volume.
    """

    def __init__(self, mesh: Any, curved: BoolArray | None, factors: Factors | None = None):
        self._mesh, self._curved, self._factors = mesh, curved, factors

    @cached_property
    def both(self) -> dict[str, np.ndarray]:
        """Maps (batches, 9, lanes) of gradients times the root of the volume, by precision, made at first use."""
        topology = self._mesh.topology
        which = straight_cells(self._curved, topology.index_map(topology.dim).size_local)
        maps = np.zeros((-(-len(which) // LANES), 9, LANES))
        call("map_cells", len(which), which, corners(self._mesh), maps)
        if self._factors is not None:
            maps *= filled(np.sqrt(self._factors.means[which])[:, None])
        return _in_both(maps)


class CurvedCells:
    """The curved cells of this rank, laid out for products.

    ``maps`` (batches, quadrature, 9, lanes), ``signs`` of weights (quadrature) and ``gradients`` (quadrature, points,
    3) exist in both precisions, ``roots`` (batches, quadrature, lanes) in double only: see ``curved.c``.
    """

    def __init__(self, space: Any, which: Int32Array, dofs: Int32Array, factors: Factors | None = None):
        """``which`` are the numbers of the curved cells, ``dofs`` (cells, points) the points of all local cells.

        ``factors``: see :class:`StraightMaps`.
        """
        self.lanes, degree = Lanes(which, dofs), compat.degree(space)
        self.quadrature = quadrature_degree(degree)
        weights, _, of_geometry = reference(2, self.quadrature)
        nodes = space.mesh.geometry.x[compat.geometry_dofs(space.mesh)[which]]
        self.roots = np.zeros((self.lanes.batches, len(weights), LANES))
        maps = np.zeros((self.lanes.batches, len(weights), 9, LANES))
        sizes = len(which), nodes.shape[1], len(weights)
        call("map_curved", *sizes, nodes, by_points(of_geometry), weights, maps, self.roots)
        if factors is not None:
            root = filled(np.sqrt(factors.in_cells(self.quadrature)[which]))
            self.roots *= root
            maps *= root[:, :, None]
        self.maps = _in_both(maps)
        self.signs = _in_both(np.sign(weights))  # some weights are negative
        self.gradients = _in_both(by_points(reference(degree, self.quadrature)[2]))

    def values(self, degree: int) -> FloatArray:
        """Return the shape functions of ``degree`` at the quadrature points, (quadrature, functions)."""
        return np.ascontiguousarray(reference(degree, self.quadrature)[1])

    @property
    def nbytes(self) -> int:
        """Bytes that a product reads."""
        return self.lanes.dofs.nbytes + sum(maps.nbytes for maps in self.maps.values())

    def add_product(self, lame: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add A x to ``y``, all in one precision and without conditions; ``lame`` is in the layout of the lanes."""
        end = "_double" if x.dtype == np.float64 else ""
        call(f"add_curved{end}", *self._arguments(lame, precision(x)), x, y)

    def add_diagonal(self, lame: FloatArray, blocks: np.ndarray) -> None:
        """Add the diagonal blocks to ``blocks`` (local, 9)."""
        call("add_curved_diagonal", *self._arguments(lame, "float64"), blocks)

    def _arguments(self, lame: np.ndarray, kind: str) -> tuple[Any, ...]:
        return *self.sizes, self.lanes.dofs, self.maps[kind], lame, self.signs[kind], self.gradients[kind]

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Number of points of a cell, of quadrature points, and of batches."""
        return self.lanes.dofs.shape[1], self.maps["float64"].shape[1], self.lanes.batches


class Ghosts:
    """Points of a space, owned ones first, then ghosts, and their exchange. Methods are collective on several ranks.

    Arrays have ``size`` numbers per point, in single or double precision.
    """

    def __init__(self, space: Any):
        self._index_map, self._is_alone = space.dofmap.index_map, space.mesh.comm.size == 1
        self.owned: int = self._index_map.size_local
        self.local: int = self.owned + self._index_map.num_ghosts
        self._vectors: dict[tuple[str, int], Any] = {}

    def extended(self, x: np.ndarray, size: int) -> np.ndarray:
        """Return values at all local points from those at owned points; valid until the next call."""
        if self._is_alone:
            return x
        vector = self._vector(x.dtype, size)
        vector.array[: len(x)] = x
        vector.scatter_forward()
        return np.asarray(vector.array)

    def folded(self, x: np.ndarray, size: int) -> np.ndarray:
        """Return sums over ranks at owned points from this rank's values at all local points; valid until next call."""
        if self._is_alone:
            return x
        vector = self._vector(x.dtype, size)
        vector.array[:] = x
        compat.add_from_ghosts(vector)
        return np.asarray(vector.array)[: size * self.owned]

    def _vector(self, kind: np.dtype[Any], size: int) -> Any:
        key = kind.name, size
        if key not in self._vectors:
            self._vectors[key] = compat.ghosted_vector(self._index_map, size, kind)
        return self._vectors[key]


def straight_cells(curved: BoolArray | None, count: int) -> Int32Array:
    """Return the numbers of the first ``count`` cells that are not ``curved``; None means that none is curved."""
    every = np.arange(count, dtype=np.int32)
    return every if curved is None else every[~curved[:count]]


def owned_cells(space: Any) -> Int32Array:
    """Return the points of each owned cell, (cells, points of a cell)."""
    topology = space.mesh.topology
    return np.ascontiguousarray(compat.cell_dofs(space)[: topology.index_map(topology.dim).size_local])


def corners(mesh: Any) -> FloatArray:
    """Return the corners of each cell, shape (cells, 4, 3)."""
    return np.ascontiguousarray(mesh.geometry.x[compat.geometry_dofs(mesh)[:, :4]])


def roots(points: FloatArray) -> FloatArray:
    """Return the signed root of the volume ratio of the cells' maps, (n, 4, 3); its sign is the determinant's."""
    first, second, third = (points[:, 1:] - points[:, :1]).transpose(1, 2, 0)
    determinants = sum(
        first[i] * (second[j] * third[k] - second[k] * third[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    )
    return np.sign(determinants) * np.sqrt(np.abs(determinants))


@cache
def reference(degree: int, quadrature: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights, values (q, i) and gradients (a, q, i) of the functions of ``degree`` on the reference cell.

    The quadrature is exact for polynomials of degree ``quadrature``.
    """
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, quadrature)
    table = compat.reference_element(degree).tabulate(1, points)[:, :, :, 0]
    return weights, table[0], table[1:4]


def summed(comm: MPI.Comm, value: float, how: MPI.Op = MPI.SUM) -> float:
    """Return the sum of all ranks' values, or another reduction (``how``); collective."""
    if comm.size == 1:
        return value
    result = np.empty(1)
    comm.Allreduce(np.array([value], dtype=np.float64), result, op=how)  # buffers; allreduce would pickle
    return float(result[0])


def _in_both(values: FloatArray) -> dict[str, np.ndarray]:
    return {"float64": values, "float32": values.astype(np.float32)}


def by_points(gradients: FloatArray) -> FloatArray:
    """Return gradients (a, q, i) as (q, i, a)."""
    return np.ascontiguousarray(gradients.transpose(1, 2, 0))
