"""Attraction before contact, as of adhesion or a snap of the tool: a dip of the force that no elastic law has."""

from collections.abc import Iterator, Sequence

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.report.words import percent
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.report.identified import engineering

# Rows that are averaged, as a share of all.
_SMOOTH = 0.01
# Air before the dip, as a share of the way from the dip to the deepest row that is left out, and its fewest rows.
_APART, _FEWEST = 0.15, 15
# No law fits a curve with a dip of this share of the largest force.
_MUCH = 0.03
# A dip is deeper than the force varies in that air, so many times, and than this share of the largest force.
_SURE, _LEAST = 2.0, 0.01


def attractions(curves: Sequence[Curve], *, is_much: bool) -> Iterator[str]:
    """Yield in sentences which curves have such a dip: those that no law fits, or the others."""
    for curve in curves:
        dip = attraction(curve)
        share = dip / float(np.ptp(curve.force))
        if dip and (share >= _MUCH) == is_much:
            yield (
                f"the force of {curve.name} falls {engineering(dip, 'N', 2)} below that of air before contact, "
                f"{percent(share)} of the largest: adhesion or a snap of the tool, which the law does not have"
            )


def attraction(curve: Curve) -> float:
    """Return by how much (N) the force of an approach falls below that of air before contact; 0 if that is not sure."""
    rows = np.arange(int(np.argmax(curve.depth)) + 1)
    depth, force = curve.depth[rows], _smooth(curve.force[rows], max(1, int(_SMOOTH * len(rows))))
    lowest = int(np.argmin(force))
    air = force[depth < depth[lowest] - _APART * (depth[-1] - depth[lowest])]
    if len(air) < _FEWEST:
        return 0.0
    dip, rise = float(np.median(air) - force[lowest]), float(force.max() - np.median(air))
    return dip if dip > max(_SURE * float(np.ptp(air)), _LEAST * rise) else 0.0


def _smooth(values: FloatArray, width: int) -> FloatArray:
    """Return means over ``width`` rows about each."""
    padded = np.pad(values, (width // 2, (width - 1) // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1 / width), "valid")
