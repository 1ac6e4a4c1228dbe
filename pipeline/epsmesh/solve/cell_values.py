"""Values on cells: strains from the mean of ∇u over each cell, and the cells near singular edges.

To report another value, write it as a function of :class:`Cells`, add it to :data:`CELL_MAXIMA`, and give it a line in
``quantities.toml``. A value in Pa is scaled with Young's modulus and the depth, any other with the depth.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import cKDTree

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.quantities import CLEAR
from epsmesh.scene.model import FIXED, JAW, MIRROR, PROBE
from epsmesh.solve.compiled import cellwise_space, form_like, vector_space
from epsmesh.solve.conditions import Front
from epsmesh.solve.forms import one_cell
from epsmesh.solve.measures import dx, marked_cells
from epsmesh.solve.physics import MaterialLaw, of_regions
from epsmesh.stages import stage

# A quarter point is at 0.25 of its edge, a mid node at 0.5, up to the bulge of a curved edge.
_BETWEEN = 0.375
_CORNERS = 4
# λ/μ up to which volume counts in energies: beyond, that of degree p is of the elements more than of the tissue.
_MOST_RATIO = 10.0
# For each mesh, by the front of its slit: the cells that are clear of singular edges.
CLEAR_CELLS: WeakKeyDictionary[Any, dict[Front | None, BoolArray]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Cells:
    """Owned cells of a solution: the mean ``gradient`` of the displacement (n, 3, 3), λ and μ (n), Pa; volumes (n), m³.

    λ is infinite in incompressible tissue. In mixed elements (``is_mixed``) the mean pressure is not λ tr ε, so the
    stress is unknown: return NaN there.
    """

    gradient: FloatArray
    volumes: FloatArray
    lame_lambda: FloatArray
    lame_mu: FloatArray
    is_linear: bool
    is_mixed: bool

    @cached_property
    def principal_strains(self) -> FloatArray:
        """Principal strains (n, 3), ascending; at large displacements they are principal stretches less 1."""
        if self.is_linear:
            return np.asarray(np.linalg.eigvalsh((self.gradient + self.gradient.swapaxes(1, 2)) / 2))
        return np.asarray(np.linalg.svd(np.eye(3) + self.gradient, compute_uv=False)[:, ::-1] - 1)

    @property
    def energies(self) -> FloatArray:
        """About the strain energies (n), J, of shape above all; λ is at most 10 μ in them."""
        strain = (self.gradient + self.gradient.swapaxes(1, 2)) / 2
        dilation = np.trace(strain, axis1=1, axis2=2)
        volumetric = np.minimum(self.lame_lambda, _MOST_RATIO * self.lame_mu) / 2 * dilation**2
        return np.asarray(self.volumes * (volumetric + self.lame_mu * (strain**2).sum(axis=(1, 2))))


def _max_strain(cells: Cells) -> FloatArray:
    return np.asarray(np.abs(cells.principal_strains).max(axis=1, initial=0.0))


# Values with one number per cell, by their name in the dataset; the largest over all cells is reported. Cells near a
# singular edge (:func:`clear_cells`) are left out: strain there grows without limit as elements shrink.
CELL_MAXIMA: dict[str, Callable[[Cells], FloatArray]] = {"max_strain": _max_strain}


class CellValues:
    """Values on the cells of a mesh for the current ``displacement`` of a space."""

    def __init__(self, body: BodyMesh, displacement: Any, *, is_mixed: bool = False, factors: FloatArray | None = None):
        """Compile the forms; collective.

        ``is_mixed`` if the elements have a pressure, too; ``factors`` are those of the energy of local cells.
        """
        self._body, self._is_mixed, self._factors = body, is_mixed, factors
        space = displacement.function_space
        tensors = cellwise_space(space.mesh, (3, 3))

        def made(name: str, integrand: Callable[[], Any], *parts: Any) -> Any:
            def expression() -> Any:
                return ufl.inner(integrand(), ufl.TestFunction(tensors)) * dx(space)

            kind = name, compat.degree(space)
            return form_like(kind, expression, space.mesh, marked_cells(space.mesh), tensors, *parts)

        self._integral = made("gradient", lambda: ufl.grad(displacement), displacement)
        self._volume = made("volume", lambda: ufl.as_tensor(np.ones((3, 3)).tolist()))

    @stage("strain")
    def cells(self, law: MaterialLaw) -> Cells:
        """Return gradient and moduli of the owned cells for the material ``law``; collective."""
        owned = self._body.owned_cells
        integral, volume = (
            np.asarray(fem.assemble_vector(part).array).reshape(-1, 3, 3)[:owned]
            for part in (self._integral, self._volume)
        )
        lame = [of_regions(values, self._body.regions, owned) for values in (law.lame_lambda, law.lame_mu)]
        if self._factors is not None:
            lame = [values * self._factors[:owned] for values in lame]
        return Cells(
            gradient=integral / volume,
            volumes=volume[:, 0, 0],
            lame_lambda=lame[0],
            lame_mu=lame[1],
            is_linear=law.is_linear,
            is_mixed=self._is_mixed,
        )

    def principal_strains(self, law: MaterialLaw) -> FloatArray:
        """Return the principal strains of each owned cell, ascending, (cells, 3); collective."""
        return self.cells(law).principal_strains

    def largest(self, law: MaterialLaw, front: Front | None = None) -> dict[str, Any]:
        """Return the maximum of each of ``CELL_MAXIMA`` over cells clear of singular edges, by name; collective."""
        cells, clear = self.cells(law), self._clear_of(front) & self._body.is_tissue
        found = [value(cells)[clear].max(initial=-np.inf) for value in CELL_MAXIMA.values()]
        # NaN on one rank must give NaN on all ranks; MPI's MAX does not promise that.
        largest = np.max(self._body.comm.allgather(found), axis=0)
        return {
            name: 0.0 if value == -np.inf else float(value) for name, value in zip(CELL_MAXIMA, largest, strict=True)
        }

    def _clear_of(self, front: Front | None) -> BoolArray:
        known = CLEAR_CELLS.setdefault(self._body.mesh, {})
        if front not in known:
            known[front] = clear_cells(self._body, front)
        return known[front]


def compile_cell_values(degree: int, *, straight: bool) -> None:
    """Compile the forms of :class:`CellValues` for displacements of ``degree``."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=straight))
    CellValues(body, fem.Function(vector_space(body.mesh, degree)))


