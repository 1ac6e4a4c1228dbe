"""Tools whose area of contact is not known beforehand: what they may touch, and where contact is expected to end.

The nodes below what a tool may touch, its ``footprint``, are candidates: a solver finds which of them are in contact.
That region is imprinted on the surface like the footprint of a flat tool; elements are small where contact is expected
to end, and nothing is singular at the edge of the candidates.
"""

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from pipeline.shapes.arrays import FloatArray, np
from pipeline.shapes.body import Body
from pipeline.shapes.frame import Frame, Units, Vector
from pipeline.shapes.probe import Probe
from pipeline.shapes.rounded import Rounded
from pipeline.shapes.section import Problems, Words
from pipeline.units import Length

# Candidates reach this far past where the undeformed tool and surface intersect: on a thin incompressible layer tissue
# is pushed up beside the tool, and a ball touches √2 and a cone 3/2 times as far out, so that its volume is kept.
CANDIDATES = 1.5
# Contact is expected to end between its edge on a half-space and this much farther out: bodies are finite.
BAND = 1.15
# The steepest a tool may stand on the surface at the edge of contact: strains are of that order.
_STEEPEST = 0.3


def _found(value: Any) -> Any:
    if value != "unilateral":
        message = 'must be "unilateral": how much of this tool touches the tissue is found, not prescribed'
        raise PydanticCustomError("not_supported", message)
    return value


class Indenter(Probe):
    """A tool of which no one knows beforehand how much will touch the tissue.

    Sizes, symmetry and outline are those of its ``footprint``.
    """

    PROPORTIONAL_TO = ()
    # On meshes graded to where contact ends nothing is singular: not more than a disc's.
    EXPECTED_ERROR = 1.0
    NOT_DRAWN: ClassVar[tuple[str, ...]] = ("action", "contact", "motion")

    action: Literal["pierce"] = "pierce"
    depth: Annotated[
        Length, Words("How far the tool is pushed in, from where its lowest point touches.", '"0.5 mm"', is_used=True)
    ]
    contact: Annotated[
        Literal["unilateral"],
        BeforeValidator(_found),
        Words("Tissue slides along the tool, and touches it where it is pressed.", '"unilateral"'),
    ] = "unilateral"

    # ---- what each of them tells ----------------------------------------------------------------------

    @property
    @abstractmethod
    def section(self) -> Rounded:
        """Its section, which is the same all round or all along."""

    @property
    @abstractmethod
    def footprint(self) -> Probe:
        """The flat tool whose footprint holds all that this one may touch at its depth."""

    @property
    @abstractmethod
    def contact_width(self) -> float:
        """Half the width (m) of contact that is expected: that on an elastic half-space."""

    # ---- what follows ---------------------------------------------------------------------------------

    @property
    def edge_band(self) -> tuple[float, float]:
        """The least and the largest half width (m) at which contact is expected to end."""
        most = self.footprint.half_width
        return min(self.contact_width, most), min(BAND * self.contact_width, most)

    @property
    def rim_offset(self) -> float:
        """How far (m) the candidates reach past where contact is expected to end."""
        return self.footprint.half_width - self.edge_band[1]

    @property
    def has_singular_edge(self) -> bool:
        """Contact ends where the pressure has fallen to nought."""
        return False

    @property
    def lies_along(self) -> Vector:
        """The direction of the footprint's length."""
        return self.footprint.lies_along

    def travel(self, frame: Frame) -> Vector:
        """Return the depth along the axis."""
        return frame.inward(self.depth)

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle round the footprint (m)."""
        return self.footprint.circumradius

    @property
    def half_width(self) -> float:
        """Half of the footprint's smallest extent (m)."""
        return self.footprint.half_width

    @property
    def perimeter(self) -> float:
        """Length of the footprint's edge (m)."""
        return self.footprint.perimeter

    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) between the footprint and the edge of the face."""
        return self.footprint.gap(body, frame)

    @property
    def is_round(self) -> bool:
        """Whether the tool is the same all round its axis."""
        return self.footprint.is_round

    def is_mirrored(self, along: float, across: float) -> bool:
        """Tell whether the tool is its own image."""
        return self.footprint.is_mirrored(along, across)

    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the footprint."""
        return self.footprint.draw(kernel, frame, units)

    @property
    def is_curved(self) -> bool:
        """Whether a part of the footprint's edge is curved."""
        return self.footprint.is_curved

    def inscribed(self, edges: int) -> Probe:
        """Return the footprint in which the polygon has this one's area."""
        return self.footprint.inscribed(edges)

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Write the distance to the footprint's edge."""
        return self.footprint.edge_distance(along, across, height, unit)

    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the footprint's edge."""
        return self.footprint.to_edge(points)

    def outline(self) -> FloatArray:
        """Return the footprint's edge."""
        return self.footprint.outline()

    def check(self, problems: Problems) -> None:
        """Warn of a depth at which strains are large."""
        slope = float(self.section.slope(np.array([self.contact_width]))[0])
        if slope > _STEEPEST:
            problems.warn(
                "probe.depth",
                f"{self.depth * 1e3:.4g} mm",
                f"the {self.shape} stands on the surface at a slope of {slope:.2g} where contact ends, and strains are "
                f"of that order: above {_STEEPEST:g} linear elasticity is an extrapolation",
            )
