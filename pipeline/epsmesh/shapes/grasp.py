"""Two opposite jaws: the tool, and a second one where the tool's axis leaves the body, pressed against it."""

from functools import lru_cache

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.contact import is_flat
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.probe import Probe

_MANY = 10_000  # places of a large study


@lru_cache(_MANY)
def opposite(body: Body, probe: Probe) -> Probe | None:
    """Return the second jaw at its place on a ``body``; None if the tool is alone."""
    jaw = probe.jaw
    if jaw is None:
        return None
    frame = probe.frame_on(body)
    x, y, z = (p + a * body.thickness(frame) for p, a in zip(frame.point, frame.axis, strict=True))
    return jaw.model_copy(update={"at": (x, y, z), "axis": None})


def check_opposite(body: Body, probe: Probe) -> None:
    """Check that the second jaw, if any, is on a plane face, opposite a tool on another one.

    Raises:
        PlaceError: if not.
    """
    jaw = opposite(body, probe)
    if jaw is None:
        return
    frame, own = probe.frame_on(body), jaw.frame_on(body)
    faces = isinstance(body, Layered) and is_flat(body, probe, frame) and is_flat(body, jaw, own)
    if not faces or any(abs(a + b) > 0 for a, b in zip(frame.axis, own.axis, strict=True)):
        raise PlaceError(
            "must be on a plane face of a box or cylinder, with a parallel one opposite, for two jaws to close on both"
        )
