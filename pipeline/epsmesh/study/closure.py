"""Whether a half ball, coupled to the far field of a point force, fits into a body."""

from typing import NamedTuple

from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import is_level
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Mesh


class FarRegion(NamedTuple):
    """The part of a body's top on which one mesh gives the far fields of many places: a rectangle (m), and the radius
    (m) of the smallest half ball there.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    radius: float


def check_ball(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Report a half ball that is not inside the body, or does not contain the footprint."""
    frame = probe.frame_on(body)
    if not mesh.is_closed or mesh.epsilon >= body.farthest(frame) or not is_level(body, frame):
        return
    if mesh.epsilon >= (most := room(body, probe)):
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f'a half ball must be inside the body: must be below {in_mm(most)}, or "full"',
        )
    elif mesh.epsilon <= probe.circumradius:
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"a half ball must contain the contact: must be above the tool's radius {in_mm(probe.circumradius)}",
        )


def room(body: Body, probe: Probe) -> float:
    """Return the distance (m) from the contact to the nearest side of the body, or its bottom."""
    frame = probe.frame_on(body)
    return min(body.gap(frame.point), body.thickness(frame))
