"""Tetrahedra within a closed surface of triangles, which stay as they are."""

import gmsh
import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.compat import gmsh_session
from pipeline.mesh.generate import MeshError, model_options
from pipeline.mesh.organ.field import Field
from pipeline.stages import stage

_SIZE = 100.0  # extent of the model, in its unit
# Cells below this quality are mended; below gmsh's own 0.3, flat ones may stay that lie in the surface with all four
# corners, and whose curved edges then fold them.
_OPTIMISED = 0.5
_TRIANGLE, _TETRAHEDRON = 2, 4


@stage("gmsh")
def fill(points: FloatArray, facets: IntArray, field: Field) -> tuple[FloatArray, IntArray]:
    """Return the points (n, 3) and cells (m, 4) of a mesh whose first points, and boundary, are those given.

    Raises:
        MeshError: with gmsh's own words, if it fails.
    """
    scale = float(np.ptp(points, axis=0).max()) / _SIZE
    scaled = points / scale
    with gmsh_session():
        model_options()
        model = gmsh.model
        skin = model.addDiscreteEntity(2)
        tags = np.arange(1, len(points) + 1)
        model.mesh.addNodes(2, skin, tags, scaled.ravel())
        model.mesh.addElementsByType(skin, _TRIANGLE, [], (facets + 1).ravel())
        volume = model.geo.addVolume([model.geo.addSurfaceLoop([skin])])
        model.geo.synchronize()
        _set_field(field, scale)
        gmsh.option.setNumber("Mesh.OptimizeThreshold", _OPTIMISED)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", bool(field.narrow))
        try:
            model.mesh.generate(3)
        except Exception as error:  # gmsh raises bare Exception
            raise MeshError(f"gmsh: {error or gmsh.logger.getLastError()}") from error
        found, coordinates, _ = model.mesh.getNodes()
        cells = model.mesh.getElementsByType(_TETRAHEDRON, volume)[1]
        if not len(cells):
            raise MeshError("gmsh made no tetrahedra of the surface")
        order = np.argsort(found)
        place = coordinates.reshape(-1, 3)[order]
        cells = np.searchsorted(found[order], cells).reshape(-1, 4)
    return _first(points, scaled, place * scale, place, cells)


def _set_field(field: Field, scale: float) -> None:
    """Make ``field`` gmsh's background field: distances are those from points along the footprint's edge."""
    model = gmsh.model
    points = [model.geo.addPoint(*p) for p in (field.edge / scale).tolist()]
    model.geo.synchronize()
    distance = model.mesh.field.add("Distance")
    model.mesh.field.setNumbers(distance, "NodesList", points)
    tags = []
    for term in field.terms(f"F{distance}", scale):
        tags.append(model.mesh.field.add("MathEval"))
        model.mesh.field.setString(tags[-1], "F", term)
    smallest = model.mesh.field.add("Min")
    model.mesh.field.setNumbers(smallest, "FieldsList", tags)
    model.mesh.field.setAsBackgroundMesh(smallest)


def _first(
    points: FloatArray, scaled: FloatArray, found: FloatArray, place: FloatArray, cells: IntArray
) -> tuple[FloatArray, IntArray]:
    """Number the points of the surface as they were given, whatever gmsh made of them, then the others."""
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
