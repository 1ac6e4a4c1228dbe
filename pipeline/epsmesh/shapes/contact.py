"""Checks of the surface below a footprint, from where lines along the probe's axis meet it.

The footprint is the part of the surface that projects along the axis into the probe's outline. It must be one smooth
piece.
"""

from functools import lru_cache
from math import hypot, inf, isfinite, radians, tan

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import MOST_INCLINED, Frame, PlaceError, Vector, angle_between
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm

# Largest angle (degrees) between normals under a footprint and the one at the axis: a probe that bends tissue around
# more of a body touches it with its side, too.
MOST_TURNED = 45.0
# Sampling points along the outline, and scales of the smaller outlines inside.
_ALONG = 240
_WITHIN = (0.0, 0.25, 0.5, 0.75, 0.9)
# Neighbouring points differ in height by less than this, in units of their distance times the steepest allowed slope;
# otherwise the surface has a fold.
_FOLD = 2.0
# With unilateral contact the first touch must be within this share of the region that is searched.
_WELL_WITHIN = 0.7
# How much sooner the contact of a tilted cone reaches the edge of that region than a ball's: from 15 solved scenes.
_LONGER = 1.5
# Search for the first touch: scales of smaller outlines, then a grid around the best point with shrinking steps.
_RINGS = tuple(i / 12 for i in range(13))
_AROUND = np.array([(i, j) for i in range(-2, 3) for j in range(-2, 3)], dtype=float)
_CLOSER = 0.6
_MANY = 256
# Cases of a map, each of which is asked often how its tool touches.
_OF_A_MAP = 1 << 14
# A surface counts as plane within this distance, in units of the footprint.
_FLAT = 1e-9
# Angle (degrees) between a tool's axis and the surface's normal below which a normal force is one along the axis: the
# axial force differs by 1/cos - 1 < 4e-5, and the lateral one is less than 1 % of it. Facets of an organ turn as much.
UPRIGHT = 2.0
# Curvature times the footprint's radius below which it is rounding.
_LEAST_BENT = 1e-6


def outline_points(probe: Probe) -> FloatArray:
    """Return about ``_ALONG`` points (n, 2), in m, along a footprint's outline, corners included; not closed."""
    line = probe.outline()
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    if len(line) > _ALONG:
        along = np.concatenate([[0.0], np.cumsum(lengths)])
        at = np.linspace(0.0, along[-1], _ALONG + 1)[:-1]
        return np.column_stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)])
    pieces = np.maximum(1, np.rint(_ALONG * lengths / lengths.sum())).astype(int)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = number * np.repeat(1 / pieces, pieces)
    return np.asarray(
        np.repeat(line[:-1], pieces, axis=0) + share[:, None] * np.repeat(np.diff(line, axis=0), pieces, axis=0)
    )


def lifted_edge(body: Body, probe: Probe, frame: Frame) -> FloatArray:
    """Return points (n, 3), in m, of the edge of a footprint on the body; NaN where it misses the body."""
    return body.lift(frame, outline_points(probe))[0]


def edge_gap(body: Body, probe: Probe, frame: Frame) -> float:
    """Return the distance (m) from a footprint to the edge of its face, negative if it reaches over the edge."""
    if body.gap(frame.point) == inf:
        return inf
    return min(body.gap((float(x), float(y), float(z))) for x, y, z in lifted_edge(body, probe, frame))


def is_level(body: Body, frame: Frame) -> bool:
    """Return whether the probe presses straight down on a plane face with edges."""
    return frame.is_upright and isfinite(body.gap(frame.point))


def is_flat(body: Body, probe: Probe, frame: Frame) -> bool:
    """Return whether the probe is at right angles to a plane piece of the surface."""
    if is_level(body, frame):
        return True
    if frame.axis != frame.normal:
        return False
    rim = outline_points(probe)
    points, _ = body.lift(frame, np.concatenate([rim, *(share * rim for share in _WITHIN)]))
    heights = frame.local(points)[:, 2]
    return bool(np.all(np.abs(heights) < _FLAT * probe.circumradius))


