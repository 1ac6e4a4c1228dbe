"""Footprint on a curved or inclined surface: the part that projects along the probe's axis into its outline."""

from dataclasses import replace
from math import inf
from typing import Any

import gmsh
import numpy as np

from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import outline_points
from epsmesh.shapes.frame import Frame, Units
from epsmesh.shapes.probe import Probe

Entity = tuple[int, int]

# The tube extends by this share of the footprint's radius above and below the part that it cuts out.
_BEYOND = 0.25


def cut_out(body: Body, probe: Probe, frame: Frame, units: Units, volumes: list[Entity], skip: Any) -> list[Entity]:
    """Add the pieces of the volumes' faces that the tube along the probe's axis cuts out, as new faces.

    The tube is the footprint extruded along the axis. Faces for which ``skip`` returns true are not part of the body's
    surface.
    """
    occ = gmsh.model.occ
    occ.synchronize()
    low, high = _span(body, probe, frame)
    (ax, ay, az), (px, py, pz) = frame.axis, frame.point
    start = replace(frame, point=(px - low * ax, py - low * ay, pz - low * az))
    base = probe.draw(occ, start, units)
    drawn = occ.extrude([(2, base)], *(units((high - low) * o) for o in frame.outward))
    tube = [entity for entity in drawn if entity[0] == 3]
    faces = [face for face in gmsh.model.getBoundary(volumes, oriented=False) if not skip(face[1])]
    pieces, _ = occ.intersect(faces, tube, removeObject=False, removeTool=True)
    occ.synchronize()
    return _connected(pieces, [units(c) for c in frame.point])


def _span(body: Body, probe: Probe, frame: Frame) -> tuple[float, float]:
    """Return the heights (m), against the axis, of both ends of the tube."""
    rim = outline_points(probe)
    points, _ = body.lift(frame, np.concatenate([share * rim for share in (0.0, 0.25, 0.5, 0.75, 1.0)]))
    heights = frame.local(points)[:, 2]
    beyond = _BEYOND * probe.circumradius
    return float(np.nanmin(heights)) - beyond, float(np.nanmax(heights)) + beyond


def _connected(pieces: list[Entity], point: list[float]) -> list[Entity]:
    """Return the pieces connected to the one nearest to a point, in the model's units."""
    edges = {piece: {tag for _, tag in gmsh.model.getBoundary([piece], oriented=False)} for piece in pieces}
    if not pieces:
        return []
    found = [min(pieces, key=lambda piece: _distance(piece, point))]
    for piece in found:
        found += [other for other in pieces if other not in found and edges[other] & edges[piece]]
    return found


def _distance(face: Entity, point: list[float]) -> float:
    """Return an approximate distance from a point to a face: to the nearest of many points on it."""
    (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(*face)
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(u0, u1, 9), np.linspace(v0, v1, 9)))
    at = np.array(gmsh.model.getValue(*face, np.column_stack([u, v]).ravel().tolist())).reshape(-1, 3)
    return float(np.linalg.norm(at - np.array(point), axis=1).min(initial=inf))
