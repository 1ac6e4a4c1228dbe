"""Tetrahedra on both sides of the surfaces that divide a body into regions; the surfaces remain unchanged."""

from dataclasses import replace

import gmsh
import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.compat import gmsh_session
from pipeline.mesh.generate import MeshError, model_options
from pipeline.mesh.organ.field import Field
from pipeline.mesh.organ.untangle import TangledError
from pipeline.mesh.reason import reason
from pipeline.shapes.complex import Complex
from pipeline.stages import stage

# Cells below this quality are optimised. With gmsh's default, 0.3, flat cells may remain that have all four corners in
# the surface; their curved edges then fold them.
_OPTIMISED = 0.5
_TRIANGLE, _TETRAHEDRON = 2, 4
MODEL_SIZE = 100.0  # extent of the model, in its unit
# Relative tolerance on the volume of tetrahedra against that of their surface.
_SAME = 1e-9


@stage("gmsh")
def fill(surfaces: Complex, field: Field) -> tuple[FloatArray, IntArray, IntArray | None]:
    """Return the points (n, 3) and cells (m, 4) of a mesh, and the region number (m) of each cell.

    The first points are those of the ``surfaces``, whose facets are facets of cells. Region numbers are None if there
    is one region.

    Raises:
        MeshError: with gmsh's own message, if it fails, or if the cells of a region do not fill it.
    """
    scale = float(np.ptp(surfaces.points, axis=0).max()) / MODEL_SIZE
    scaled = surfaces.points / scale
    with gmsh_session():
        model_options()
        model = gmsh.model
        volumes = _add_volumes(replace(surfaces, points=scaled))
        field.set(scale, model.geo)
        gmsh.option.setNumber("Mesh.OptimizeThreshold", _OPTIMISED)
        try:
            model.mesh.generate(3)
        except Exception as error:  # gmsh raises bare Exception
            raise _named(f"gmsh: {reason(error)}", scale) from error
        found, coordinates, _ = model.mesh.getNodes()
        parts = [model.mesh.getElementsByType(_TETRAHEDRON, volume)[1] for volume in volumes]
        if not all(map(len, parts)):
            raise MeshError("gmsh made no tetrahedra of the surface")
        order = np.argsort(found)
        place = coordinates.reshape(-1, 3)[order]
        cells = np.searchsorted(found[order], np.concatenate(parts)).reshape(-1, 4)
    points, cells = _first(surfaces.points, scaled, place * scale, place, cells)
    if len(parts) == 1:
        return points, cells, None
    numbers = np.repeat(surfaces.regions, [len(part) // 4 for part in parts])
    _check_filled(points, cells, numbers, surfaces)
    return points, cells, numbers


def _add_volumes(surfaces: Complex) -> list[int]:
    """Add the regions to the model: one discrete surface for each pair of regions, with common points at junctions."""
    model, skins = gmsh.model, []
    walls, wall = surfaces.walls()
    # A point belongs to the first wall that it is in.
    owner = np.empty(len(surfaces.points), dtype=np.int64)
    for number in reversed(range(len(walls))):
        owner[surfaces.facets[wall == number]] = number
    for number in range(len(walls)):
        skin = model.addDiscreteEntity(2)
        mine = np.flatnonzero(owner == number)
        model.mesh.addNodes(2, skin, mine + 1, surfaces.points[mine].ravel())
        skins.append(skin)
    for number, skin in enumerate(skins):
        model.mesh.addElementsByType(skin, _TRIANGLE, [], (surfaces.facets[wall == number] + 1).ravel())
    around = [np.flatnonzero((walls == region).any(axis=1)) for region in surfaces.regions]
    volumes = [model.geo.addVolume([model.geo.addSurfaceLoop([skins[k] for k in beside])]) for beside in around]
    model.geo.synchronize()
    return volumes


def _named(words: str, scale: float) -> MeshError:
    """Return the error for a failure of gmsh, with the places (m) of the nodes that it names, if any."""
    nodes = gmsh.model.mesh.getLastNodeError()
    if not len(nodes):
        return MeshError(words)
    places = scale * np.array([gmsh.model.mesh.getNode(node)[0] for node in nodes])
    return TangledError(places, np.zeros(len(places)), words)


def _check_filled(points: FloatArray, cells: IntArray, numbers: IntArray, surfaces: Complex) -> None:
    """Check that the tetrahedra of each region fill it."""
    corners = points[cells]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    filled = np.bincount(numbers, volumes)[surfaces.regions]
    wanted = [surfaces.volume(region) for region in surfaces.regions]
    if not np.allclose(filled, wanted, rtol=_SAME, atol=0):
        raise MeshError("gmsh did not fill the surface of a region: it meets another one; use a smaller `fine`")


def _first(
    points: FloatArray, scaled: FloatArray, found: FloatArray, place: FloatArray, cells: IntArray
) -> tuple[FloatArray, IntArray]:
    """Number the points of the surface as they were given, then the others."""
    used = np.zeros(len(place), dtype=bool)
    used[cells] = True
    given = _rows(scaled)
    order = np.argsort(given, kind="stable")
    at = np.searchsorted(given[order], _rows(place))
    at = np.minimum(at, len(given) - 1)
    is_given = given[order][at] == _rows(place)
    number = np.full(len(place), -1, dtype=np.int64)
    number[is_given] = order[at[is_given]]
    inner = used & ~is_given
    number[inner] = len(points) + np.arange(inner.sum())
    if len(np.unique(number[used & is_given])) != len(points):
        raise MeshError("gmsh changed the surface that it was given")
    return np.vstack([points, found[inner]]), number[cells]


def _rows(points: FloatArray) -> np.ndarray:
    """Return points as values that can be compared and sorted, bit by bit."""
    return np.ascontiguousarray(points + 0.0).view([("", float)] * 3).ravel()
