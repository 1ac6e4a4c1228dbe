"""A pyramid, sharp or rounded."""

from functools import cached_property
from math import cos, inf, nan, pi
from typing import Annotated, ClassVar, Literal

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes import pyramid
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.indenter import BAND
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.probes._round import InRing
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Words
from epsmesh.units import Angle, Rounding

# Planes of symmetry within this cosine.
_ALIGNED = 1e-9


class PyramidTip(InRing):
    """The tip of Vickers (four faces at 68° to the axis), of Berkovich (three at 65.27°), or of a force microscope.

    Its faces do not end.
    """

    # Measured: 1.3 with four faces, 1.4 to 2.6 with three.
    EXPECTED_ERROR = 2.0
    # Unknown.
    mean_square: ClassVar[float] = nan

    shape: Literal["pyramid"]
    angle: Annotated[
        Angle, Words("Half angle between axis and faces; a larger one is blunter.", '"68 deg"', is_used=True)
    ]
    sides: Annotated[Literal[3, 4], Words("Number of faces.", "4", is_used=True)] = 4
    tip: Annotated[
        Rounding, Words("Radius to which the tip, and the ridges between faces, are rounded. 0 is sharp.", '"0.2 mm"')
    ] = 0.0
    direction: Annotated[
        tuple[float, float, float],
        Words("Direction to which a face looks: this vector, projected normal to the axis.", "[1.0, 0.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)

    @cached_property
    def solid(self) -> pyramid.Pyramid:
        """Its shape."""
        return pyramid.Pyramid(self.sides, self.angle, self.tip)

    @property
    def is_round(self) -> bool:
        """False."""
        return False

    def is_mirrored(self, along: float, across: float) -> bool:
        """Return whether it has mirror symmetry in the line normal to (along, across): of faces or of ridges."""
        turns = pi * np.arange(self.sides) / self.sides + pi / 2
        length = float(np.hypot(along, across))
        aligned = np.abs(along * np.cos(turns) + across * np.sin(turns)) >= (1 - _ALIGNED) * length
        return bool(aligned.any())

    @property
    def force_exponent(self) -> float | None:
        """2 if it is sharp: no other length than the depth."""
        return None if self.tip else 2.0

    @property
    def section(self) -> Rounded:
        """Across a face: a straight flank, rounded at the tip."""
        return Rounded(self.angle, self.tip)

    @property
    def limit(self) -> float:
        """Infinite: its faces do not end."""
        return inf

    @property
    def corner(self) -> float:
        """Distance of a corner of a polygon from its centre, in units of that of a side."""
        return 1 / cos(pi / self.sides)

    @property
    def footprint(self) -> Probe:
        """The disc that contains all that it may touch, to the corners."""
        return self.touching(self.corner * self.candidate_width)

    @property
    def pressed(self) -> float:
        """Distance (m) from the axis to the corners of the undeformed tool's intersection with the surface."""
        return self.corner * self.section.reach(self.depth)

    @property
    def contact_width(self) -> float:
        """Distance (m) from the axis to a side of the contact on an elastic half-space, that of a cone."""
        return self.section.contact_radius(self.depth, self._bump)

    @property
    def edge_band(self) -> tuple[float, float]:
        """The distances (m) between which contact is expected to end: those of sides and of corners."""
        most = self.footprint.half_width
        least, largest = self.contact_widths
        return min(least, most), min(self.corner * BAND * largest, most)

    def profile(self, points: FloatArray) -> FloatArray:
        """Return the heights (m) of the tool."""
        return self.solid.height(points)

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to the tool."""
        return self.solid.distance(points)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return false everywhere."""
        return np.zeros(len(points), dtype=bool)
