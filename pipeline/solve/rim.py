"""Which elements at the probe's edge lack the quarter points that follow r^½ there.

Straight elements have none, and where an edge's few, long arcs would fold a cell the mesh gives them up
(:mod:`pipeline.mesh.curve`). What the next degree leaves of the error is then up to twice as large.
"""

import numpy as np
from mpi4py import MPI

from pipeline import compat
from pipeline.arrays import BoolArray, IntArray
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import BodyMesh
from pipeline.scene.model import MIRROR, PROBE

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
    on_rim = _on_rim(body)
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


def _on_rim(body: BodyMesh) -> BoolArray:
    """Tell of each local node of the geometry whether it is a corner on the probe's edge; collective.

    That is where the footprint meets the rest of the surface, planes of symmetry aside.
    """
    number = np.asarray(body.mesh.geometry.input_global_indices, dtype=np.int64)
    node = _node_of_vertex(body)
    topology = body.mesh.topology
    facet_vertices = topology.connectivity(topology.dim - 1, 0).array.reshape(-1, topology.dim)

    def numbers(names: set[str]) -> IntArray:
        facets = [body.facets[name] for name in names if name in body.facets]
        return number[node[facet_vertices[np.concatenate([*facets, np.empty(0, np.int32)]).astype(np.int32)]]].ravel()

    footprint = _gathered(body.comm, numbers({PROBE}))
    rest = numbers(set(body.facets) - {PROBE, *MIRROR.values()})
    return np.isin(number, _gathered(body.comm, np.intersect1d(rest, footprint)))


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
