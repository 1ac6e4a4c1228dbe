"""Symmetry of a scene: the planes and the axis for which body, support and probe are all symmetric.

Each shape declares its own symmetry; the default is none.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from epsmesh.shapes.body import Body
from epsmesh.shapes.grasp import MIDDLE, is_halved, opposite
from epsmesh.shapes.probe import PLANES, Probe
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case

_MANY = 200_000  # pairs of body and probe of a large study
_ON_AXIS = (0.0, 0.0)
_SAME = 1e-9  # relative difference at which two heights are equal
_STIFFER = 1.25  # ratio of shear moduli
_FOLDS = 0.25  # depth over half width beyond which the meridian's elements fold at the edge of a bonded tool


def mirror_planes(case: Case) -> tuple[str, ...]:
    """Return the planes of symmetry of the scene's geometry: x = 0 ("x"), y = 0 ("y"), and that between equal jaws."""
    return _geometry(case.body, case.probe)


def movement_planes(case: Case) -> tuple[str, ...]:
    """Return the planes of symmetry of geometry and movement, that of jaws that are pulled included."""
    pulled = dict(zip(PLANES, case.probe.pulled or (0.0, 0.0, 0.0), strict=False))
    return tuple(plane for plane in _movement(case.body, case.probe) if pulled.get(plane, 0.0) == 0)


def slides_across(case: Case) -> bool:
    """Return whether the tool moves across a plane of symmetry: that movement has no force along the axis."""
    lost = {*mirror_planes(case)} - {*_movement(case.body, case.probe)}
    fields = [tissue.varying for tissue in case.tissues if tissue.varying is not None]
    return any(all(field.is_mirrored(PLANES[plane]) for field in fields) for plane in lost)


def model_planes(case: Case) -> tuple[str, ...]:
    """Return the planes of symmetry of geometry, movement, loads and tissue: half or a quarter of the body does."""
    tests = [case.load.is_mirrored, case.body.is_capsule_mirrored, *(tissue.is_mirrored for tissue in case.tissues)]

    def is_mirrored(plane: str) -> bool:
        if plane != MIDDLE:
            return all(test(PLANES[plane]) for test in tests)
        # Faces have the same name on both sides, and outputs are at places of the whole body.
        is_plain = not (case.load.terms or case.outputs)
        return is_plain and all(tissue.is_mirrored(case.frame.outward) for tissue in case.tissues)

    return tuple(plane for plane in movement_planes(case) if is_mirrored(plane))


def is_round(case: Case) -> bool:
    """Return whether the scene is axisymmetric: body, support, probe and movement, and no loads."""
    body, probe, frame = case.body, case.probe, case.frame
    half_plane = body.half_plane()
    if half_plane is None or obstacle("meridian", case) or _folds(case):
        return False
    upright = frame.is_upright and frame.point[:2] == _ON_AXIS and case.travel[:2] == _ON_AXIS
    is_same = probe.is_round and is_body_round(body)
    is_whole = not case.is_truncated or not half_plane.is_curved
    return upright and is_same and is_whole and not _is_held_below_stiffer(case)


def _folds(case: Case) -> bool:
    return not case.has_quarter_points and case.probe.depth > _FOLDS * case.probe.half_width


def _is_held_below_stiffer(case: Case) -> bool:
    """Return whether the support begins at an interface with a stiffer layer above.

    The displacement there goes like r to a power below ½, which the meridian's error bar does not cover: the error was
    1.1 error bars at 1.7 times the modulus, and 1.4 at 10 times.
    """
    level, interfaces = case.body.hold.on_half_plane(), case.body.interfaces
    layers = [*case.tissues[1:], case.tissues[0]][: len(interfaces) + 1]

    def is_stiffer(above: Tissue, below: Tissue, z: float) -> bool:
        place = np.array([[case.reach, 0.0, z]])
        of_fields = (
            1.0 if one.varying is None else float(one.varying.relative(one.varying.at(place))[0])
            for one in (above, below)
        )
        first, second = (one.lame[1] * factor for one, factor in zip((above, below), of_fields, strict=True))
        return first > _STIFFER * second

    return any(
        isinstance(level, float) and abs(z - level) <= _SAME * abs(z) and is_stiffer(above, below, z)
        for z, (above, below) in zip(interfaces, pairwise(layers), strict=True)
    )


def body_planes(body: Body) -> tuple[str, ...]:
    """Return the planes of symmetry of a body with its support and regions."""
    own = body.mirror_planes
    # Every region must be symmetric by itself: pairs of mirrored ones are not recognised.
    return tuple(
        plane
        for number, plane in enumerate(PLANES)
        if plane in own and all(piece.surface.is_mirrored(number) for piece in body.embedded)
    )


def is_body_round(body: Body) -> bool:
    """Return whether a body with its support and inclusions is axisymmetric about z."""
    return body.half_plane() is not None and (body.ground is None or body.ground.is_round)


@lru_cache(_MANY)
def _geometry(body: Body, probe: Probe) -> tuple[str, ...]:
    frame, held = probe.frame_on(body), body_planes(body)
    found = []
    for number, (plane, normal) in enumerate(PLANES.items()):
        along, across = (sum(n * t for n, t in zip(normal, unit, strict=True)) for unit in (frame.along, frame.across))
        upright = frame.point[number] == frame.axis[number] == 0.0
        if plane in held and upright and probe.is_mirrored(along, across):
            found.append(plane)
    jaw = opposite(body, probe)
    if jaw is None:
        return tuple(found)
    found = [plane for plane in found if plane in _geometry(body, jaw)]
    return (*found, MIDDLE) if is_halved(body, probe) else tuple(found)


@lru_cache(_MANY)
def _movement(body: Body, probe: Probe) -> tuple[str, ...]:
    if probe.motion == "all":
        return ()
    travel = dict(zip(PLANES, probe.travel(probe.frame_on(body)), strict=False))
    return tuple(plane for plane in _geometry(body, probe) if travel.get(plane, 0.0) == 0)
