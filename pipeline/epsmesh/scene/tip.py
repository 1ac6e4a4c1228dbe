"""A tool that deforms in the geometry kernel: a solid on the part of the surface that it may touch."""

from collections.abc import Callable
from itertools import pairwise
from math import pi

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Frame, Units
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.tip import Tip

Tag = tuple[int, int]


def draw_tip(tip: Tip, frame: Frame, units: Units) -> Tag:
    """Add the tool, with its lower face flat, to gmsh's current model; return its volume."""
    occ, corners = gmsh.model.occ, tip.profile
    x, y, z = map(units, frame.point)

    def point(beside: float, height: float) -> int:
        if tip.length:
            return int(occ.addPoint(x - units(tip.length) / 2, y + units(beside), z + units(height)))
        return int(occ.addPoint(x + units(beside), y, z + units(height)))

    def flank(side: int) -> tuple[list[int], list[int]]:
        """Return the points and the lines of one side, from the face upwards."""
        points, lines = [point(side * beside, height) for beside, height in corners], []
        for (start, end), (corner, _) in zip(pairwise(points), pairwise(corners), strict=True):
            is_arc, (beside, height) = corner[0] < tip.rounding_ends, tip.centre
            lines.append(
                occ.addCircleArc(start, point(side * beside, height), end) if is_arc else occ.addLine(start, end)
            )
        return points, lines

    if tip.length:
        (points, lines), (others, beyond) = flank(1), flank(-1)
        lines = [*lines, occ.addLine(points[-1], others[-1]), *reversed(beyond), occ.addLine(others[0], points[0])]
    else:
        first, last = point(0.0, 0.0), point(0.0, corners[-1][1])
        points, lines = flank(1)
        lines = [occ.addLine(first, points[0]), *lines, occ.addLine(points[-1], last), occ.addLine(last, first)]
    face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    if tip.length:
        swept = occ.extrude([(2, face)], units(tip.length), 0, 0)
    else:
        swept = occ.revolve([(2, face)], x, y, z, 0, 0, 1, 2 * pi)
    (volume,) = (tag for tag in swept if tag[0] == 3)
    occ.remove([(2, face)], recursive=True)
    frame.place(occ, [volume], units)
    return volume


def is_of_tool(probe: Probe, frame: Frame) -> Callable[[FloatArray], bool]:
    """Return a test of points (n, 3), m, of a volume or a face: whether it is of a ``probe`` that deforms."""

    def test(points: FloatArray) -> bool:
        heights = frame.local(np.atleast_2d(points))[:, 2]
        return probe.elastic is not None and bool(heights.mean() > 0)

    return test


def is_mounted(probe: Probe, frame: Frame, close: float) -> Callable[[FloatArray], bool]:
    """Return a test of points (n, 3), m, of a face: whether, but for ``close`` (m), it is what a mount holds."""
    tip = probe.tip_shape

    def test(points: FloatArray) -> bool:
        return tip is not None and bool(np.all(np.abs(frame.local(points)[:, 2] - (tip.height - tip.rise)) < close))

    return test
