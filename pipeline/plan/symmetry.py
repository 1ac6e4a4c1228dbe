"""Symmetry of a scene: where body, support and probe, each for itself, are their own images.

Each shape answers for itself, and none of them by default.
"""

from functools import lru_cache

from pipeline.shapes.body import Body
from pipeline.shapes.probe import PLANES, Probe
from pipeline.study.sweep import Case

_MANY = 200_000  # pairs of body and probe of a large study
_ON_AXIS = (0.0, 0.0)


def mirror_planes(case: Case) -> tuple[str, ...]:
    """Return the planes, of x = 0 ("x") and y = 0 ("y"), in which the geometry of the scene is its own mirror image."""
    return _geometry(case.body, case.probe)


def model_planes(case: Case) -> tuple[str, ...]:
    """Return the mirror planes that the probe's movement respects, too: half or quarter of the body tells all."""
    return _movement(case.body, case.probe)


def is_round(case: Case) -> bool:
    """Tell whether body, support and probe are the same all round one axis, and the movement along it."""
    body, probe, frame = case.body, case.probe, case.frame
    if probe.motion == "all":
        return False
    upright = frame.point[:2] == _ON_AXIS and frame.axis[:2] == _ON_AXIS and case.travel[:2] == _ON_AXIS
    return upright and probe.is_round and not body.regions and body.half_plane() is not None and body.support.is_round()


@lru_cache(_MANY)
def _geometry(body: Body, probe: Probe) -> tuple[str, ...]:
    frame = probe.frame_on(body)
    held = {*body.mirror_planes()} & {*body.support.mirror_planes()}
    found = []
    for number, (plane, normal) in enumerate(PLANES.items()):
        along, across = (sum(n * t for n, t in zip(normal, unit, strict=True)) for unit in (frame.along, frame.across))
        upright = frame.point[number] == frame.axis[number] == 0.0
        # An inclusion is its own image, or there is no symmetry: pairs of images are not looked for.
        upright = upright and all(inclusion.at[number] == 0.0 for inclusion in body.inclusion)
        if plane in held and upright and probe.is_mirrored(along, across):
            found.append(plane)
    return tuple(found)


@lru_cache(_MANY)
def _movement(body: Body, probe: Probe) -> tuple[str, ...]:
    if probe.motion == "all":
        return ()
    travel = dict(zip(PLANES, probe.travel(probe.frame_on(body)), strict=False))
    return tuple(plane for plane in _geometry(body, probe) if travel[plane] == 0)
