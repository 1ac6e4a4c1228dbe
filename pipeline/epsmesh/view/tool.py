"""The tool as triangles, for pictures and pages, with what touches the body besides: a second jaw, a support."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.scene.model import JAW, PROBE
from epsmesh.shapes.contact import first_touch
from epsmesh.shapes.ground import Ground
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.probe import Probe
from epsmesh.view.fields import Fields

# Length of the drawn part, in radii of the footprint.
_LENGTH = 2.5
# Lines over the surface of a tool that is not flat, and the points of each.
_LINES, _POINTS = 49, 60
# Length of these lines, in units of what the tool may touch: of a round tool; of a pyramid, or across a long tool.
_ROUND, _ACROSS = 4.0, 1.5
# Bisections of a line for the point at a height.
_HALVINGS = 40
# How far a support is drawn beyond the body, and below it, in extents of the body; the share of the radius of a round
# one that is left out, where its surface becomes vertical.
_BEYOND, _BELOW, _BEFORE_VERTICAL = 0.08, 1e-4, 1e-6


@dataclass(frozen=True)
class Tool:
    """Its ``points`` (n, 3) before it is pushed in and their displacements ``moved``, in m; ``triangles`` (k, 3)."""

    points: FloatArray
    triangles: IntArray
    moved: FloatArray


def tool_of(fields: Fields) -> Tool:
    """Return the tool of a case, the second jaw of a grasp, and a support that lets go.

    A tool that deforms is part of the mesh: without a support nothing is left.
    """
    case = fields.case
    parts = [Tool(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros((0, 3)))]
    if case.probe.elastic is None:
        parts.append(_tool(fields, case.probe, PROBE))
    if case.jaw is not None:
        parts.append(_tool(fields, case.jaw, JAW))
    if case.body.resting is not None and (ground := case.body.ground) is not None:
        parts.append(_below(fields, ground))
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    return Tool(
        points=np.vstack([part.points for part in parts]),
        triangles=np.vstack([part.triangles + offset for part, offset in zip(parts, first, strict=False)]),
        moved=np.vstack([part.moved for part in parts]),
    )


def _below(fields: Fields, ground: Ground) -> Tool:
    """Return the rigid ``ground`` on which the body rests, a bit below it: a part that reaches beyond the body."""
    low, high = fields.points.min(axis=0), fields.points.max(axis=0)
    extent = float(np.linalg.norm(high - low))
    ends = np.array([low[:2], high[:2]]) + _BEYOND * extent * np.array([[-1.0], [1.0]]) - ground.point[:2]
    most = (1 - _BEFORE_VERTICAL) * ground.radius
    if len(ground.across) == 2:  # a ball: circles about its top
        reach = min(float(np.linalg.norm(np.abs(ends).max(axis=0))), most)
        radii = most * np.sin(np.linspace(0.0, np.arcsin(reach / most), _POINTS))
        angles = np.linspace(0, 2 * np.pi, _LINES)
        aside = radii * np.array([np.cos(angles), np.sin(angles)])[:, :, None]
    else:
        x, y = ends.T
        for across in ground.across:
            curved = int(np.abs(across).argmax())
            first, last = np.arcsin(np.clip(ends[:, curved] / most, -1.0, 1.0))
            on_arc = most * np.sin(np.linspace(first, last, _POINTS))
            x, y = (on_arc, y) if curved == 0 else (x, on_arc)
        aside = np.array(np.meshgrid(x, y, indexing="ij"))
    lines, points = aside.shape[1:]
    level = ground.point + np.column_stack([*aside.reshape(2, -1), np.zeros(lines * points)])
    down = ground.height(level) + _BELOW * extent
    places = level - down[:, None] * np.array(ground.normal)
    return Tool(places, _between_lines(lines, points), np.zeros_like(places))


def _tool(fields: Fields, probe: Probe, group: str) -> Tool:
    """Return a tool: its footprint, extruded, with the displacement of its ``group``; or its own surface.

    Where contact is found, the tissue below the footprint does not show how far the tool goes.
    """
    body, frame = fields.case.body, probe.frame_on(fields.case.body)
    length, outward = _LENGTH * probe.circumradius, np.array(frame.outward)
    travel = np.add(probe.travel(frame), fields.case.probe.pulled or 0.0)
    if not probe.is_flat:
        lines = _lines(probe, length)
        # The depth counts from where the tool first touches, which may be beside its axis.
        *_, first = first_touch(body, probe, frame)
        points = frame.world(lines.reshape(-1, 3)) - first * outward
        return Tool(points, _between_lines(*lines.shape[:2]), np.tile(travel, (len(points), 1)))
    used, corners = np.unique(fields.facets[group], return_inverse=True)
    base, below = fields.points[used], corners.reshape(-1, 3)
    moved = np.zeros_like(base)
    if fields.displacement is not None:
        moved = np.tile(travel, (len(base), 1)) if fields.case.way.is_found else fields.displacement[used]
    count, (first, second) = len(used), _rim(below).T
    sides = np.column_stack([first, second, first + count]), np.column_stack([first + count, second + count, second])
    return Tool(
        points=np.vstack([base, base + length * outward]),
        triangles=np.vstack([below, below + count, *sides]),
        moved=np.vstack([moved, moved]),
    )


def _lines(probe: Probe, length: float) -> FloatArray:
    """Return lines (k, n, 3) over its surface, in m and the probe's own coordinates.

    Those of a round tool or a pyramid go from its axis to its axis, by a shaft with the outline that the tool has at
    one height; those of a long one are sections, the first and last points.
    """
    if (probe.footprint if isinstance(probe, Indenter) else probe).is_round:
        angles, top = np.linspace(0, 2 * np.pi, _LINES), (0.0, 0.0, length)
        farthest = (_ROUND if probe.is_round else _ACROSS) * probe.circumradius
        rays = farthest * np.column_stack([np.cos(angles), np.sin(angles)])
        edge = _at_height(probe, rays, min(length, float(probe.profile(rays).min())))
        return np.array([[*_line(probe, np.zeros(2), end, length), top] for end in edge])
    along, across = probe.outline().max(axis=0)
    sides = np.array([0.0, _ACROSS * across])
    # A tool whose ends rise above the shaft is cut there.
    first, last = _at_height(probe, np.array([[-along, 0.0], [along, 0.0]]), length)[:, 0]
    starts = (np.array([x, 0.0]) for x in np.linspace(first, last, _LINES))
    halves = ((_line(probe, s, -sides, length), _line(probe, s, sides, length)) for s in starts)
    sections = [[*left[::-1], *right, left[-1]] for left, right in halves]
    ends = [[section[0]] * len(section) for section in (sections[0], sections[-1])]
    return np.array([ends[0], *sections, ends[1]])


def _at_height(probe: Probe, rays: FloatArray, height: float) -> FloatArray:
    """Return the points (n, 2) of ``rays`` (n, 2) from the axis up to which the surface is at most at ``height``."""
    low, high = np.zeros((len(rays), 1)), np.ones((len(rays), 1))
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        is_below = probe.profile(middle * rays)[:, None] <= height
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    return low * rays


def _line(probe: Probe, start: FloatArray, along: FloatArray, length: float) -> FloatArray:
    """Return points (n, 3) from ``start`` on ``along`` the surface; where it ends, or the line, straight up."""
    ray = start + np.linspace(0.0, 1.0, _POINTS)[:, None] * along
    heights = probe.profile(ray)
    last = np.flatnonzero(heights <= length)[-1]
    ray[last:], heights[last + 1 :] = ray[last], length
    return np.vstack([np.column_stack([ray, heights]), [*ray[-1], length]])


def _between_lines(lines: int, points: int) -> IntArray:
    """Return the triangles (k, 3) between neighbours of ``lines`` of ``points`` each."""
    first = np.add.outer(points * np.arange(lines - 1), np.arange(points - 1)).ravel()
    ends = first + 1, first + points, first + points + 1
    return np.vstack([np.column_stack([first, ends[0], ends[2]]), np.column_stack([first, ends[2], ends[1]])])


def _rim(triangles: IntArray) -> IntArray:
    """Return the edges (k, 2) that belong to one triangle only."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count == 1])
