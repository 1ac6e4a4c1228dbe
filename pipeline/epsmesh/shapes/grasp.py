"""Two opposite jaws: the tool, and a second one where the tool's axis leaves the body, pressed against it."""

from functools import lru_cache
from itertools import pairwise

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.contact import is_flat
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.scanned import Scanned
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.support import NONE

# The plane of symmetry in which one of two jaws is the image of the other, among those of a scene.
MIDDLE = "middle"
_MANY = 10_000  # places of a large study
# Cosine between a pull and the jaws' axis: rounding.
_ALONG = 1e-9
# Lengths are equal within this share of the body's size.
_SAME = 1e-9
# Supports that are their own images in a horizontal plane.
_LEVEL = (NONE, "sides")
# Keys of tools and layers that no force of a grasp depends on; jaws share a place.
_OF_PLACE = frozenset({"name", "action", "at", "axis", "force"})
_OF_LAYER = frozenset({"name", "thickness", "toughness"})


@lru_cache(_MANY)
def opposite(body: Body, probe: Probe) -> Probe | None:
    """Return the second jaw at its place on a ``body``; None if the tool is alone.

    It closes along the tool's axis, also where the surface is inclined to that; plane faces are parallel.
    """
    jaw = probe.jaw
    if jaw is None:
        return None
    frame = probe.frame_on(body)
    x, y, z = (p + a * body.thickness(frame) for p, a in zip(frame.point, frame.axis, strict=True))
    return jaw.model_copy(update={"at": (x, y, z), "axis": None if isinstance(body, Layered) else frame.outward})


def middle_plane(body: Body, probe: Probe) -> tuple[int, float]:
    """Return the plane in the middle between a tool and an opposite jaw: its normal axis, and where on it it is (m)."""
    frame = probe.frame_on(body)
    axis = max(range(3), key=lambda n: abs(frame.axis[n]))
    at = frame.point[axis] + frame.axis[axis] * body.thickness(frame) / 2
    return axis, at if abs(at) > _SAME * body.extent else 0.0


def is_halved(body: Body, probe: Probe) -> bool:
    """Return whether a second jaw is the image of the tool in the plane in their middle, and the body its own.

    That is said of shapes, supports and layers. Fields of moduli, directions of fibres, and terms are not considered.
    """
    jaw = opposite(body, probe)
    if jaw is None or not isinstance(body, Layered) or body.loose is not None:
        return False
    frame, own = probe.frame_on(body), jaw.frame_on(body)
    # Seen along its own axis, the image of a tool is reflected.
    is_image = own.along == frame.along and probe.is_mirrored(0.0, 1.0)
    keys, others = (tool.model_dump(exclude={*_OF_PLACE}) for tool in (probe, jaw))
    axis, at = middle_plane(body, probe)
    return keys == others and is_image and (_is_even(body, at) if axis == 2 else _is_even_across(body, axis))


def _is_even_across(body: Layered, axis: int) -> bool:
    """Return whether a body is its own image in the plane where a horizontal coordinate ``axis`` is zero."""
    return all(piece.surface.is_mirrored(axis) for piece in body.embedded)


def _is_even(body: Layered, middle: float) -> bool:
    """Return whether a body is its own image in the horizontal plane in its ``middle`` (m); layers must fill it."""
    if body.fixed not in _LEVEL or (body.layer and not body.is_filled):
        return False
    low, high = body.heights
    thickness = [above - below for above, below in pairwise((high, *body.interfaces, low))]
    layers = [layer.model_dump(exclude={*_OF_LAYER}) for layer in body.layer]
    return (
        layers == layers[::-1]
        and all(abs(a - b) <= _SAME * (high - low) for a, b in zip(thickness, thickness[::-1], strict=True))
        and all(
            isinstance(piece.surface, Ovoid) and abs(piece.surface.centre[2] - middle) <= _SAME * (high - low)
            for piece in body.embedded
        )
    )


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
    """Check that the second jaw, if any, is on a plane face opposite a tool on another one, or on scanned triangles.

    Raises:
        PlaceError: if not.
    """
    jaw = opposite(body, probe)
    if jaw is None or isinstance(body, Scanned):
        return
    frame, own = probe.frame_on(body), jaw.frame_on(body)
    faces = isinstance(body, Layered) and is_flat(body, probe, frame) and is_flat(body, jaw, own)
    if not faces or any(abs(a + b) > 0 for a, b in zip(frame.axis, own.axis, strict=True)):
        raise PlaceError(
            "must be on a plane face of a box or cylinder, with a parallel one opposite, for two jaws; "
            'or on a body of triangles: shape = "surface" or "image"'
        )
