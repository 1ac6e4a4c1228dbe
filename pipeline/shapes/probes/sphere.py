"""A sphere."""

from typing import Annotated, ClassVar, Literal

from pipeline.shapes.probes._round import RoundIndenter
from pipeline.shapes.rounded import Rounded
from pipeline.shapes.section import Problems, Words, in_mm
from pipeline.units import Length


class Sphere(RoundIndenter):
    """A ball, such as the tip of a palpating probe."""

    REALTIME = ("unilateral",)
    # 3/2 (H. Hertz), as long as contact is small beside the ball.
    force_exponent: ClassVar[float | None] = 1.5

    shape: Literal["sphere"]
    radius: Annotated[Length, Words("Radius of the ball.", '"6 mm"', is_used=True)]

    @property
    def section(self) -> Rounded:
        """A circle: it has no flank."""
        return Rounded(0.0, self.radius)

    @property
    def mean_square(self) -> float:
        """8/15 of the square of the radius of contact (m²): 2/5 of it, times 4/3."""
        return 8 / 15 * self.contact_width**2

    @property
    def limit(self) -> float:
        """The radius (m): tissue does not reach round the equator."""
        return self.radius

    def check(self, problems: Problems) -> None:
        """Report a ball that would be pushed in past its equator."""
        if (depth := max(self.depth, self.depths[1])) >= self.radius:
            problems.error(
                "probe.depth",
                in_mm(depth),
                f"must be less than the sphere's radius {in_mm(self.radius)}: past "
                "its equator it does not press any more",
            )
            return
        super().check(problems)
