"""Two opposite jaws: the tool, and a second one where the tool's axis leaves the body, pressed against it."""

from functools import lru_cache

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.contact import is_flat
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import in_mm

_MANY = 10_000  # places of a large study
# Cosine between a pull and the jaws' axis: rounding.
_ALONG = 1e-9


@lru_cache(_MANY)
def opposite(body: Body, probe: Probe) -> Probe | None:
    """Return the second jaw at its place on a ``body``; None if the tool is alone."""
    jaw = probe.jaw
    if jaw is None:
        return None
    frame = probe.frame_on(body)
    x, y, z = (p + a * body.thickness(frame) for p, a in zip(frame.point, frame.axis, strict=True))
    return jaw.model_copy(update={"at": (x, y, z), "axis": None})


def check_pull(body: Body, probe: Probe) -> None:
    """Check that a pull of both jaws is along their faces, and leaves them on these.

    Raises:
        PlaceError: if not.
    """
    pulled, jaw = probe.pulled, opposite(body, probe)
    if pulled is None or jaw is None:
        return
    assert probe.pull is not None
    frame = probe.frame_on(body)
    if abs(sum(p * a for p, a in zip(pulled, frame.axis, strict=True))) > _ALONG * probe.pull:
        raise PlaceError("must be along the faces that the jaws press on, across their axis", "pull_direction")
    room = min(probe.gap(body, frame), jaw.gap(body, jaw.frame_on(body)))
    if probe.pull >= room:
        raise PlaceError(f"must be below {in_mm(room)}: it takes the jaws over the edge of their faces", "pull")


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
