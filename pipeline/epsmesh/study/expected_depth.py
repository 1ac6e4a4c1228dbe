"""Depths of tools of which the force is given: the expected one, where the search for it begins, and the largest."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from math import pi, sqrt

import numpy as np

from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section
from epsmesh.study.place import place_error
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Material, material_of
from epsmesh.units import canonical

# Largest depth, as a share of the thickness below the tool, and the smallest one, as a share of the largest.
_THROUGH, _LEAST = 0.95, 1e-6
_BISECTIONS = 40
# Depths of which the largest one that fits is sought.
_SCANNED = 61
# A depth before another one, which is not rounded to it.
_BEFORE = 1 - 1e-6
_MANY = 10_000
# Mean of the contact radius over the depth, as a share of the last one: between a ball's 2/3 and a cone's 1/2.
_MEAN = 0.6


def gives_force(probe: Probe) -> bool:
    """Return whether the depth of a probe is to be found."""
    return probe.force is not None


def at_depth(probe: Probe, depth: float) -> Probe:
    """Return the probe at a ``depth`` (m), by which a second jaw closes, too."""
    found = probe.model_copy(update={"depth": depth})
    return found if probe.jaw is None else found.grasping(at_depth(probe.jaw, depth))


def expected_depth(body: Body, material: Material, probe: Probe) -> float:
    """Return the depth (m) at which the force of a probe is expected: that on a half-space of one material."""
    assert probe.force is not None
    modulus, force = material.young / (1 - material.poisson**2), probe.force

    def is_reached(depth: float) -> bool:
        deeper = at_depth(probe, depth)
        mean = 1.0 if probe.is_flat else _MEAN
        return 2 * modulus * mean * _radius(deeper) * depth >= force

    most = largest_depth(body, probe)
    return _bisected(_LEAST * most, most, lambda depth: not is_reached(depth))


def with_expected_depths(sections: Mapping[str, Sequence[Section]]) -> tuple[Section, ...]:
    """Return the probes; those of which the force is given, at the depth that is expected on the first body."""
    body, material = sections["body"][0], sections["material"][0]
    assert isinstance(body, Body) and isinstance(material, Material)
    material = material_of(body.regions[0]) if body.is_filled else material
    return tuple(
        at_depth(probe, expected_depth(body, material, probe))
        if isinstance(probe, Probe) and gives_force(probe)
        else probe
        for probe in sections["probe"]
    )


@lru_cache(_MANY)
def largest_depth(body: Body, probe: Probe) -> float:
    """Return the largest depth (m) that the tool and the body allow."""
    try:
        thickness = body.thickness(probe.frame_on(body))
    except PlaceError:  # which its checks tell
        thickness = 1.0
    thickness /= 1 if probe.jaw is None else 2
    least, most = _bounds(probe, _THROUGH * thickness)

    def is_allowed(depth: float) -> bool:
        found, deeper = Problems(), at_depth(probe, depth)
        for tool in (deeper, deeper.jaw or deeper):
            tool.check(found)
        return not found.errors

    def fits(depth: float) -> bool:
        return is_allowed(depth) and place_error(body, at_depth(probe, depth)) is None

    # An inclined tool fits in no small depths either: it touches beside what is searched for contact.
    above = most
    for depth in np.geomspace(most, least, _SCANNED).tolist():
        if fits(depth):
            return _bisected(depth, above, fits)
        above = depth
    return _bisected(least, most, is_allowed)


def _bounds(probe: Probe, most: float) -> tuple[float, float]:
    """Return the depths of the probe's mesh if one mesh is for many, else those up to ``most``."""
    given = getattr(probe, "mesh_depths", None)
    return given or (_LEAST * most, most)


def _bisected(low: float, high: float, is_below: Callable[[float], bool]) -> float:
    """Return the largest depth that ``is_below``, on a logarithmic scale; ``low`` if there is none."""
    if is_below(high):
        return canonical(high)
    for _ in range(_BISECTIONS):
        middle = sqrt(low * high)
        low, high = (middle, high) if is_below(middle) else (low, middle)
    # What is rounded up may be beyond it.
    return next((depth for depth in (canonical(low), canonical(_BEFORE * low)) if is_below(depth)), low)


def _radius(probe: Probe) -> float:
    """Return the radius (m) of a disc that is as stiff as the contact, roughly."""
    if probe.is_flat:
        return probe.perimeter / (2 * pi)
    width, length = probe.contact_width, probe.half_length
    return max(width, sqrt(4 * width * length / pi))
