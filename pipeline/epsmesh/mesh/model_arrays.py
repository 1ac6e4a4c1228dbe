"""Nodes and elements of gmsh's current model, as arrays."""

from collections.abc import Iterable

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray, IntArray


def corners_of(dim: int, entities: Iterable[int]) -> IntArray:
    """Return the node tags (n, dim + 1) of the elements of entities of a dimension, which have straight edges."""
    parts = [part for tag in entities for part in gmsh.model.mesh.getElements(dim, tag)[2]]
    nodes = np.concatenate([np.empty(0, dtype=np.int64), *(np.asarray(part, dtype=np.int64) for part in parts)])
    return nodes.reshape(-1, dim + 1)


def points_by_tag() -> FloatArray:
    """Return the points (n, 3) of the nodes, in the model's unit, at their tags."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = np.zeros((int(tags.max()) + 1, 3))
    points[np.asarray(tags, dtype=np.int64)] = coordinates.reshape(-1, 3)
    return points


def numbered_points() -> tuple[FloatArray, IntArray]:
    """Return the points (n, 3), in the model's unit, in the order of their tags, and the number of each tag, or -1."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    position = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    position[tags[order]] = np.arange(len(tags))
    return coordinates.reshape(-1, 3)[order], position
