"""A paraboloid."""

from typing import Annotated, Literal

from epsmesh.arrays import FloatArray
from epsmesh.shapes.distance import Distance, revolved
from epsmesh.shapes.parabola import Parabola, ParabolicContour
from epsmesh.shapes.probes._round import HertzTip
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.units import Length


class Paraboloid(HertzTip):
    """A paraboloid on a shaft, as H. Hertz has it: the model of a worn tip of a force microscope."""

    EXPECTED_ERROR = 1.1

    shape: Literal["paraboloid"]
    radius: Annotated[Length, Words("Radius of curvature at the apex.", '"6 mm"', is_used=True)]
    shaft: Annotated[Length, Words("Radius of the shaft, where the paraboloid ends.", '"5 mm"', is_used=True)]

    @property
    def section(self) -> Parabola:
        """A parabola up to the shaft."""
        return Parabola.up_to(self.shaft, self.radius)

    @property
    def kinks(self) -> tuple[float, ...]:
        """None: it is smooth up to the shaft."""
        return ()

    @property
    def limit(self) -> float:
        """Radius (m) of the shaft."""
        return self.shaft

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to the tool and the shaft above it."""
        return revolved(ParabolicContour(self.section, self.limit), points)

    def check(self, problems: Problems) -> None:
        """Report a depth beyond the whole paraboloid."""
        if not self.is_inserted and self.section.reach(depth := max(self.depth, self.depths[1])) >= self.shaft:
            problems.error(
                "probe.depth",
                in_mm(depth),
                f"presses the paraboloid in up to its shaft of radius {in_mm(self.shaft)}: "
                "use a smaller depth, or a larger shaft",
            )
        else:
            super().check(problems)
