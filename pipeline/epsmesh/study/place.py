"""Places of a tool: whether it can touch the body there, and whether it is clear of the body."""

from functools import lru_cache
from math import dist, inf

import numpy as np

from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import check_contact, check_first_touch, edge_gap, is_level, lifted_edge
from epsmesh.shapes.frame import Frame, PlaceError
from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.grasp import check_opposite, check_pull, opposite
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm

CLEAR = "no contact: the tool is clear of the body"
_MANY = 10_000  # places of a large study
# A footprint this near the edge, in units of the body, touches it: the rest is rounding.
_TOUCHING = 1e-9
# A place this far off the surface, in units of the body, is not projected to it: it is a slip of sign or unit.
_FARTHEST_OFF = 0.1


def place_error(body: Body, probe: Probe) -> PlaceError | None:
    """Return why the probe cannot touch the body at its place; None if it can."""
    # Probes are equal whether their direction is the default or was given.
    return _place_error(body, probe, "direction" in probe.model_fields_set)


@lru_cache(_MANY)
def _place_error(body: Body, probe: Probe, is_directed: bool) -> PlaceError | None:
    try:
        frame = probe.frame_on(body)
        if is_directed:
            _check_directions(probe, frame)
        if is_level(body, frame):
            _check_fit(body, probe, frame)
        if not is_level(body, frame) or isinstance(body, FromFile):
            _check_contact(body, probe, frame)
        if (jaw := opposite(body, probe)) is not None:
            _check_jaw(body, probe, jaw)
    except PlaceError as error:
        return error.with_traceback(None)  # it would keep all that was found on the way, and is itself kept
    return None


@lru_cache(_MANY)
def is_clear(body: Body, probe: Probe) -> bool:
    """Return whether the tool certainly does not touch the body.

    A place is then farther from the body than all that the tool touches with is wide, and than it is pushed in.
    """
    needed = probe.circumradius + probe.depth
    if len(probe.at) == 3:
        return bool(-body.inside(np.array([probe.at]))[0] > needed)
    x, y = probe.at
    # Seen from above, bodies that are not from files are as wide at z = 0 as anywhere. Where there is no surface below
    # a place, there is no height to begin from: only a tool that comes down upright is known to pass.
    passes = probe.axis is None or probe.axis[:2] == (0.0, 0.0)
    return not isinstance(body, FromFile) and passes and bool(-body.inside(np.array([[x, y, 0.0]]))[0] > needed)


def _check_directions(probe: Probe, frame: Frame) -> None:
    """Report a given direction that is parallel to the axis. The default is y if the probe advances along x."""
    if frame.is_replaced(probe.lies_along):
        frame.refuse_direction()


def _check_fit(body: Body, probe: Probe, frame: Frame) -> None:
    if probe.gap(body, frame) <= _TOUCHING * body.extent:
        raise PlaceError(
            f"{_footprint(probe)} must be inside the top face of the body ({body.face}), not on or over its edge"
        )


def _check_jaw(body: Body, probe: Probe, jaw: Probe) -> None:
    """Check that the second jaw of a grasp fits on its face, opposite the tool, and away from the support."""
    frame = jaw.frame_on(body)
    if jaw.gap(body, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"of the second jaw, {_footprint(jaw)} must be inside one face, not on or over its edge")
    check_opposite(body, probe)
    check_pull(body, probe)
    try:
        _check_contact(body, jaw, frame)
    except PlaceError as error:
        place = ", ".join(in_mm(x) for x in frame.point)
        raise PlaceError(f"of the second jaw, where the axis leaves the body at [{place}]: {error}") from None


def _footprint(probe: Probe) -> str:
    """Return the name of the part of the tool that must be on one face."""
    if not probe.is_flat:
        return f"the largest contact area of the {probe.shape}, up to {in_mm(probe.circumradius)} from its axis,"
    if probe.slit and not probe.slit.is_open:
        return "the slit"
    return f"the footprint of the {probe.shape}, up to {in_mm(probe.circumradius)} from its axis,"


def _check_contact(body: Body, probe: Probe, frame: Frame) -> None:
    """Check a place on a face that is curved or inclined, or to which the probe is not normal."""
    if len(probe.at) == 3 and (off := dist(probe.at, frame.point)) > _FARTHEST_OFF * body.extent:
        raise PlaceError(
            f"is {in_mm(off)} off the surface of the body: must be at most {_FARTHEST_OFF:.0%} of its size, "
            f"{in_mm(_FARTHEST_OFF * body.extent)}"
        )
    check_contact(body, probe, frame)
    if probe.is_unilateral:
        check_first_touch(body, probe, frame)
    if edge_gap(body, probe, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"{_footprint(probe)} must be inside one face, not on or over its edge")
    if held_gap(body, probe, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"{_footprint(probe)} must not reach the support of the body")


@lru_cache(_MANY)
def held_gap(body: Body, probe: Probe, frame: Frame) -> float:
    """Return the distance (m) from the footprint to the support."""
    distance = body.hold.distance(body.surfaces(), lifted_edge(body, probe, frame))
    return inf if distance is None else float(distance.min())
