"""Axisymmetric tools with unknown contact area: what sphere and cone have in common."""

from abc import abstractmethod
from math import pi
from typing import ClassVar

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.contour import Contour
from epsmesh.shapes.distance import Distance, revolved
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.insertion import Needle
from epsmesh.shapes.parabola import Parabola
from epsmesh.shapes.probe import ON_EDGE, Probe
from epsmesh.shapes.probes.disc import Disc
from epsmesh.shapes.revolved import Revolved
from epsmesh.shapes.tip import STEEPEST, Tip
from epsmesh.units import Length

# Rings of a tip.
_RINGS = 1000


class InRing(Indenter):
    """An indenter whose contact is expected to end in a ring: round, or a polygon."""

    @property
    @abstractmethod
    def limit(self) -> float:
        """Radius (m) at which the tool itself ends; infinite without an end."""

    def touching(self, half_width: float) -> Probe:
        """Return the disc of that radius."""
        return Disc.model_construct(shape="disc", radius=half_width, depth=self.depth, at=self.at, axis=self.axis)

    @property
    def footprint(self) -> Probe:
        """The disc that contains all that it may touch."""
        return self.touching(min(self.candidate_width, self._widest))

    @property
    def _widest(self) -> float:
        """The largest radius (m) that it may touch: where a tool deforms, none at which its side is nearly upright."""
        section = self.section
        if self.elastic is None or section.angle:
            return self.limit
        return min(section.flat + STEEPEST * section.tip, self.limit)

    @property
    def expected_radius(self) -> float:
        """The larger of the radii (m) between which contact is expected to end."""
        return self.edge_band[1]

    @property
    def rim_size(self) -> tuple[float, float]:
        """Length (m) and area (m²) of the ring in which contact is expected to end."""
        inner, outer = self.edge_band
        return pi * (inner + outer), pi * (outer**2 - inner**2)

    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the ring in which contact is expected to end, including the depth, as text."""
        inner, outer = (unit * radius for radius in self.edge_band)
        radius = f"Sqrt({along}^2+{across}^2)"
        aside = f"Max(Max({inner:.12g}-{radius},{radius}-{outer:.12g}),0)"
        return f"Sqrt({aside}^2+Max(Fabs({height})-{unit * self.depths[1]:.12g},0)^2)"


class RoundIndenter(InRing, Needle):
    """An axisymmetric indenter, the end of a shaft: a needle, if it is inserted."""

    NOT_DRAWN = (*Indenter.NOT_DRAWN, "toughness", "insertion", "crack_shape")

    @property
    def tip_heights(self) -> FloatArray:
        """Heights (n) in m of the tip's surface, at equal steps of the radius from the axis to the shaft."""
        return self.section.height(self.limit * np.linspace(0.0, 1.0, _RINGS + 1))

    @property
    def tip_shape(self) -> Tip | None:
        """The part that deforms, where the section is of straight lines and circles."""
        if self.elastic is None or isinstance(self.section, Parabola):
            return None
        height = self.limit if self.height is None else self.height
        return Tip(self.section, self.limit, height, self.footprint.half_width)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Radii (m) at which its section is not smooth: a sharp tip, or where a rounding ends."""
        section = self.section
        return (*((section.flat,) if section.flat else ()), *((section.tangent,) if section.angle else ()))

    @property
    def revolved(self) -> Revolved:
        """Its section."""
        return Revolved(self.section.slope, self.limit, self.section.flat, self.kinks)

    @property
    def pressed(self) -> float:
        """Radius (m) at which the undeformed tool intersects the surface."""
        return min(self.section.reach(self.depth), self.limit)

    @property
    def contact_width(self) -> float:
        """Contact radius (m) on an elastic half-space, bent as the surface is."""
        return min(self.section.contact_radius(self.depth, self._bump), self.limit)

    def profile(self, points: FloatArray) -> FloatArray:
        """Return the heights (m) of the tool, infinite beyond where it ends."""
        distance = np.hypot(points[:, 0], points[:, 1])
        height = self.section.height(np.minimum(distance, self.limit))
        return np.where(distance <= (1 + ON_EDGE) * self.limit, height, np.inf)

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to the tool and the shaft above it."""
        return revolved(Contour(self.section, self.limit), points)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return true if the footprint is as large as the tool."""
        return np.full(len(points), self.footprint.half_width >= (1 - ON_EDGE) * self.limit)


class HertzTip(RoundIndenter):
    """An indenter that is H. Hertz's paraboloid at small depths, of its ``radius`` (m) of curvature at the apex."""

    # 3/2: of a paraboloid at any depth, of a ball while contact is small compared with it.
    force_exponent: ClassVar[float | None] = 1.5

    radius: Length

    @property
    def mean_square(self) -> float:
        """8/15 of the square of the contact radius (m²): 2/5, times 4/3."""
        return 8 / 15 * self.contact_width**2

    @property
    def hertz_radius(self) -> float:
        """The radius of curvature at the apex (m)."""
        return self.radius
