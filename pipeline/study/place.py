"""Where a tool can stand: what is wrong with a place, and whether it is clear of the body altogether."""

from functools import lru_cache
from math import dist, inf

import numpy as np

from pipeline.shapes.body import Body
from pipeline.shapes.contact import check_contact, check_first_touch, edge_gap, is_level, lifted_edge
from pipeline.shapes.frame import Frame, PlaceError
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.indenter import Indenter
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import in_mm

CLEAR = "contact is lost: the tool is clear of the body"
_MANY = 10_000  # places of a large study
# A footprint this near the edge, in units of the body, touches it: the rest is rounding.
_TOUCHING = 1e-9
# A place this far off the surface, in units of the body, is not projected to it: it is a slip of sign or unit.
_FARTHEST_OFF = 0.1


def place_error(body: Body, probe: Probe) -> PlaceError | None:
    """Return why the probe cannot touch the body where it is told to; None if it can."""
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
    except PlaceError as error:
        return error.with_traceback(None)  # it would keep all that was found on the way, and is itself kept
    return None


@lru_cache(_MANY)
def is_clear(body: Body, probe: Probe) -> bool:
    """Tell whether all of a tool passes a body by, without touching it: False, too, where that is not known.

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
    """Refuse a given direction that says nothing: left out, it is y where the probe advances along x."""
    if frame.is_replaced(probe.lies_along):
        frame.refuse_direction()


def _check_fit(body: Body, probe: Probe, frame: Frame) -> None:
    if probe.gap(body, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"{_footprint(probe)} must lie inside the body's top ({body.face}), not on or over its edge")


def _footprint(probe: Probe) -> str:
    """Return what must lie on one face, in words."""
    if isinstance(probe, Indenter):
        return f"all that the {probe.shape} may touch, up to {in_mm(probe.circumradius)} from its axis,"
    if probe.slit and not probe.slit.is_open:
        return "the slit"
    return f"the footprint of the {probe.shape}, up to {in_mm(probe.circumradius)} from its axis,"


def _check_contact(body: Body, probe: Probe, frame: Frame) -> None:
    """Check a place where the face is not level, not plane, or the probe not at right angles to it."""
    if len(probe.at) == 3 and (off := dist(probe.at, frame.point)) > _FARTHEST_OFF * body.extent:
        raise PlaceError(
            f"lies {in_mm(off)} off the body's surface: at most {_FARTHEST_OFF:.0%} of its extent, "
            f"{in_mm(_FARTHEST_OFF * body.extent)}, is taken for a place on it"
        )
    check_contact(body, probe, frame)
    if probe.is_unilateral:
        check_first_touch(body, probe, frame)
    if edge_gap(body, probe, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"{_footprint(probe)} must lie inside one face, not on or over its edge")
    if held_gap(body, probe, frame) <= _TOUCHING * body.extent:
        raise PlaceError(f"{_footprint(probe)} must not reach what is held of the body")


@lru_cache(_MANY)
def held_gap(body: Body, probe: Probe, frame: Frame) -> float:
    """Return the distance (m) from the footprint to what is held, of any place."""
    distance = body.support.distance(body.surfaces(), lifted_edge(body, probe, frame))
    return inf if distance is None else float(distance.min())
