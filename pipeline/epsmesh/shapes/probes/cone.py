"""A cone, sharp or rounded."""

from math import nan
from typing import Annotated, Literal

from epsmesh.shapes.probes._round import RoundIndenter
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.units import Angle, Length, Rounding


class Cone(RoundIndenter):
    """A needle's tip: a cone, sharp or rounded, on a shaft. Friction along the shaft is that of an insertion."""

    REALTIME = ("unilateral",)

    shape: Literal["cone"]
    angle: Annotated[
        Angle, Words("Half angle between axis and flank; a larger one is blunter.", '"70 deg"', is_used=True)
    ]
    radius: Annotated[Length, Words("Radius of the shaft, where the cone ends.", '"3 mm"', is_used=True)]
    tip: Annotated[Rounding, Words("Radius of the rounded tip. 0 is sharp.", '"0.2 mm"')] = 0.0

    @property
    def section(self) -> Rounded:
        """A straight flank, rounded at the tip."""
        return Rounded(self.angle, self.tip)

    @property
    def force_exponent(self) -> float | None:
        """2 (A. E. H. Love) if it is sharp."""
        return None if self.tip else 2.0

    @property
    def mean_square(self) -> float:
        """Half the square of the contact radius (m²) if it is sharp: a third, times 3/2."""
        return nan if self.tip else self.contact_width**2 / 2

    @property
    def limit(self) -> float:
        """Radius (m) of the shaft."""
        return self.radius

    def realtime_error(self) -> str:
        """Return that a rounding is not supported."""
        return f"probe.tip = {in_mm(self.tip)}: real-time models support a sharp cone only" if self.tip else ""

    def check(self, problems: Problems) -> None:
        """Report a rounding that leaves no cone, and a depth beyond the whole cone."""
        if self.section.tangent >= self.radius:
            problems.error(
                "probe.tip",
                in_mm(self.tip),
                f"leaves no cone: the rounding would extend to {in_mm(self.section.tangent)} "
                f"from the axis, but the shaft has radius {in_mm(self.radius)}; use a smaller tip, or a sphere",
            )
        elif not self.is_inserted and self.section.reach(depth := max(self.depth, self.depths[1])) >= self.radius:
            problems.error(
                "probe.depth",
                in_mm(depth),
                f"presses the cone in up to its shaft of radius {in_mm(self.radius)}: "
                "use a smaller depth, or a larger radius",
            )
        else:
            super().check(problems)
