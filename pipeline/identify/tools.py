"""What the equations of layered bodies need to know of a probe."""

from collections.abc import Callable
from math import sqrt

from pipeline.arrays import FloatArray
from pipeline.layered.contact import Profile
from pipeline.layered.hiding import Tip, flat_tip, tip_of
from pipeline.shapes.probe import Probe
from pipeline.shapes.probes._round import RoundIndenter
from pipeline.shapes.probes.disc import Disc


def profile_of(probe: Probe) -> Profile | None:
    """Return the section of a round tool; None for any other."""
    if isinstance(probe, Disc):
        return Profile(lambda distance: 0 * distance, limit=probe.radius, flat=probe.radius)
    if isinstance(probe, RoundIndenter):
        section = probe.section
        return Profile(section.slope, limit=probe.limit, flat=section.flat, kinks=probe.kinks)
    return None


def tip_of_probe(probe: Probe, deepest: float) -> Callable[[FloatArray], Tip]:
    """Return how wide contact is at depths up to ``deepest`` (m), as :mod:`pipeline.layered.hiding` needs it.

    A tool that is not round counts as a disc with the geometric mean of its half width and its circumradius.
    """
    if profile := profile_of(probe):
        return tip_of(profile, deepest)
    radius = sqrt(probe.half_width * probe.circumradius)
    return lambda depth: flat_tip(depth, radius)
