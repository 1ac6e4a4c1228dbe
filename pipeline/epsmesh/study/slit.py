"""Whether the slit of a blade fits into the body: inside it, clear of the support and of other materials."""

from math import inf, isfinite

import numpy as np

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.contact import is_level
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.slit import Slit
from epsmesh.shapes.surface import Surface
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Mesh

# Between a slit's front and what ends below or above it there must be this share of its distance from the blade.
_LEAST_ROOM = 0.25
# Points along a slit and down whose distance to an inclusion is looked at, and how often again near the nearest.
_POINTS, _ROUNDS = 21, 8


def check_slit(body: Body, probe: Probe, problems: Problems) -> bool:
    """Report a slit for which the body has no room, and return whether there is none, or one that fits."""
    slit, before = probe.slit, len(problems.errors)
    if slit is None:
        return True
    frame = probe.frame_on(body)
    if not isinstance(body, Layered) or not is_level(body, frame):
        return True  # the table of features tells why it has no room
    if probe.contact == "frictionless":
        _check_tip(body, slit, problems)
    _check_depth(body, slit, problems)
    if len(problems.errors) == before:
        _check_support(body, slit, problems)
        _check_room(body, slit, problems)
        _check_inclusions(body, slit, frame, problems)
    return len(problems.errors) == before


def check_slit_in(body: Body, probe: Probe, mesh: Mesh, problems: Problems) -> None:
    """Report a column into which the slit does not fit."""
    slit = probe.slit
    if slit is None:
        return
    column = mesh.column(body.reach(probe.frame_on(body)))
    if not isfinite(column) or (mesh.outside == "fixed" and slit.is_open):
        return
    if column <= slit.on_surface:
        problems.error(
            "mesh.epsilon",
            in_mm(mesh.epsilon),
            f"is too small: the slit reaches out of the column. Must be above {in_mm(slit.on_surface)}, or use "
            'outside = "coarse"',
        )


def _check_tip(body: Body, slit: Slit, problems: Problems) -> None:
    """Report a frictionless blade whose tip is too near to the surface or the end of a layer."""
    least = _LEAST_ROOM * slit.clear
    if slit.tip > 0 and (room := slit.room_at_tip(body)) < least:
        problems.error(
            "probe.incision",
            in_mm(slit.depth),
            f"leaves {in_mm(room)} between the blade's tip and the surface or the end of a layer: frictionless contact "
            f"needs {in_mm(least)}, a quarter of `ahead`, or of `beside`",
        )


def _check_depth(body: Body, slit: Slit, problems: Problems) -> None:
    low, high = body.heights
    if slit.depth >= high - low:
        problems.error(
            "probe.incision",
            in_mm(slit.depth),
            f"cuts through the whole body: must be below its height {in_mm(high - low)}",
        )


def _check_support(body: Body, slit: Slit, problems: Problems) -> None:
    support, (_, high) = body.hold, body.heights
    for level in support.edges():
        if slit.depth >= high - level:
            problems.error(
                "probe.incision",
                in_mm(slit.depth),
                f"cuts through the support of the body: must be below {in_mm(high - level)}",
            )


def _check_room(body: Body, slit: Slit, problems: Problems) -> None:
    least = _LEAST_ROOM * slit.clear
    if (room := slit.room(body)) < least:
        problems.error(
            "probe.incision",
            in_mm(slit.depth),
            f"leaves {in_mm(room)} between the front of the slit and the end of a layer, the bottom or the support: "
            f"must leave at least {in_mm(least)}, a quarter of `ahead`, or of `beside`",
        )


def _check_inclusions(body: Body, slit: Slit, frame: Frame, problems: Problems) -> None:
    """Report inclusions that the slit cuts, or that are nearer to it than `ahead`."""
    half = slit.reach if isfinite(slit.reach) else body.extent
    for number, inclusion in enumerate(body.inclusion, start=1):
        if (room := _distance(slit, half, frame, inclusion.surface)) < slit.ahead:
            problems.error(
                f"body.inclusion[{number}].at",
                [in_mm(x) for x in inclusion.at],
                f"{inclusion.name} must be at least {in_mm(slit.ahead)} (`ahead`) from the slit; "
                + (f"the distance is {in_mm(room)}" if room > 0 else "the slit cuts it"),
            )


def _distance(slit: Slit, half: float, frame: Frame, surface: Surface) -> float:
    """Return the least distance (m) of a convex surface to a slit of some ``half`` length, negative if it is cut."""
    ends = np.array([[-half, 0.0], [half, slit.depth]])
    low, high = ends
    least = inf
    for _ in range(_ROUNDS):
        along, down = (grid.ravel() for grid in np.meshgrid(*np.linspace(low, high, _POINTS).T))
        distance = surface.distance(frame.world(np.column_stack([along, np.zeros(len(along)), -down])))
        nearest, step = int(np.argmin(distance)), 2 * (high - low) / (_POINTS - 1)
        middle = np.array([along[nearest], down[nearest]])
        low, high = np.clip([middle - step, middle + step], *ends)
        least = min(least, float(distance[nearest]))
    return least
