"""A slit in the geometry kernel: the part of its faces that the blade touches, and the rest."""

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Frame, Units
from epsmesh.shapes.slit import Slit

Tag = tuple[int, int]

# A direction is a plane's normal within this tolerance.
_SAME = 1e-9


def draw_slit(slit: Slit, frame: Frame, units: Units, far: float) -> tuple[list[Tag], list[Tag]]:
    """Add the faces of a slit to gmsh's current model, out to ``far`` (m): those that the blade touches, and others."""
    touched = [_polygon(frame.world(slit.touched()), units)]
    return touched, [_polygon(frame.world(piece), units) for piece in slit.free(far)]


def draw_plane(frame: Frame, units: Units, far: float) -> Tag:
    """Add the plane of a slit, out to ``far`` (m): it divides the body into two connected pieces."""
    corners = np.array([(i * far, 0.0, k * far) for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return _polygon(frame.world(corners), units)


def mirror_of(frame: Frame, mirrors: tuple[str, ...]) -> str | None:
    """Return the plane of symmetry, bounding the model, that contains the slit; None for a slit inside the model."""
    across = np.abs(np.array(frame.across))
    return next((plane for plane in mirrors if across["xy".index(plane)] > 1 - _SAME), None)


def singular_curves(slit: Slit, frame: Frame, faces: list[int], scale: float) -> list[int]:
    """Return the curves around ``faces`` of a slit at its front or at the edge of contact; the unit is ``scale`` m."""
    curves = {abs(tag) for _, tag in gmsh.model.getBoundary([(2, f) for f in faces], combined=False, oriented=False)}
    return [curve for curve in sorted(curves) if slit.is_singular(frame.local(scale * sample_curve(curve)))]


def sample_curve(curve: int) -> FloatArray:
    """Return both ends of a curve and a point between, (3, 3), in the model's units."""
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
    points = gmsh.model.getValue(1, curve, [start, (start + end) / 2, end])
    return np.array(points).reshape(-1, 3)


def _polygon(corners: FloatArray, units: Units) -> Tag:
    occ = gmsh.model.occ
    points = [occ.addPoint(*map(units, map(float, corner))) for corner in corners]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    return 2, int(occ.addPlaneSurface([occ.addCurveLoop(lines)]))
