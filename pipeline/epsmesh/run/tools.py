"""Tools of cases, and what else touches their bodies, on the mesh turned so that the probe presses along -z."""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.scene.model import FIXED, JAW, LOOSE
from epsmesh.shapes.contact import first_touch, is_inclined, normal_at_touch
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.ground import Ground
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.probe import Probe
from epsmesh.solve.contact.bed import Bed, LooseTissue, support_of, tissue_below
from epsmesh.solve.contact.tool import Tool
from epsmesh.study.case import Case


def tool_of(case: Case) -> Tool:
    """Return the surface of the probe of ``case``, for the mesh turned so that the probe presses along -z."""
    *_, first = first_touch(case.body, case.probe, case.frame)
    tool = replace(tool_at(case.probe, case.frame.upright, first), beds=beds_of(case))
    return replace(tool, normal=normal_of(case)) if case.way.is_inclined else tool


def pull_of(case: Case) -> Vector | None:
    """Return how far (m) the jaws are pulled, for the same mesh."""
    pulled = case.probe.pulled
    return None if pulled is None else _turned_by(case.frame.turn, pulled)


def _turned_by(turn: FloatArray | None, vector: Vector) -> Vector:
    """Return a vector after a rotation (3, 3) of the body; None is none."""
    if turn is None:
        return vector
    x, y, z = map(float, turn @ np.array(vector))
    return x, y, z


def beds_on(case: Case) -> tuple[str, ...]:
    """Return the groups of facets that contacts besides the tool's may touch, in the order of :func:`beds_of`."""
    there = {FIXED: case.body.resting, JAW: case.jaw, LOOSE: case.body.loose}
    return tuple(name for name, found in there.items() if found)


def beds_of(case: Case) -> tuple[Bed, ...]:
    """Return what touches the body of ``case`` besides the tool, for the same mesh.

    It is its support, a second jaw, or what loose tissue touches.
    """
    resting, ground, turn = case.body.resting, case.body.ground, case.frame.turn
    found = list[Bed]()
    if resting is not None and ground is not None:
        found.append(support_of(_turned(ground, turn), resting.friction, fits=resting.fits))
    if case.jaw is not None:
        found.append(_jaw_of(case, case.jaw))
    if (loose := case.body.loose) is not None:
        axes = np.eye(3) if turn is None else turn.T
        found.append(tissue_below(LooseTissue(loose.name, loose.parts, axes), loose.friction, is_level=loose.is_level))
    return tuple(found)


def _turned(ground: Ground, turn: FloatArray | None) -> Ground:
    return ground if turn is None else ground.turned(turn)


def _jaw_of(case: Case, jaw: Probe) -> Bed:
    """Return the surface of the second ``jaw`` of a case, for the same mesh."""
    body, turn, pace, there = case.body, case.frame.turn, jaw.depth / case.probe.depth, jaw.frame_on(case.body)
    *_, first = first_touch(body, jaw, there)
    frame, is_along = there.turned_by(turn), not case.way.is_large and is_inclined(body, jaw, there)
    tool = tool_at(jaw, frame, first)
    return Bed(
        lambda points, depth: tool.distance(points, pace * depth),
        frame.axis,
        lambda points: tool.height(points) - first,
        tool.friction,
        pace=pace,
        ends_at=tool.ends_at,
        foot=frame.point,
        is_sharp=tool.is_sharp,
        touched=_turned_by(turn, normal_at_touch(body, jaw, there)) if is_along else None,
    )


def normal_of(case: Case) -> Vector:
    """Return the outward unit normal of the surface that the tool of ``case`` first touches, for the same mesh."""
    return _turned_by(case.frame.turn, normal_at_touch(case.body, case.probe, case.frame))


def tool_at(probe: Probe, frame: Frame, first: float) -> Tool:
    """Return the surface of a probe that presses along -z, in its ``frame``; ``first``: see :class:`Tool`."""

    def height(points: FloatArray) -> FloatArray:
        local = frame.local(points)
        # The whole footprint of a flat tool is below its face, despite rounding of the nodes on the edge.
        return (0.0 if probe.has_singular_edge else probe.profile(local[:, :2])) - local[:, 2]

    def distance(points: FloatArray, depth: float) -> Distance:
        assert isinstance(probe, Indenter)
        return probe.distance(frame.local(points) + np.array([0.0, 0.0, first + depth])).turned(frame.axes)

    return Tool(
        height,
        lambda points: probe.ends_at(frame.local(points)[:, :2]),
        first,
        probe.friction,
        distance,
        frame.point[:2],
        probe.ends_sharply,
    )
