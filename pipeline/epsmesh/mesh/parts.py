"""A mesh in parts, one a rank: each rank refines, curves and reflects its own, and all agree on common points.

What a rank computes of a common point depends on the point alone, so that the mesh is the same on any number of ranks.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, Int32Array, IntArray
from epsmesh.mesh.curve import EDGES, curve, interfaces
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.refine import NotRefined, refined
from epsmesh.mesh.reflect import Place, reflect, reflect_labels
from epsmesh.scene.model import Scene
from epsmesh.stages import stage

# Cells that were made of one are kept together where each rank has that many of those.
_FAMILIES = 50
# Corners of the face opposite each corner, and all nodes of it in a cell with ten.
_FACES = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
_FACE_NODES = np.array(
    [[*face, *(4 + n for n, edge in enumerate(EDGES) if set(edge) <= set(face))] for face in _FACES.tolist()]
)


@dataclass(frozen=True)
class Part:
    """The cells of a mesh that one rank has.

    The last point of ``mesh`` belongs to no cell: it replaces, in triangles, points that only other parts have. Groups
    of triangles have all that touch a point of this part. ``numbers`` (n) are those of its points in the whole mesh,
    below ``count``. ``beyond`` (m, 4) is the rank that has the cell beyond each face, opposite a corner; -1 where that
    is this rank, or nothing. The last ``refinements`` of its cells were made in eights, whose order is kept.
    """

    mesh: MeshArrays
    numbers: IntArray
    count: int
    beyond: Int32Array
    refinements: int = 0


@stage("parts")
def split(mesh: MeshArrays, ranks: int, *, is_refined: bool = False) -> list[Part]:
    """Return the parts, one for each of ``ranks``, of a mesh with ten nodes per cell.

    The cells of a mesh that ``is_refined`` come in eights, those at the corners first: see :func:`refined`.
    """
    mesh = replace(mesh, interfaces=None if mesh.regions is None else interfaces(mesh))
    if ranks == 1:
        owner = np.zeros(len(mesh.cells), dtype=np.int32)
    elif is_refined and len(mesh.cells) >= 8 * _FAMILIES * ranks:
        # Five times faster than of all cells, and no more faces are between parts.
        owner = np.repeat(compat.partition(mesh.cells[:, 0].reshape(-1, 8)[:, :4], ranks), 8)
    else:
        owner = compat.partition(mesh.cells[:, :4], ranks)
    beyond, times = _beyond(mesh.cells, owner), 0
    if is_refined:
        times = int((owner.reshape(-1, 8) == owner[::8, None]).all())
    return [_part(mesh, np.flatnonzero(owner == rank), beyond, times) for rank in range(ranks)]


def _beyond(cells: IntArray, owner: Int32Array) -> Int32Array:
    """Return the rank that has the cell beyond each face of each cell, -1 where it is the cell's own or none."""
    corners = np.sort(cells[:, _FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(corners.T)
    twins = np.flatnonzero(np.all(corners[order[1:]] == corners[order[:-1]], axis=1))
    result = np.full(len(corners), -1, dtype=np.int32)
    one, other = order[twins], order[twins + 1]
    for here, there in ((one, other), (other, one)):
        differs = owner[there // 4] != owner[here // 4]
        result[here[differs]] = owner[there[differs] // 4]
    return result.reshape(-1, 4)


def _part(mesh: MeshArrays, chosen: IntArray, beyond: Int32Array, refinements: int) -> Part:
    """Return the part of the ``chosen`` cells."""
    numbers = np.unique(mesh.cells[chosen])
    local = np.full(len(mesh.points), len(numbers))
    local[numbers] = np.arange(len(numbers))

    def touching(triangles: IntArray) -> IntArray:
        found = local[triangles]
        return np.asarray(found[(found < len(numbers)).any(axis=1)])

    own = replace(
        mesh,
        points=mesh.points[np.append(numbers, numbers[:1])],
        cells=local[mesh.cells[chosen]],
        facets={name: touching(triangles) for name, triangles in mesh.facets.items()},
        rim=np.setdiff1d(local[mesh.rim], [len(numbers)]),
        regions=None if mesh.regions is None else mesh.regions[chosen],
        interfaces=None if mesh.interfaces is None else touching(mesh.interfaces),
    )
    return Part(own, np.append(numbers, -1), len(mesh.points), beyond[chosen], refinements)


@stage("refinement")
def refine(part: Part, scene: Scene, comm: MPI.Comm) -> Part:
    """Return a part whose cells are cut into eight each, with curved edges and new numbers; collective.

    Raises:
        NotRefined: on every rank, if a cell would be flat.
    """
    fine, message = None, ""
    try:
        fine, carriers = refined(part.mesh)
    except NotRefined as error:
        message = str(error)
    messages = comm.allgather(message)
    if any(messages) or fine is None:
        raise NotRefined(next(filter(None, messages)))
    beyond = np.take_along_axis(np.repeat(part.beyond, 8, axis=0), np.maximum(carriers, 0), axis=1)
    beyond[carriers < 0] = -1
    curved = curve(fine, scene, agree=partial(_agree, part, comm))
    return Part(curved, _labels(part, curved), part.count**2, beyond, part.refinements + 1)


def _agree(part: Part, comm: MPI.Comm, edges: IntArray, chosen: BoolArray) -> tuple[BoolArray, bool]:
    """Agree on the edges that any part has chosen: see ``Agree``."""
    if comm.size == 1:
        return chosen, bool(chosen.any())
    found = np.concatenate(comm.allgather(_edge_labels(part, edges[chosen])))
    return (np.isin(_edge_labels(part, edges), found) if len(found) else chosen), bool(len(found))


def _edge_labels(part: Part, edges: IntArray) -> IntArray:
    ends = np.sort(part.numbers[edges], axis=1)
    return np.asarray(ends[:, 0] * part.count + ends[:, 1])


def _labels(part: Part, curved: MeshArrays) -> IntArray:
    """Return a number for each point of the refined part that is the same on every rank, with gaps."""
    vertices = len(part.numbers)
    edges = np.empty((len(curved.points) - vertices, 2), dtype=np.int64)
    edges[curved.cells[:, 4:] - vertices] = curved.cells[:, EDGES]
    corners = np.where(part.numbers < 0, -1, part.numbers * (part.count + 1))
    return np.concatenate([corners, _edge_labels(part, edges)])


def reflect_part(part: Part, planes: tuple[str, ...], middle: Place) -> Part:
    """Return a part joined with its mirror images in ``planes``, which bound the mesh: see :func:`.reflect.reflect`."""
    for plane in planes:
        numbers = reflect_labels(part.mesh, part.numbers, part.count, plane)
        beyond = np.vstack([part.beyond, part.beyond[:, [0, 1, 3, 2]]])
        part = Part(reflect(part.mesh, (plane,), middle), numbers, 2 * part.count, beyond, part.refinements)
    return part


@stage("numbering")
def renumbered(part: Part, comm: MPI.Comm) -> tuple[Part, BoolArray]:
    """Number the points of the whole mesh without gaps, rank by rank; collective.

    Also returned is which points are numbered by this rank, in ascending order: a common point by the first that has
    it.
    """
    common = np.zeros(len(part.numbers), dtype=bool)
    for face, nodes in enumerate(_FACE_NODES):
        common[part.mesh.cells[part.beyond[:, face] >= 0][:, nodes]] = True
    own = part.numbers >= 0
    which = np.flatnonzero(common)
    labels = part.numbers[which]
    # A common point is looked up at the rank that its label gives.
    order = np.argsort(labels % comm.size, kind="stable")
    which, labels = which[order], labels[order]
    ends = np.searchsorted((labels % comm.size), np.arange(1, comm.size))

    def exchanged(values: IntArray | BoolArray) -> list[IntArray | BoolArray]:
        return list(comm.alltoall(np.split(values, ends)))

    asked = exchanged(labels)
    back = np.cumsum([len(some) for some in asked])[:-1]
    _, first, inverse = np.unique(np.concatenate(asked), return_index=True, return_inverse=True)
    is_first = np.zeros(len(inverse), dtype=bool)
    is_first[first] = True

    def answered(values: IntArray | BoolArray) -> IntArray | BoolArray:
        return np.concatenate(comm.alltoall(np.split(values, back)))

    own[which] = answered(is_first)
    numbers = np.full(len(own), -1, dtype=np.int64)
    count = int(np.count_nonzero(own))
    counts = comm.allgather(count)
    numbers[own] = sum(counts[: comm.rank]) + np.arange(count)
    numbered = np.concatenate(exchanged(numbers[which]))
    numbers[which] = answered(numbered[first][inverse.reshape(-1)])
    return replace(part, numbers=numbers, count=sum(counts)), own


def whole(part: Part) -> MeshArrays:
    """Return the mesh of the only part, without the point that belongs to no cell."""
    mesh = part.mesh
    used = np.zeros(len(mesh.points), dtype=bool)
    used[mesh.cells] = True
    number = np.cumsum(used) - 1
    return replace(
        mesh,
        points=mesh.points[used],
        cells=number[mesh.cells],
        facets={name: number[triangles] for name, triangles in mesh.facets.items()},
        rim=number[mesh.rim],
        interfaces=None,
    )
