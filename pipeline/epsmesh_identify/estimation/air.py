"""What the force before contact says of a fit: whether its baseline is that of the air, and whether that may tilt."""

from collections.abc import Iterator

import numpy as np

from epsmesh_identify.estimation.fit import FINEST, Fit
from epsmesh_identify.report.identified import engineering

# Air is what is farther before contact than this share of the depth in contact; fewer rows of it say nothing.
_APART, _FEWEST = 0.05, 15
# The mean of what a right law leaves in air is smaller than so many standard deviations of it: noise whose correlation
# is 0.99 has 1.0 at most in 400 synthetic curves.
_OFF = 2.0


def off_the_air(found: Fit) -> Iterator[str]:
    """Yield of which curves the baseline that was fitted is not the force in air."""
    values = found.model.space.values(found.x)
    for number, (one, force) in enumerate(zip(found.model.measured, found.force, strict=True)):
        depth = one.curve.depth - values[found.model.own("contact_point", number)]
        rest = (one.curve.force - force)[depth < -_APART * depth.max()]
        if len(rest) < _FEWEST:
            continue
        off, varies = abs(float(rest.mean())), float(rest.std())
        if off > max(_OFF * varies, FINEST * float(np.ptp(force))):
            yield (
                f"the baseline of {one.curve.name} that goes with the force in contact is {engineering(off, 'N', 2)} "
                f"off the air, which varies by ± {engineering(2 * varies, 'N', 2)}"
            )


def levels(found: Fit) -> Iterator[str]:
    """Yield of which curves the baseline was taken for level, since they have no air that tells their tilt."""
    values = found.model.space.values(found.x)
    for number, one in enumerate(found.model.measured):
        if one.may_tilt and found.model.own("tilt", number) not in values:
            yield (
                f"{one.curve.name} has no part before contact: its baseline is taken for level. If it tilts by 1 % of "
                "the slope in contact, E is off by 1 % or more."
            )
