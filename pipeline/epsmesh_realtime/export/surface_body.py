"""The meshed body of a model, with the point forces for which its deforming surface is tabulated."""

from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from epsmesh.arrays import FloatArray
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.loads import terms_of
from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.shell import Shell
from epsmesh.solve.far_field import PointForce
from epsmesh_realtime.export.compliance import coarse_mesh, law_of
from epsmesh_realtime.export.far import LoadedBody
from epsmesh_realtime.export.placed_force import PlacedForce
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.region import Region, curved_region, surface_case
from epsmesh_realtime.export.scope import ExportError, Scope
from epsmesh_realtime.model import Model

# Distances from a force, in units of the study's radius, within which its loads are omitted, and R is not tested.
_BLUNT, _NEXT = 0.1, 0.5
# A node is on a flat face if its distance, in units of the thickness, is at most this.
_ON_FACE = 1e-9
# Error of R by such a mesh, in units of the inverse room: on meshes 0.6 times as fine R differs by 0.0009, and from the
# displacement next to full solves of discs by up to 0.0043, in which these have their part.
_DOUBT = 0.003
# No part of a body may be above its region: largest cosine of the angle to the normal.
_STRAIGHT_ABOVE = 0.9
# Points of the surface of an ellipsoid.
_POINTS = 500


def surface_body(scope: Scope, model: Model, margin: float, ranks: Ranks = ALONE) -> LoadedBody:
    """Return the body of a model, along the model's axes, with the forces on its face; collective.

    Raises:
        ExportError: if part of it is above its own region.
        MeshError: if it cannot be meshed.
    """
    law = partial(law_of, scope)
    if isinstance(scope.body, Layered):
        region = Region.of(scope.body, margin)

        def on_plane(place: tuple[float, float], poisson: float) -> PointForce:
            return PointForce(poisson, (*place, 0.0), region.room(*place))

        off = _ON_FACE * region.thickness
        mesh, terms = coarse_mesh(scope.case, region, ranks=ranks), terms_of(scope.case)
        return LoadedBody(mesh, region, on_plane, law, off=off, ranks=ranks, terms=terms)
    return _curved(scope, model, ranks)


def inclusions(body: Body, model: Model) -> tuple[NDArray[np.float32], NDArray[np.int32]] | None:
    """Return points (n, 3), in m from the face's middle along its axes, and triangles of the surfaces of inclusions."""
    points, triangles, count = [], [], 0
    for piece in body.embedded:
        surface = piece.surface
        if isinstance(surface, Shell):
            places, facets = surface.triangles.points, surface.triangles.facets
        else:
            places = surface.sample(_POINTS)
            facets = ConvexHull(places).simplices
        points.append((places - model.origin) @ model.axes.T)
        triangles.append(facets + count)
        count += len(places)
    if not points:
        return None
    return np.vstack(points).astype(np.float32), np.vstack(triangles).astype(np.int32)


def _curved(scope: Scope, model: Model, ranks: Ranks) -> LoadedBody:
    radius = scope.case.probe.circumradius
    region = curved_region(scope, model.thickness, model.table.reach[0])
    origin = model.axes @ model.origin

    def on_face(place: tuple[float, float], poisson: float) -> PlacedForce:
        spot = model.spot(*place)
        x, y, z = np.add(origin, [*place, spot.height]).tolist()
        first, second, third = ((float(a), float(b), float(c)) for a, b, c in spot.turn)
        return PlacedForce(poisson, (x, y, z), region.room(*place), (first, second, third), _BLUNT * radius)

    mesh = _mesh(scope, region, model.axes, ranks)
    points = np.asarray(mesh.mesh.geometry.x)
    corners = [(x * region.reach[0], y * region.reach[1]) for x in (-0.7, 0.0, 0.7) for y in (-0.7, 0.0, 0.7)]
    if max(on_face(place, scope.poisson).above(points) for place in corners) > _STRAIGHT_ABOVE:
        raise ExportError("part of the body is above the model's region, where its displacement cannot be tabulated")
    law, terms = partial(law_of, scope), terms_of(scope.case)
    return LoadedBody(mesh, region, on_face, law, _NEXT * radius, model.off, _DOUBT, ranks, terms)


def _mesh(scope: Scope, region: Region, axes: FloatArray, ranks: Ranks) -> BodyMesh:
    """Return the mesh with its points along the model's ``axes``."""
    arrays = ranks.on_first(lambda: mesh_arrays(surface_case(scope.case, region), ()))
    return distribute(MPI.COMM_SELF, replace(arrays, points=arrays.points @ axes.T))
