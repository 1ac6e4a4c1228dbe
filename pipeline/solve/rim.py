"""Which elements at the probe's edge lack the quarter points that follow r^½ there, and which are clear of all edges.

Straight elements have none, and where an edge's few, long arcs would fold a cell the mesh gives them up
(:mod:`pipeline.mesh.curve`). What the next degree leaves of the error is then up to twice as large.
"""

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import BodyMesh
from pipeline.quantities import CLEAR
from pipeline.scene.model import FIXED, MIRROR, PROBE
from pipeline.solve.spaces import Front

# A quarter point is at 0.25 of its edge, a mid node at 0.5, up to the bulge of a curved edge.
_BETWEEN = 0.375
_CORNERS = 4


def plain_share(body: BodyMesh) -> float:
    """Return the share, 0 to 1, of the edges that end on the probe's edge without a quarter point there; collective.

    An edge counts once for every cell that it belongs to.
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


def clear_cells(body: BodyMesh, front: Front | None = None) -> BoolArray:
    """Tell which owned cells are clear of the edges at which strain is singular; collective.

    Those are the edge of the footprint, that of what is held, and the ``front`` of a slit. Clear is what has its centre
    farther from them than a tenth of the footprint's half width, the largest distance within it to its edge.
    """
    x = np.asarray(body.mesh.geometry.x)
    rim = _points_of(body, _on_edge(body, PROBE))
    footprint = x[np.unique(_nodes_of(body, {PROBE}))]
    inside = cKDTree(rim).query(footprint)[0] if len(rim) and len(footprint) else np.zeros(1)
    least = CLEAR * body.comm.allreduce(float(inside.max()), op=MPI.MAX)
    centres = x[compat.geometry_dofs(body.mesh)[: body.owned_cells, :_CORNERS]].mean(axis=1)
    edges = np.vstack([rim, _points_of(body, _on_edge(body, FIXED))])
    clear = np.isinf(cKDTree(edges).query(centres, distance_upper_bound=least)[0])
    if front is not None:
        offset = centres - np.array(front.point)
        clear &= np.hypot(offset @ np.array(front.normal), offset[:, 2] + front.depth) >= least
    return np.asarray(clear)


def _points_of(body: BodyMesh, chosen: BoolArray) -> FloatArray:
    """Return where the ``chosen`` of the local nodes of all ranks are (n, 3); collective."""
    return np.vstack(body.comm.allgather(np.asarray(body.mesh.geometry.x)[chosen]))


def _on_edge(body: BodyMesh, name: str) -> BoolArray:
    """Tell of each local node of the geometry whether it is a corner on the edge of a group of facets; collective.

    That is where the group meets the rest of the surface, planes of symmetry aside.
    """
    number = np.asarray(body.mesh.geometry.input_global_indices, dtype=np.int64)
    group = _gathered(body.comm, number[_nodes_of(body, {name})])
    rest = number[_nodes_of(body, set(body.facets) - {name, *MIRROR.values()})]
    return np.isin(number, _gathered(body.comm, np.intersect1d(rest, group)))


def _nodes_of(body: BodyMesh, names: set[str]) -> IntArray:
    """Return the local nodes at the corners of the facets of some groups, with repetitions."""
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
    """Return the ``values`` of all ranks, each once; collective."""
    return np.unique(np.concatenate(comm.allgather(np.unique(values))))
