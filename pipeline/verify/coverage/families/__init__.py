"""Families of random scenes: a module each, with `throw` and `TRUTH` as :class:`Family` has them, and a line here."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.verify.coverage.bars import IDLE
from pipeline.verify.coverage.families import (
    contact,
    design,
    ellipses,
    organs,
    proportions,
    regions,
    slits,
    tools,
    tumours,
    wedges,
)
from pipeline.verify.sections import Section

# Of bars on what is no bound.
_TWO_SIDED = 3.0


@dataclass(frozen=True)
class Family:
    """``throw`` returns the sections of a scene and the section of its mesh, the same for the same state of the dice.

    ``truth`` is the accuracy of what is held to be true. It is to be known better than the best of the cases' errors:
    ten times, where that does not take minutes. ``idle`` is how many errors bars may be in the median.
    """

    throw: Callable[[np.random.Generator], tuple[Section, Section]]
    truth: str
    idle: float = IDLE


FAMILIES: dict[str, Family] = {
    "design": Family(design.throw, design.TRUTH),
    "proportions": Family(proportions.throw, proportions.TRUTH),
    "ellipses": Family(ellipses.throw, ellipses.TRUTH),
    "organs": Family(organs.throw, organs.TRUTH),
    "regions": Family(regions.throw, regions.TRUTH),
    "tumours": Family(tumours.throw, tumours.TRUTH),
    "tools": Family(tools.throw, tools.TRUTH, _TWO_SIDED),
    "contact": Family(contact.throw, contact.TRUTH, _TWO_SIDED),
    "wedges": Family(wedges.throw, wedges.TRUTH, _TWO_SIDED),
    "slits": Family(slits.throw, slits.TRUTH, _TWO_SIDED),
}