# ---- edges at which strain is singular -----------------------------------------------------------------
#
# Elements with quarter points reproduce r^½ at the probe's edge. Straight elements have none. A mesh also omits them
# where long arcs of the edge would fold a cell (epsmesh.mesh.curve). The error that the next degree leaves is then up
# to twice as large.


def plain_share(body: BodyMesh) -> float:
    """Return the share (0 to 1) of element edges at the probe's rim that have no quarter point; collective.

    These are edges with one end on the rim. An edge counts once for each cell that contains it.
    """
    nodes = compat.geometry_dofs(body.mesh)[: body.owned_cells]
    if nodes.shape[1] == _CORNERS:
        return 1.0
    on_rim = _on_edge(body, PROBE)
    corners = nodes[:, :_CORNERS]
    near = on_rim[corners].any(axis=1)
    ends, middle = corners[near][:, EDGES], nodes[near, _CORNERS:]
    first, second = on_rim[ends[..., 0]], on_rim[ends[..., 1]]
    x = np.asarray(body.mesh.geometry.x)
    plain = total = 0
    for here, there, chosen in ((0, 1, first & ~second), (1, 0, second & ~first)):
        start = x[ends[chosen, here]]
        along = x[ends[chosen, there]] - start
        place = ((x[middle[chosen]] - start) * along).sum(axis=1) / (along**2).sum(axis=1)
        plain, total = plain + int((place > _BETWEEN).sum()), total + len(place)
    plain, total = (body.comm.allreduce(n, op=MPI.SUM) for n in (plain, total))
    return plain / total if total else 0.0


