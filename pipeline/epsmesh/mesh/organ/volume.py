"""Tetrahedra on both sides of the surfaces that divide a body into regions; the surfaces remain unchanged."""

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.compat import gmsh_session
from epsmesh.mesh.generate import MeshError, model_options
from epsmesh.mesh.model_arrays import corners_of, numbered_points
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.sheet import TangledError
from epsmesh.mesh.reason import generate, reason
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.triangles import Triangles, enclosed, half_edges
from epsmesh.stages import stage

# Cells below this quality are optimised. With gmsh's default, 0.3, flat cells may remain that have all four corners in
# the surface; their curved edges then fold them.
_OPTIMISED = 0.5
_TRIANGLE = 2
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
    points, cells, numbers = [surfaces.points], [], []
    for region in surfaces.regions.tolist():
        # Each by itself: gmsh may mix up the sides of surfaces that meet along curves.
        for shells in _pieces(surfaces.points, surfaces.boundary(region)):
            on_it, around = np.unique(np.vstack(shells), return_inverse=True)
            ends = np.cumsum([len(shell) for shell in shells])[:-1]
            found, corners = _fill(surfaces.points[on_it], np.split(around.reshape(-1, 3), ends), scale, field)
            inner = sum(map(len, points)) + np.arange(len(found) - len(on_it))
            points.append(found[len(on_it) :])
            cells.append(np.concatenate([on_it, inner])[corners])
            numbers.append(np.full(len(corners), region))
    return np.vstack(points), np.vstack(cells), np.concatenate(numbers) if len(surfaces.regions) > 1 else None


def _fill(points: FloatArray, shells: list[IntArray], scale: float, field: Field) -> tuple[FloatArray, IntArray]:
    """Return the points of a mesh in the first shell and outside of the others, given ones first, and its cells."""
    scaled = points / scale
    with gmsh_session():
        model_options()
        model = gmsh.model
        skins = []
        for facets in shells:
            skins.append(model.addDiscreteEntity(2))
            own = np.unique(facets)
            model.mesh.addNodes(2, skins[-1], own + 1, scaled[own].ravel())
            model.mesh.addElementsByType(skins[-1], _TRIANGLE, [], (facets + 1).ravel())
        volume = model.geo.addVolume([model.geo.addSurfaceLoop(skins)])
        model.geo.synchronize()
        field.set(scale, model.geo)
        gmsh.option.setNumber("Mesh.OptimizeThreshold", _OPTIMISED)
        try:
            generate(3)
        except Exception as error:  # gmsh raises bare Exception
            raise _named(f"gmsh: {reason(error)}", scale) from error
        place, position = numbered_points()
        cells = position[corners_of(3, [volume])]
        if not len(cells):
            raise MeshError("gmsh made no tetrahedra of the surface")
    points, cells = _first(points, scaled, place * scale, place, cells)
    corners = points[cells]
    filled = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    if not np.isclose(filled, enclosed(points, np.vstack(shells)), rtol=_SAME, atol=0):
        raise MeshError("gmsh did not fill the surface of a region: it meets another one; use a smaller `fine`")
    return points, cells


def _pieces(points: FloatArray, facets: IntArray) -> list[list[IntArray]]:
    """Return the facets of each piece of a region: those of its outer surface, then those of each cavity in it."""
    ends = half_edges(facets).T
    count = len(points)
    _, shell = connected_components(coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(count, count)), False)
    shells = [facets[shell[facets[:, 0]] == part] for part in np.unique(shell[facets[:, 0]])]
    if len(shells) == 1:
        return [shells]
    volumes = [enclosed(points, part) for part in shells]
    pieces = [[part] for part, volume in zip(shells, volumes, strict=True) if volume > 0]
    pieces.sort(key=lambda piece: enclosed(points, piece[0]))
    for part in (part for part, volume in zip(shells, volumes, strict=True) if volume <= 0):
        around = (
            piece for piece in pieces if Skin(Triangles(points.copy(), piece[0])).depth(points[part[:1, 0]])[0] > 0
        )
        next(around, pieces[-1]).append(part)
    return pieces


def _named(words: str, scale: float) -> MeshError:
    """Return the error for a failure of gmsh, with the places (m) of the nodes that it names, if any."""
    nodes = gmsh.model.mesh.getLastNodeError()
    if not len(nodes):
        return MeshError(words)
    places = scale * np.array([gmsh.model.mesh.getNode(node)[0] for node in nodes])
    return TangledError(places, np.zeros(len(places)), words)


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
    left = np.setdiff1d(np.arange(len(points)), number[used & is_given])
    if len(left):
        raise TangledError(points[left], np.zeros(len(left)), "gmsh changed the surface that it was given")
    return np.vstack([points, found[inner]]), number[cells]


def _rows(points: FloatArray) -> np.ndarray:
    """Return points as values that can be compared and sorted, bit by bit."""
    return np.ascontiguousarray(points + 0.0).view([("", float)] * 3).ravel()
