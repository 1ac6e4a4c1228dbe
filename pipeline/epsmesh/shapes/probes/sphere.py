"""A sphere."""

from typing import Annotated, Literal

from epsmesh.shapes.probes._round import HertzTip
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.units import Length


class Sphere(HertzTip):
    """A ball, such as the tip of a palpating probe; inserted, it is the end of a needle with a shaft of its radius."""

    REALTIME = ("unilateral",)
    EXPECTED_ERROR = 1.0

    shape: Literal["sphere"]
    radius: Annotated[Length, Words("Radius of the ball.", '"6 mm"', is_used=True)]

    @property
    def section(self) -> Rounded:
        """A circle, without a flank."""
        return Rounded(0.0, self.radius)

    @property
    def limit(self) -> float:
        """The radius (m): contact ends below the equator."""
        return self.radius

    def check(self, problems: Problems) -> None:
        """Report a ball pressed in past its equator."""
        if (depth := max(self.depth, self.depths[1])) > self.radius and not self.is_inserted:
            problems.error(
                "probe.depth",
                in_mm(depth),
                f"must be at most the sphere's radius {in_mm(self.radius)}: past its equator contact does not grow",
            )
            return
        super().check(problems)
