"""How wide contact is below a probe."""

from collections.abc import Callable
from math import sqrt

from epsmesh.arrays import FloatArray
from epsmesh.shapes.probe import Probe
from epsmesh_identify.layered.hiding import Tip, flat_tip, tip_of
from epsmesh_identify.surrogate.wide import profile_of


def tip_of_probe(probe: Probe, deepest: float) -> Callable[[FloatArray], Tip]:
    """Return how wide contact is at depths up to ``deepest`` (m), as :mod:`epsmesh_identify.layered.hiding` needs it.

    A tool that is not round counts as a disc with the geometric mean of its half width and its circumradius.
    """
    if profile := profile_of(probe):
        return tip_of(profile, deepest)
    radius = sqrt(probe.half_width * probe.circumradius)
    return lambda depth: flat_tip(depth, radius)
