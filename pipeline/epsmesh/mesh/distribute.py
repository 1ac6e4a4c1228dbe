"""From arrays on one process to a distributed dolfinx mesh with named boundary facets."""

from dataclasses import dataclass
from functools import cached_property
from math import inf, nan
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.parts import Part, renumbered
from epsmesh.scene.model import MIRROR, TOOL
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.stages import stage


@dataclass(frozen=True)
class BodyMesh:
    """A distributed mesh and the facets, local to this rank, of each boundary group.

    ``regions`` are the region numbers of local cells, ghosts included; None for a body of one material. ``deviation``
    (m) is the largest distance of its points from the surface in a file of triangles; NaN for other bodies. Where the
    mesh is that of a body without load, ``imaged`` (n, 3), m, are its nodes as the study gives them, under load.

    The last ``refinements`` of a coarser mesh cut its cells in eight: those of one are on one rank, one after the other
    in the order in which the cells were passed to dolfinx. In this order ``beyond`` (cells, 4) are the ranks that have
    the cell next to each of this rank, -1 for itself or none.
    """

    mesh: Any
    facets: dict[str, Int32Array]
    cells: int  # global
    regions: Int32Array | None = None
    deviation: float = nan
    imaged: FloatArray | None = None
    refinements: int = 0
    beyond: Int32Array | None = None

    @property
    def shown(self) -> FloatArray:
        """The local nodes (n, 3), m, of the shape that the study gives: its places are on that one."""
        return np.asarray(self.mesh.geometry.x) if self.imaged is None else self.imaged

    @property
    def owned_cells(self) -> int:
        """Number of cells that this rank owns."""
        return int(self.mesh.topology.index_map(self.mesh.topology.dim).size_local)

    @property
    def planes(self) -> dict[str, int]:
        """Groups of facets in planes of symmetry that bound the mesh, each with the axis normal to it.

        Those are x, y, and z for the plane between two jaws, in the solver's frame, where the tool presses along -z.
        """
        return {name: axis for axis, name in enumerate(MIRROR.values()) if name in self.facets}

    @property
    def mirrored(self) -> tuple[int, ...]:
        """Axes normal to the planes of symmetry that cut tool and mesh: 0 for x = 0, 1 for y = 0."""
        return tuple(axis for name, axis in self.planes.items() if name != MIRROR[MIDDLE])

    @property
    def is_halved(self) -> bool:
        """Whether the mesh ends in the plane between two jaws, of which it has one."""
        return MIRROR[MIDDLE] in self.facets

    @property
    def images(self) -> float:
        """Number of mirror images of the mesh in the whole body, itself included; a second jaw is an image, too."""
        return 2.0 ** len(self.planes)

    @property
    def comm(self) -> MPI.Comm:
        """Communicator of the mesh."""
        return self.mesh.comm

    @cached_property
    def is_tissue(self) -> BoolArray:
        """Mask of the owned cells, those of a tool that deforms excepted: of the last region; collective."""
        found = np.ones(self.owned_cells, dtype=bool)
        if TOOL not in self.facets or self.regions is None:
            return found
        last = self.comm.allreduce(int(self.regions.max(initial=0)), op=MPI.MAX)
        return np.asarray(self.regions[: self.owned_cells] != last)

    @cached_property
    def mean_size(self) -> float:
        """Size of elements (m), the cube root of their mean volume, as if the mesh filled its bounding box."""
        points = self.mesh.geometry.x
        ends = np.concatenate([points.max(axis=0, initial=-inf), (-points).max(axis=0, initial=-inf)])
        self.comm.Allreduce(MPI.IN_PLACE, ends, MPI.MAX)
        return float(np.cbrt(np.prod(ends[:3] + ends[3:]) / self.cells))


