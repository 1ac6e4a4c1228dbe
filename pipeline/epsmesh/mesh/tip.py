"""A tool that deforms in a mesh: it gets nodes of its own where it may touch tissue, and its true surface."""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import EDGES, folded_cells
from epsmesh.mesh.generate import MeshArrays, MeshError
from epsmesh.scene.model import FLANK, PROBE, TOOL, Scene
from epsmesh.shapes.triangles import edge_keys

# A triangle is above the surface within this share of the body's extent.
_CLOSE = 1e-6


def part_tool(mesh: MeshArrays, scene: Scene) -> MeshArrays:
    """Return ``mesh``, of ten nodes per cell, with the tool parted from the tissue, and with its true shape.

    Its nodes on the surface stay above those of the tissue, along the axis.

    Raises:
        MeshError: if a cell folds.
    """
    tip, frame, count = scene.probe.tip_shape, scene.frame, len(mesh.points)
    assert tip is not None
    assert mesh.regions is not None
    of_tool = mesh.regions == 1 + len(scene.body.regions)
    doubled = _within(mesh, mesh.facets[PROBE])
    twin = np.where(doubled, count + np.cumsum(doubled) - 1, np.arange(count))
    cells = np.where(of_tool[:, None], twin[mesh.cells], mesh.cells)
    above = {name: _is_above(mesh, scene, facets) for name, facets in mesh.facets.items()}
    facets = {name: np.where(above[name][:, None], twin[own], own) for name, own in mesh.facets.items()}
    parted = replace(mesh, points=np.vstack([mesh.points, mesh.points[doubled]]), cells=cells)
    used, face = np.unique(cells[of_tool]), twin[doubled]
    local = tip.bulged(frame.local(parted.points[used]))
    flank = facets[FLANK][~tip.ends_at(frame.local(parted.points[facets[FLANK]].mean(axis=1)))]
    side = np.isin(used, np.setdiff1d(_nodes(parted, flank), face))
    off = tip.distance(local[side])
    local[side] -= off.gap[:, None] * off.normal
    points = parted.points.copy()
    points[used] = frame.world(local)
    points = _unfolded(points, cells[of_tool], face)
    return replace(parted, points=points, facets=facets | {TOOL: twin[mesh.facets[PROBE]]})


def _unfolded(points: FloatArray, cells: IntArray, face: IntArray) -> FloatArray:
    """Return ``points`` with straight edges where ``cells`` (m, 10) fold, but for nodes of the ``face``.

    Raises:
        MeshError: if one still folds.
    """
    folded = cells[folded_cells(points[cells])]
    points = points.copy()
    for number, ends in enumerate(EDGES, start=4):
        middle = folded[:, number]
        is_free = ~np.isin(middle, face)
        points[middle[is_free]] = points[folded[is_free][:, ends]].mean(axis=1)
    if count := int(folded_cells(points[cells]).sum()):
        raise MeshError(f"{count} elements of the tool fold: use a smaller `rim` or `fine`, or a smaller depth")
    return points


def _is_above(mesh: MeshArrays, scene: Scene, facets: IntArray) -> BoolArray:
    """Return which triangles (k, 3) are above the surface on which the tool is."""
    heights = scene.frame.local(mesh.points[facets].mean(axis=1))[:, 2]
    return np.asarray(heights > _CLOSE * scene.body.extent)


def _within(mesh: MeshArrays, facets: IntArray) -> BoolArray:
    """Return a mask of the nodes on triangles (k, 3): corners, and mid nodes of their edges."""
    found = np.zeros(len(mesh.points), dtype=bool)
    found[_nodes(mesh, facets)] = True
    return found


def _nodes(mesh: MeshArrays, facets: IntArray) -> IntArray:
    """Return the nodes on triangles (k, 3): corners, and mid nodes of their edges."""
    keys = edge_keys(facets, len(mesh.points))
    found = [facets.ravel()]
    for number, ends in enumerate(EDGES, start=4):
        low, high = np.sort(mesh.cells[:, ends], axis=1).T
        found.append(mesh.cells[np.isin(low * len(mesh.points) + high, keys), number])
    return np.unique(np.concatenate(found))