def clear_cells(body: BodyMesh, front: Front | None = None, *, wholly: bool = False) -> BoolArray:
    """Return a mask of the owned cells that are clear of edges with singular strain; collective.

    Singular edges are the rims of footprints, the edge of the support, and the ``front`` of a slit. A cell is clear
    if its centre is farther from them than a tenth of the footprint's half width (the largest distance within the
    footprint to its rim). It is ``wholly`` clear if all its corners are, too.
    """
    x = np.asarray(body.mesh.geometry.x)
    rim = _points_of(body, _on_edge(body, PROBE))
    footprint = x[np.unique(_nodes_of(body, {PROBE}))]
    inside = cKDTree(rim).query(footprint)[0] if len(rim) and len(footprint) else np.zeros(1)
    least = CLEAR * body.comm.allreduce(float(inside.max()), op=MPI.MAX)
    corners = x[compat.geometry_dofs(body.mesh)[: body.owned_cells, :_CORNERS]]
    places = corners.mean(axis=1)[:, None]
    if wholly:
        places = np.concatenate([places, corners], axis=1)
    clear = np.ones(places.shape[:2], dtype=bool)
    for edges in (rim, *(_points_of(body, _on_edge(body, name)) for name in (JAW, FIXED))):
        if len(edges):  # most places are outside the box of what is near
            near = ((places >= edges.min(axis=0) - least) & (places <= edges.max(axis=0) + least)).all(axis=2)
            clear[near] &= np.isinf(cKDTree(edges).query(places[near], distance_upper_bound=least)[0])
    if front is not None:
        offset = places - np.array(front.point)
        clear &= np.hypot(offset @ np.array(front.normal), offset[..., 2] + front.depth) >= least
    return np.asarray(clear.all(axis=1))


def _points_of(body: BodyMesh, chosen: BoolArray) -> FloatArray:
    """Return the coordinates (n, 3) of the ``chosen`` local nodes of all ranks; collective."""
    return np.vstack(body.comm.allgather(np.asarray(body.mesh.geometry.x)[chosen]))


def _on_edge(body: BodyMesh, name: str) -> BoolArray:
    """Return a mask of the local geometry nodes that are corners on the edge of a group of facets; collective.

    The edge is where the group meets the rest of the surface. Planes of symmetry do not count.
    """
    number = np.asarray(body.mesh.geometry.input_global_indices, dtype=np.int64)
    group = _gathered(body.comm, number[_nodes_of(body, {name})])
    rest = number[_nodes_of(body, set(body.facets) - {name, *MIRROR.values()})]
    return np.isin(number, _gathered(body.comm, np.intersect1d(rest, group)))


def _nodes_of(body: BodyMesh, names: set[str]) -> IntArray:
    """Return the local nodes at the corners of the facets of the groups ``names``, with repetitions."""
    topology = body.mesh.topology
    facet_vertices = topology.connectivity(topology.dim - 1, 0).array.reshape(-1, topology.dim)
    facets = [body.facets[name] for name in names if name in body.facets]
    chosen = np.concatenate([*facets, np.empty(0, np.int32)]).astype(np.int32)
    return np.asarray(_node_of_vertex(body)[facet_vertices[chosen]]).ravel()


def _node_of_vertex(body: BodyMesh) -> IntArray:
    topology = body.mesh.topology
    index_map = topology.index_map(0)
    node = np.empty(index_map.size_local + index_map.num_ghosts, dtype=np.int64)
    vertices = topology.connectivity(topology.dim, 0).array
    node[vertices] = compat.geometry_dofs(body.mesh)[:, :_CORNERS].reshape(-1)
    return node


def _gathered(comm: MPI.Comm, values: IntArray) -> IntArray:
    """Return the distinct ``values`` of all ranks; collective."""
    own = np.unique(values)
    return own if comm.size == 1 else np.unique(np.concatenate(comm.allgather(own)))