@stage("dolfinx mesh")
def distribute(comm: MPI.Comm, arrays: MeshArrays | None) -> BodyMesh:
    """Create the dolfinx mesh of ``arrays``, which are on rank 0 only; collective."""
    if arrays is not None:
        cells, points = arrays.cells, arrays.points
        known = cells.shape[1], arrays.facets, len(cells), arrays.deviation
    else:
        cells, points, known = np.empty((0, 0), np.int64), np.empty((0, 3)), None
    width, surface, count, deviation = comm.bcast(known)
    mesh = compat.create_mesh(comm, cells.reshape(-1, width), points, order=1 if width == 4 else 2)
    regions = comm.bcast(None if arrays is None else _narrow(arrays.regions))
    return BodyMesh(mesh, _find_facets(mesh, surface), count, _of_cells(mesh, regions), deviation)


@stage("dolfinx mesh")
def distribute_parts(comm: MPI.Comm, part: Part) -> BodyMesh:
    """Create the dolfinx mesh of cells that each rank has; collective."""
    part, own = renumbered(part, comm)
    arrays, numbers = part.mesh, part.numbers
    mesh = compat.create_mesh(comm, numbers[arrays.cells], arrays.points[own], order=2, beyond=part.beyond)
    surface = {name: numbers[triangles] for name, triangles in arrays.facets.items()}
    small = _narrow(arrays.regions)
    regions = None if small is None else np.concatenate(comm.allgather(small))
    count = comm.allreduce(len(arrays.cells))
    return BodyMesh(
        mesh,
        _find_facets(mesh, surface),
        count,
        _of_cells(mesh, regions),
        arrays.deviation,
        refinements=part.refinements,
        beyond=part.beyond,
    )


def _narrow(regions: IntArray | None) -> IntArray | None:
    """Return region numbers in the fewest bytes: each rank receives those of the whole mesh."""
    return None if regions is None else regions.astype(np.min_scalar_type(int(regions.max(initial=0))))


def _of_cells(mesh: Any, regions: IntArray | None) -> Int32Array | None:
    """Return the region of each local cell, from those of cells as they were numbered before."""
    return None if regions is None else regions[compat.original_cells(mesh)].astype(np.int32)


def exterior_facets(mesh: Any) -> tuple[Int32Array, IntArray]:
    """Return the local facets of the boundary of a mesh, and the input numbers of their corners, sorted."""
    topology = mesh.topology
    tdim = topology.dim
    for dims in ((tdim - 1, tdim), (tdim - 1, 0), (tdim, 0)):
        topology.create_connectivity(*dims)
    exterior = np.asarray(dolfinx.mesh.exterior_facet_indices(topology), dtype=np.int32)
    node_of_vertex = np.empty(topology.index_map(0).size_local + topology.index_map(0).num_ghosts, dtype=np.int64)
    vertices = topology.connectivity(tdim, 0).array
    node_of_vertex[vertices] = compat.geometry_dofs(mesh)[:, : tdim + 1].reshape(-1)
    input_number = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)[node_of_vertex]
    corners = topology.connectivity(tdim - 1, 0).array.reshape(-1, tdim)[exterior]
    return exterior, np.sort(input_number[corners], axis=1)


def _find_facets(mesh: Any, surface: dict[str, IntArray]) -> dict[str, Int32Array]:
    """Find the local facets of each group of triangles, given by the input numbers of their corners."""
    exterior, local = exterior_facets(mesh)
    # Boundary points are renumbered: three of their numbers then fit into one integer.
    boundary = np.unique(np.concatenate([triangles.reshape(-1) for triangles in surface.values()]))
    base = len(boundary)
    local_keys = _keys(np.searchsorted(boundary, local), base)
    return {
        name: exterior[np.isin(local_keys, _keys(np.searchsorted(boundary, np.sort(triangles, axis=1)), base))]
        for name, triangles in surface.items()
    }


def _keys(triples: IntArray, base: int) -> IntArray:
    return (triples[:, 0] * base + triples[:, 1]) * base + triples[:, 2]
