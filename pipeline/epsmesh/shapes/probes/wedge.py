"""A wedge, sharp or rounded."""

from math import hypot, inf, nan
from typing import Annotated, ClassVar, Literal

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.contour import Contour
from epsmesh.shapes.distance import Distance, extruded, intersection, slab
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.probe import ON_EDGE, Probe
from epsmesh.shapes.probes.blade import Blade
from epsmesh.shapes.rounded import Rounded, rise
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.shapes.tip import STEEPEST, Tip
from epsmesh.units import Angle, Length, Rounding


class Wedge(Indenter):
    """The edge of a scalpel or a chisel: two flanks that meet in a line, sharp or rounded; its ends are flat."""

    # None: the line load of a finite edge depends on the depth and its logarithm.
    force_exponent: ClassVar[float | None] = None
    # Unknown.
    mean_square: ClassVar[float] = nan

    shape: Literal["wedge"]
    angle: Annotated[
        Angle, Words("Half angle between axis and flank; a larger one is blunter.", '"70 deg"', is_used=True)
    ]
    length: Annotated[Length, Words("Length of the wedge's edge.", '"6 mm"', is_used=True)]
    tip: Annotated[Rounding, Words("Radius of the rounded edge. 0 is sharp.", '"0.2 mm"')] = 0.0
    edge: Annotated[
        Rounding, Words("Radius of the rounded edge around both ends, at most `tip`. 0 is sharp.", '"0.2 mm"')
    ] = 0.0
    direction: Annotated[
        tuple[float, float, float],
        Words("Direction of the edge: this vector, projected normal to the axis.", "[1.0, 0.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)

    @property
    def section(self) -> Rounded:
        """A straight flank, rounded at the edge."""
        return Rounded(self.angle, self.tip)

    def touching(self, half_width: float) -> Probe:
        """Return the rectangle of that half width, as long as the edge."""
        return Blade.below(self, self.direction, self.length, 2 * half_width)

    @property
    def footprint(self) -> Probe:
        """The rectangle, as long as the edge, that contains all that it may touch."""
        return self.touching(self._widest)

    @property
    def _widest(self) -> float:
        """Half the width (m) of what it may touch: of a tool that deforms, nothing where its side is nearly upright."""
        steep = STEEPEST * self.tip
        is_limited = self.elastic is not None and self.section.tangent > steep
        return min(self.candidate_width, steep) if is_limited else self.candidate_width

    @property
    def tip_shape(self) -> Tip | None:
        """The part that deforms, if its ends are flat."""
        if self.elastic is None or self.edge:
            return None
        height = self.length / 2 if self.height is None else self.height
        return Tip(self.section, inf, height, self._widest, self.length)

    @property
    def ends_sharply(self) -> bool:
        """Whether its edge is not rounded around both ends."""
        return not self.edge

    @property
    def half_length(self) -> float:
        """Half the length of the edge (m)."""
        return self.length / 2

    @property
    def pressed(self) -> float:
        """Distance (m) from the axis to the corners of the undeformed tool's intersection with the surface."""
        return hypot(self.length / 2, self.section.reach(self.depth))

    @property
    def contact_width(self) -> float:
        """Half the contact width (m) at the middle of the edge, on an elastic half-space."""
        return self.section.contact_width(self.depth, self.length)

    @property
    def edge_band(self) -> tuple[float, float]:
        """The smallest and the largest distance (m) from the edge at which contact is expected to end, off its ends."""
        least, largest = (min(width, self._widest) for width in self.contact_widths)
        return least, min(1.3 * largest, self.section.reach(self.depths[1]))

    @property
    def rim_offset(self) -> float:
        """Distance (m) from the strips in which contact is expected to end to the sides of the candidates."""
        return self._widest - self.edge_band[1]

    @property
    def expected_radius(self) -> float:
        """Distance (m) from the axis to the corners of the expected contact."""
        return hypot(self.length / 2, self.edge_band[1])

    def profile(self, points: FloatArray) -> FloatArray:
        """Return the heights (m) of the tool, infinite beyond its ends."""
        beside = np.abs(points[:, 1])
        height = self.section.height(beside)
        if self.edge:  # around the ends it is a smaller and smaller section
            beyond = np.clip(np.abs(points[:, 0]) - self.length / 2 + self.edge, 0.0, self.edge)
            height = self.section.inner_height(beside, rise(beyond, self.edge))
        return np.where(np.abs(points[:, 0]) <= (1 + ON_EDGE) * self.length / 2, height, np.inf)

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to the tool and to what is above it between its ends."""
        edge, ends = extruded(Contour(self.section), points), slab(self.length / 2, points, axis=0)
        return intersection(edge, ends, rounding=self.edge)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return a mask of points at its two ends."""
        at_end: BoolArray = np.abs(points[:, 0]) >= (1 - ON_EDGE) * self.length / 2
        return at_end

    @property
    def rim_size(self) -> tuple[float, float]:
        """Length (m) and area (m²) of the expected edge of contact: two strips, and the two ends."""
        inner, outer = self.edge_band
        return 2 * self.length + 4 * outer, 2 * self.length * (outer - inner)

    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the strips in which contact is expected to end, to the ends, and in depth, as text."""
        inner, outer = (unit * width for width in self.edge_band)
        beyond = f"(Fabs({along})-{unit * self.length / 2:.12g})"
        aside = f"Max(Max({inner:.12g}-Fabs({across}),Fabs({across})-{outer:.12g}),0)"
        to_strips = f"Sqrt({aside}^2+Max({beyond},0)^2)"
        past = f"Max({beyond},Max({-unit * self.edge:.12g}-{beyond},0))" if self.edge else beyond
        to_ends = f"Sqrt({past}^2+Max(Fabs({across})-{outer:.12g},0)^2)"
        return f"Sqrt(Min({to_strips},{to_ends})^2+Max(Fabs({height})-{unit * self.depths[1]:.12g},0)^2)"

    def check(self, problems: Problems) -> None:
        """Report a rounding wider than the edge is long, and ends with a larger rounding than the edge."""
        if self.edge > self.tip:
            problems.error(
                "probe.edge",
                in_mm(self.edge),
                f"rounds the ends of an edge that is sharper: must be at most `tip`, {in_mm(self.tip)}",
            )
            return
        if self.section.tangent >= self.length / 2:
            problems.error(
                "probe.tip",
                in_mm(self.tip),
                f"is too large for an edge of {in_mm(self.length)}: the rounding would be wider than the edge is long",
            )
            return
        super().check(problems)