@lru_cache(_MANY)
def curvature_below(body: Body, probe: Probe, frame: Frame) -> float:
    """Return the mean curvature (1/m) of the surface below a footprint, positive on a dome; exactly 0 on a plane.

    It is that of a paraboloid fitted to the surface within three quarters of the footprint.
    """
    if is_level(body, frame):
        return 0.0
    rim = outline_points(probe)
    points, _ = body.lift(frame, np.concatenate([share * rim for share in _WITHIN[:-1]]))
    found = paraboloid(frame.local(points[np.isfinite(points).all(axis=1)]))
    return found if abs(found) * probe.circumradius > _LEAST_BENT else 0.0


def paraboloid(points: FloatArray) -> float:
    """Return the mean curvature (1/m) at the apex of a paraboloid fitted to points (n, 3), in m."""
    x, y, z = points.T
    terms = np.column_stack([np.ones_like(x), x, y, x**2 / 2, x * y, y**2 / 2])
    _, *slope, xx, xy, yy = np.linalg.lstsq(terms, z, rcond=None)[0].tolist()
    return mean_curvature(np.array(slope), np.array([[xx, xy], [xy, yy]]))


def mean_curvature(slope: FloatArray, second: FloatArray) -> float:
    """Return the mean curvature (1/m), positive on a dome, from a height's derivatives (2,) and (2, 2), in 1/m."""
    metric = np.eye(2) + np.outer(slope, slope)
    return float(-0.5 * np.trace(np.linalg.solve(metric, second)) / np.sqrt(1 + np.dot(slope, slope)))


def check_contact(body: Body, probe: Probe, frame: Frame) -> None:
    """Check that a footprint is on one smooth piece of a body's surface, and nowhere too steep.

    Raises:
        PlaceError: if not; the message says what was found.
    """
    rim = outline_points(probe)
    rings = np.concatenate([share * rim for share in _WITHIN] + [rim])
    points, normals = body.lift(frame, rings)
    if (missed := np.isnan(points).any(axis=1)).any():
        steps = " and from steps; `smooth` removes those of voxels" if "smooth" in type(body).model_fields else ""
        raise PlaceError(
            f"{missed.mean():.0%} of the footprint of the {probe.shape} misses the body: the whole footprint must be "
            f"on the surface, away from its edge{steps}"
        )
    inclined = _angles(normals, np.array(frame.outward))
    if inclined > MOST_INCLINED:
        raise PlaceError(
            f"under the footprint the surface is inclined by up to {inclined:.3g}° to the probe's axis: at most "
            f"{MOST_INCLINED:g}° are allowed; use another place or axis, or a smaller probe"
        )
    turned = _angles(normals, -np.array(frame.normal))
    if turned > MOST_TURNED:
        raise PlaceError(
            f"the surface turns by up to {turned:.3g}° under the footprint, as over an edge: at most "
            f"{MOST_TURNED:g}° are allowed; use another place or a smaller probe"
        )
    heights = frame.local(points)[:, 2].reshape(-1, len(rim))
    step = _largest_step(rim, heights)
    if step > _FOLD * tan(radians(MOST_INCLINED)):
        height = float(np.abs(np.diff(heights, axis=0)).max(initial=np.abs(np.diff(heights, axis=1)).max()))
        raise PlaceError(
            f"the surface under the footprint has a step of {in_mm(height)}, as at a fold: it must be one piece; use "
            "another place, another axis or a smaller probe"
        )


def check_first_touch(body: Body, probe: Probe, frame: Frame) -> None:
    """Check that a tool with unilateral contact touches the body well within the searched region, first and at depth.

    Raises:
        PlaceError: if not; the message says where it would touch.
    """
    x, y, first = first_touch(body, probe, frame)
    beside, most = hypot(max(0.0, abs(x) - probe.half_length), y), _WELL_WITHIN * probe.half_width
    if not probe.has_singular_edge and beside > most:
        raise PlaceError(
            f"the {probe.shape} would touch the body first {in_mm(beside)} from its axis, outside the region that is "
            f"searched for contact: at most {in_mm(most)} is allowed; use another place or axis, or a larger depth"
        )
    if isinstance(probe, Indenter) and not is_level(body, frame):
        _check_rim(body, probe, frame, first)


