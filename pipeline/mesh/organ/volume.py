"""Tetrahedra within a closed surface of triangles, and on both sides of surfaces inside it, all unchanged."""

from collections.abc import Sequence

import gmsh
import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.compat import gmsh_session
from pipeline.mesh.generate import MeshError, model_options
from pipeline.mesh.organ.field import Field
from pipeline.mesh.organ.untangle import TangledError
from pipeline.mesh.reason import reason
from pipeline.shapes.triangles import enclosed
from pipeline.stages import stage

# Cells below this quality are optimised. With gmsh's default, 0.3, flat cells may remain that have all four corners in
# the surface; their curved edges then fold them.
_OPTIMISED = 0.5
_TRIANGLE, _TETRAHEDRON = 2, 4
MODEL_SIZE = 100.0  # extent of the model, in its unit
# Relative tolerance on the volume of tetrahedra against that of their surface.
_SAME = 1e-9

Surface = tuple[FloatArray, IntArray]


@stage("gmsh")
def fill(
    points: FloatArray, facets: IntArray, field: Field, inner: Sequence[Surface] = ()
) -> tuple[FloatArray, IntArray, IntArray | None]:
    """Return the points (n, 3) and cells (m, 4) of a mesh, and the number (m) of the surface around each cell.

    The first points, and the boundary, are those given; then come the ``inner`` surfaces, points and facets of each,
    which are closed and do not touch each other. Surface numbers count these from 1, and are 0 outside of them; they
    are None without inner surfaces.

    Raises:
        MeshError: with gmsh's own message, if it fails.
    """
    scale = float(np.ptp(points, axis=0).max()) / MODEL_SIZE
    surfaces = [(points, facets), *inner]
    given = np.vstack([corners for corners, _ in surfaces])
    scaled = given / scale
    with gmsh_session():
        model_options()
        model = gmsh.model
        volumes = _add_volumes([(corners / scale, triangles) for corners, triangles in surfaces])
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
    points, cells = _first(given, scaled, place * scale, place, cells)
    if not inner:
        return points, cells, None
    numbers = np.repeat(np.arange(len(parts)), [len(part) // 4 for part in parts])
    _check_filled(points, cells, numbers, inner)
    return points, cells, numbers


def _add_volumes(surfaces: Sequence[Surface]) -> list[int]:
    """Add to the model the volume between the first surface and the others, and that inside each of the others."""
    model, skins, first = gmsh.model, [], 1
    for points, facets in surfaces:
        skin = model.addDiscreteEntity(2)
        model.mesh.addNodes(2, skin, np.arange(first, first + len(points)), points.ravel())
        model.mesh.addElementsByType(skin, _TRIANGLE, [], (facets + first).ravel())
        skins.append(skin)
        first += len(points)
    loops = [model.geo.addSurfaceLoop([skin]) for skin in skins]
    volumes = [model.geo.addVolume(loops), *(model.geo.addVolume([loop]) for loop in loops[1:])]
    model.geo.synchronize()
    return volumes


def _named(words: str, scale: float) -> MeshError:
    """Return the error for a failure of gmsh, with the places (m) of the nodes that it names, if any."""
    nodes = gmsh.model.mesh.getLastNodeError()
    if not len(nodes):
        return MeshError(words)
    places = scale * np.array([gmsh.model.mesh.getNode(node)[0] for node in nodes])
    return TangledError(places, np.zeros(len(places)), words)


def _check_filled(points: FloatArray, cells: IntArray, numbers: IntArray, inner: Sequence[Surface]) -> None:
    """Check that the tetrahedra with the number of an ``inner`` surface fill its volume."""
    corners = points[cells]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    filled = np.bincount(numbers, volumes)[1:]
    wanted = np.array([abs(enclosed(*surface)) for surface in inner])
    if not np.allclose(filled, wanted, rtol=_SAME, atol=0):
        raise MeshError("gmsh did not fill the surface of an inclusion: it meets another one; use a smaller `fine`")


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
