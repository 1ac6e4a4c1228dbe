"""A blade whose edges are rounded: contact ends on the rounding."""

from math import hypot, nan
from typing import ClassVar, Literal

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance, above, intersection, slab
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.probe import ON_EDGE, Probe
from epsmesh.shapes.probes.blade import Blade
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Problems, in_mm
from epsmesh.shapes.slit import to_rectangle
from epsmesh.units import Length


class RoundedBlade(Indenter):
    """A blade with all edges rounded to the radius ``edge`` (m), in unilateral contact: `shape = "blade"` in a study.

    The four edges along its axis are rounded, too, so its surface is smooth.
    """

    # None: contact grows on the rounding while the face stays in contact.
    force_exponent: ClassVar[float | None] = None
    # Unknown.
    mean_square: ClassVar[float] = nan
    EXPECTED_ERROR = 0.75

    shape: Literal["blade"]
    length: Length
    width: Length
    direction: tuple[float, float, float]
    edge: Length

    @property
    def section(self) -> Rounded:
        """Across its shorter side: a flat face, and a quarter of a circle."""
        flat = max(min(self.length, self.width) / 2 - self.edge, 0.0)  # none is left of it: see `check`
        return Rounded(0.0, self.edge, flat)

    def _sides(self, beyond: float) -> FloatArray:
        """Return half the length and half the width (m) of the part up to ``beyond`` (m) outside of the flat face."""
        return np.array([self.length, self.width]) / 2 - self.edge + min(beyond, self.edge)

    def touching(self, half_width: float) -> Probe:
        """Return the rectangle of that half width across its shorter side."""
        length, width = 2 * self._sides(half_width - self.section.flat)
        return Blade.below(self, self.direction, float(length), float(width))

    @property
    def footprint(self) -> Probe:
        """The rectangle that contains all that it may touch."""
        return self.touching(self.candidate_width)

    @property
    def half_length(self) -> float:
        """Half the length (m) of the flat face."""
        return self.length / 2 - self.edge

    @property
    def pressed(self) -> float:
        """Distance (m) from the axis to the corners of the undeformed tool's intersection with the surface."""
        return hypot(*self._sides(self.section.reach(self.depth) - self.section.flat))

    @property
    def contact_width(self) -> float:
        """Half the expected contact width (m) across its shorter side, on an elastic half-space."""
        return self.section.contact_width(self.depth, max(self.length, self.width))

    @property
    def _band(self) -> tuple[float, float]:
        """The smallest and the largest distance (m) outside of the flat face at which contact is expected to end."""
        least, largest = self.edge_band
        return least - self.section.flat, largest - self.section.flat

    @property
    def expected_radius(self) -> float:
        """Distance (m) from the axis to the corners of the expected contact."""
        return hypot(*self._sides(self._band[1]))

    def profile(self, points: FloatArray) -> FloatArray:
        """Return the heights (m) of the tool, infinite beyond its rounded corners."""
        beyond = np.hypot(*np.maximum(np.abs(points) - self._sides(0.0), 0.0).T)
        height = self.section.height(self.section.flat + np.minimum(beyond, self.edge))
        return np.where(beyond <= (1 + ON_EDGE) * self.edge, height, np.inf)

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to the blade and to the prism above it."""
        ends, sides = slab(self.length / 2, points, axis=0), slab(self.width / 2, points, axis=1)
        return intersection(ends, sides, above(points), rounding=self.edge)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return a mask of points at its own sides."""
        at_side: BoolArray = np.any(np.abs(points) >= (1 - ON_EDGE) * self._sides(self.edge), axis=1)
        return at_side

    @property
    def rim_size(self) -> tuple[float, float]:
        """Length (m) and area (m²) of the frame in which contact is expected to end."""
        inner, outer = map(self._sides, self._band)
        return float(2 * (inner + outer).sum()), float(4 * (outer.prod() - inner.prod()))

    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the frame in which contact is expected to end, including the depth, as text."""
        inner, outer = (
            to_rectangle(f"(Fabs({along})-{unit * half_length:.12g})", f"(Fabs({across})-{unit * half_width:.12g})")
            for half_length, half_width in map(self._sides, self._band)
        )
        aside = f"Max(Max({outer},-{inner}),0)"
        return f"Sqrt({aside}^2+Max(Fabs({height})-{unit * self.depths[1]:.12g},0)^2)"

    def check(self, problems: Problems) -> None:
        """Report an edge that leaves no face."""
        if self.edge >= min(self.length, self.width) / 2:
            problems.error(
                "probe.edge",
                in_mm(self.edge),
                f"leaves no flat face of a blade {in_mm(min(self.length, self.width))} wide: use a smaller edge",
            )
            return
        super().check(problems)