def _check_rim(body: Body, probe: Indenter, frame: Frame, first: float) -> None:
    """Check that contact ends before the searched region does: there, the undeformed tool is less deep.

    On a half-space contact ends where the tool is still this deep below the undeformed surface. A ball's contact is a
    circle at any axis; a cone's, which ends farther up, becomes longer where its flank is the less steep.
    """
    rim = outline_points(probe)
    rim = rim[~probe.ends_at(rim)]
    if not len(rim):
        return
    points, _ = body.lift(frame, rim)
    deep = probe.depth - float(np.nanmin(probe.profile(rim) - frame.local(points)[:, 2] - first))
    most = probe.depth - float(probe.section.height(np.array([probe.contact_width]))[0])
    most *= min(1.0, 2 * most / probe.depth) ** _LONGER
    if deep > most:
        inclined = _angles(np.array([frame.outward]), -np.array(frame.normal))
        raise PlaceError(
            f"at its depth of {in_mm(probe.depth)} the {probe.shape}, inclined by {inclined:.3g}° to the surface, "
            f"would be {in_mm(deep)} below it at the edge of the region that is searched for contact, which is at most "
            f"{in_mm(most)} where contact ends: use an axis closer to the surface's normal, or another place"
        )


@lru_cache(_OF_A_MAP)
def first_touch(body: Body, probe: Probe, frame: Frame) -> tuple[float, float, float]:
    """Return where a tool first touches a body, relative to its axis (m, along and across), and its gap (m) there.

    Gaps count from the surface point on the axis: they are negative where the tool touches earlier.
    """
    if is_level(body, frame):
        return 0.0, 0.0, 0.0
    rim = outline_points(probe)
    points = np.concatenate([share * rim for share in _RINGS])
    best, gap = _least_gap(body, probe, frame, points)
    step = probe.half_width / len(_RINGS)
    while not probe.has_singular_edge and step > _FLAT * probe.half_width:
        best, gap = _least_gap(body, probe, frame, best + step * _AROUND)
        step *= _CLOSER
    # A touch off the axis by rounding alone counts as on the axis.
    return (float(best[0]), float(best[1]), gap) if gap < -_FLAT * probe.half_width else (0.0, 0.0, 0.0)


def is_inclined(body: Body, probe: Probe, frame: Frame) -> bool:
    """Return whether the surface is inclined to a tool's axis where the tool first touches it."""
    if probe.is_flat or is_level(body, frame):
        return False
    return angle_between(normal_at_touch(body, probe, frame), frame.outward) > UPRIGHT


@lru_cache(_OF_A_MAP)
def normal_at_touch(body: Body, probe: Probe, frame: Frame) -> Vector:
    """Return the outward unit normal of the surface where a tool first touches it.

    Of a surface of triangles it is the mean below a footprint there, as for the tool's place: that of one facet is
    noise.
    """
    point = place_of_touch(body, probe, frame)
    a, b, c = (frame if point == frame.point else body.frame_below(point, None, probe.circumradius)).normal
    return -a, -b, -c


def place_of_touch(body: Body, probe: Probe, frame: Frame) -> Vector:
    """Return the point of the surface (m) that a tool first touches, in the body's coordinates."""
    x, y, _ = first_touch(body, probe, frame)
    if (x, y) == (0.0, 0.0):
        return frame.point
    points, _ = body.lift(frame, np.vstack([[[x, y]], outline_points(probe)]))
    x, y, z = map(float, points[0])
    return x, y, z


def _least_gap(body: Body, probe: Probe, frame: Frame, points: FloatArray) -> tuple[FloatArray, float]:
    lifted, _ = body.lift(frame, points)
    heights = 0.0 if probe.has_singular_edge else probe.profile(points)
    gap = heights - frame.local(lifted)[:, 2]
    first = int(np.nanargmin(gap))
    return points[first], float(gap[first])


def _angles(normals: FloatArray, direction: FloatArray) -> float:
    """Return the largest angle (degrees) of unit vectors (n, 3) to a direction."""
    return float(np.degrees(np.arccos(np.clip(normals @ direction, -1, 1))).max())


def _largest_step(rim: FloatArray, heights: FloatArray) -> float:
    """Return the largest slope between neighbours: along each of the outlines, and from one to the next."""
    shares = np.array([*_WITHIN, 1.0])
    sides = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
    along = np.abs(np.roll(heights, -1, axis=1) - heights)[1:] / (shares[1:, None] * sides)
    outward = np.abs(np.diff(heights, axis=0)) / (np.diff(shares)[:, None] * np.linalg.norm(rim, axis=1))
    return float(max(along.max(), outward.max()))
