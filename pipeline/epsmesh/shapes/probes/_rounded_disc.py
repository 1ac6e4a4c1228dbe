"""A disc whose edge is rounded: contact ends on the rounding."""

from math import nan
from typing import ClassVar, Literal

from epsmesh.shapes.probes._flat_needle import FlatNeedle
from epsmesh.shapes.probes._round import RoundIndenter
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Problems, in_mm
from epsmesh.units import Length


class RoundedDisc(FlatNeedle, RoundIndenter):
    """A disc with its edge rounded to the radius ``edge`` (m), in unilateral contact: `shape = "disc"` in a study."""

    # None: contact grows on the rounding while the face stays in contact.
    force_exponent: ClassVar[float | None] = None
    # Unknown.
    mean_square: ClassVar[float] = nan

    shape: Literal["disc"]
    radius: Length
    edge: Length

    @property
    def section(self) -> Rounded:
        """A flat face, and a quarter of a circle."""
        return Rounded(0.0, self.edge, max(self.radius - self.edge, 0.0))  # none is left of it: see `check`

    @property
    def limit(self) -> float:
        """The radius (m) of the disc: contact ends below its side."""
        return self.radius

    def check(self, problems: Problems) -> None:
        """Report an edge that leaves no face, and a withdrawal from a ring crack."""
        if self.edge >= self.radius:
            problems.error(
                "probe.edge",
                in_mm(self.edge),
                f"leaves no flat face of a disc of radius {in_mm(self.radius)}: use a smaller edge, or a sphere",
            )
            return
        if self.insertion is not None and self.insertion.withdraw and self.crack_shape != "plane":
            problems.error(
                "probe.insertion.withdraw",
                True,
                "the column within a ring crack stretches again, which is not computed: omit it, or use "
                'crack_shape = "plane"',
            )
            return
        super().check(problems)
