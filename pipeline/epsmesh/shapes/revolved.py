"""Sections of tools that are round about their axis."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray


@dataclass(frozen=True)
class Revolved:
    """The section of a round tool: its ``slope`` (n,) at distances (n,) from the axis (m).

    The tool ends at the radius ``limit`` (m). It is flat up to the radius ``flat`` (m), all of it if that is its limit.
    ``kinks`` are radii (m) at which the slope is not smooth.
    """

    slope: Callable[[FloatArray], FloatArray]
    limit: float
    flat: float = 0.0
    kinks: tuple[float, ...] = ()

    @property
    def is_flat(self) -> bool:
        """Whether all of it is flat, so that contact is known."""
        return self.flat >= self.limit


def flat_face(radius: float) -> Revolved:
    """Return the section of a flat disc of a ``radius`` (m)."""
    return Revolved(np.zeros_like, radius, radius)
