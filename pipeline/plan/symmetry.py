"""Symmetry of a scene: where body, support and probe, each for itself, are their own images.

Each shape answers for itself, and none of them by default.
"""

from functools import lru_cache
from itertools import pairwise

from pipeline.shapes.body import Body
from pipeline.shapes.probe import PLANES, Probe
from pipeline.study.capabilities import obstacle
from pipeline.study.sweep import Case

_MANY = 200_000  # pairs of body and probe of a large study
_ON_AXIS = (0.0, 0.0)
_SAME = 1e-9  # of a height: nearer than this, two are one
_STIFFER = 1.25  # times the shear modulus


def mirror_planes(case: Case) -> tuple[str, ...]:
    """Return the planes, of x = 0 ("x") and y = 0 ("y"), in which the geometry of the scene is its own mirror image."""
    return _geometry(case.body, case.probe)


def movement_planes(case: Case) -> tuple[str, ...]:
    """Return the mirror planes that the probe's movement respects, too."""
    return _movement(case.body, case.probe)


def model_planes(case: Case) -> tuple[str, ...]:
    """Return those that loads respect, as well: half or quarter of the body tells all."""
    return tuple(plane for plane in movement_planes(case) if case.load.is_mirrored(PLANES[plane]))


def is_round(case: Case) -> bool:
    """Tell whether body, support and probe are the same all round one axis, movement along it, no loads.

    None is at large displacements: there are no elements for them on the meridian.
    """
    body, probe, frame = case.body, case.probe, case.frame
    half_plane = body.half_plane()
    if half_plane is None or obstacle("meridian", case):
        return False
    upright = frame.is_upright and frame.point[:2] == _ON_AXIS and case.travel[:2] == _ON_AXIS
    is_same = probe.is_round and is_body_round(body)
    is_whole = not case.is_truncated or not half_plane.is_curved
    return upright and is_same and is_whole and not _is_held_below_stiffer(case)


def _is_held_below_stiffer(case: Case) -> bool:
    """Tell whether the support begins at the lower end of a layer that is stiffer than what is below it.

    There the displacement goes like r to a power below ½, for which no bar on the meridian is made: at 1.7 times the
    modulus an error was 1.1 of its bar, at 10 times 1.4.
    """
    level, interfaces = case.body.support.on_half_plane(), case.body.interfaces
    layers = [*case.tissues[1:], case.tissues[0]][: len(interfaces) + 1]
    return any(
        isinstance(level, float) and abs(z - level) <= _SAME * abs(z) and above.lame[1] > _STIFFER * below.lame[1]
        for z, (above, below) in zip(interfaces, pairwise(layers), strict=True)
    )


def body_planes(body: Body) -> tuple[str, ...]:
    """Return the planes in which a body, its support and what is in it are their own mirror images."""
    own = body.mirror_planes
    # An inclusion is its own image, or there is no symmetry: pairs of images are not looked for.
    return tuple(
        plane
        for number, plane in enumerate(PLANES)
        if plane in own and all(inclusion.at[number] == 0.0 for inclusion in body.inclusion)
    )


def is_body_round(body: Body) -> bool:
    """Tell whether a body, its support and what is in it are the same all round the z axis."""
    return body.half_plane() is not None


@lru_cache(_MANY)
def _geometry(body: Body, probe: Probe) -> tuple[str, ...]:
    frame, held = probe.frame_on(body), body_planes(body)
    found = []
    for number, (plane, normal) in enumerate(PLANES.items()):
        along, across = (sum(n * t for n, t in zip(normal, unit, strict=True)) for unit in (frame.along, frame.across))
        upright = frame.point[number] == frame.axis[number] == 0.0
        if plane in held and upright and probe.is_mirrored(along, across):
            found.append(plane)
    return tuple(found)


@lru_cache(_MANY)
def _movement(body: Body, probe: Probe) -> tuple[str, ...]:
    if probe.motion == "all":
        return ()
    travel = dict(zip(PLANES, probe.travel(probe.frame_on(body)), strict=False))
    return tuple(plane for plane in _geometry(body, probe) if travel[plane] == 0)
