"""Indenters, tools with unknown contact area: the region that they may touch, and where contact is expected to end.

The nodes below the region that a tool may touch, its ``footprint``, are candidates: the solver finds the active ones.
The region is imprinted on the surface like the footprint of a flat tool. Elements are small where contact is expected
to end; nothing is singular at the edge of the candidates.
"""

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, PrivateAttr
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.rounded import Rounded
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.units import Length

# Candidates extend by this factor beyond the intersection of the undeformed tool and surface. On a thin incompressible
# layer, tissue rises beside the tool: to conserve volume a ball touches √2 times as far out, a cone 3/2 times.
CANDIDATES = 1.5
# Contact is expected to end between its edge on a half-space and this factor farther out, because bodies are finite.
BAND = 1.15
# Elements at the edge of contact are as small for a rounding in contact over a width as for a tool so many times wider.
ON_ROUNDING = 2.0
# Depths are equal within this share.
_ROUNDING = 1e-9
# Largest slope of the tool against the surface at the edge of contact: strains are of the same order.
_STEEPEST = 0.3


def _texts(lengths: tuple[float, ...]) -> list[str]:
    return [in_mm(length) for length in lengths]


def _found(value: Any) -> Any:
    if value != "unilateral":
        message = 'must be "unilateral": the contact area of this tool is computed, not prescribed'
        raise PydanticCustomError("not_supported", message)
    return value


class _OfFootprint:
    """Descriptor of a property that an indenter takes from its footprint, under the same name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, probe: "Indenter | None", owner: type) -> Any:
        return self if probe is None else getattr(probe.footprint, self._name)


class Indenter(Probe):
    """A tool with unknown contact area.

    Sizes, symmetry and outline are those of its ``footprint``.
    """

    is_flat: ClassVar[bool] = False
    # Pressure falls to zero at the edge of contact.
    has_singular_edge: ClassVar[bool] = False

    PROPORTIONAL_TO = ()
    # In units of a ball's, whose limit is known best (pipeline/epsmesh/solve/estimate.py).
    EXPECTED_ERROR = 1.4
    NOT_DRAWN: ClassVar[tuple[str, ...]] = ("action", "contact", "friction", "motion")
    SWEPT = ("mesh_depths",)

    depth: Annotated[
        Length,
        Words(
            "Depth of the tool below the first touch, along its axis. With loads, depth 0 is the "
            "first touch of the loaded surface.",
            '"0.5 mm"',
            is_used=True,
        ),
    ]
    mesh_depths: Annotated[
        tuple[Length, Length] | None,
        Words(
            "Range of depths that share one mesh: smallest and largest depth. Elements are small wherever the "
            "contact's edge may be. The initial guess at each depth is the solution at the depth before.",
            '["0.1 mm", "0.5 mm"]',
            default="a mesh for each depth",
        ),
    ] = None
    contact: Annotated[
        Literal["unilateral"],
        BeforeValidator(_found),
        Words("Contact: tissue slides along the tool and may lift off. The contact area is computed.", '"unilateral"'),
    ] = "unilateral"

    # Mean curvature (1/m) of the surface, where contact is expected: it is known with the body alone.
    _bump: float = PrivateAttr(default=0.0)

    # ---- for each indenter to define --------------------------------------------------------------------

    @property
    @abstractmethod
    def section(self) -> Rounded:
        """Its section: the profile of revolution, or the cross-section of an edge."""

    @abstractmethod
    def touching(self, half_width: float) -> Probe:
        """Return the flat tool whose footprint is contact of a ``half_width`` (m)."""

    @property
    @abstractmethod
    def footprint(self) -> Probe:
        """The flat tool whose footprint contains all that this tool may touch at its depth."""

    @property
    @abstractmethod
    def contact_width(self) -> float:
        """Half the expected width (m) of contact: that on an elastic half-space."""

    @abstractmethod
    def distance(self, points: FloatArray) -> Distance:
        """Return the signed distance of ``points`` (n, 3), in m, to the tool: to all that is above its :meth:`profile`.

        Points are in the tool's own coordinates, with heights from its lowest point.
        """

    # ---- properties of the footprint --------------------------------------------------------------------

    circumradius: ClassVar[Any] = _OfFootprint()
    half_width: ClassVar[Any] = _OfFootprint()
    perimeter: ClassVar[Any] = _OfFootprint()
    gap: ClassVar[Any] = _OfFootprint()
    is_round: ClassVar[Any] = _OfFootprint()
    is_mirrored: ClassVar[Any] = _OfFootprint()
    draw: ClassVar[Any] = _OfFootprint()
    is_curved: ClassVar[Any] = _OfFootprint()
    inscribed: ClassVar[Any] = _OfFootprint()
    edge_distance: ClassVar[Any] = _OfFootprint()
    to_edge: ClassVar[Any] = _OfFootprint()
    outline: ClassVar[Any] = _OfFootprint()

    def on_bump(self, curvature: float) -> Self:
        """Return the tool that expects contact with a surface of this mean ``curvature`` (1/m)."""
        tool = self.model_copy()
        tool._bump = curvature
        return tool

    # ---- derived properties -----------------------------------------------------------------------------

    @property
    def not_drawn(self) -> tuple[str, ...]:
        """Keys on which the mesh does not depend; the depth is one of them if one mesh serves many depths."""
        return (*self.NOT_DRAWN, "depth") if self.mesh_depths else self.NOT_DRAWN

    @property
    def depths(self) -> tuple[float, float]:
        """The smallest and the largest depth (m) of the mesh."""
        return self.mesh_depths or (self.depth, self.depth)

    @property
    def contact_widths(self) -> tuple[float, float]:
        """Half the expected widths (m) of contact at these depths."""
        least, largest = (self.model_copy(update={"depth": depth}).contact_width for depth in self.depths)
        return least, largest

    @property
    def candidate_width(self) -> float:
        """Half the width (m) of the region that it may touch, however wide the tool is."""
        flat = self.section.flat
        return flat + CANDIDATES * (self.section.reach(self.depths[1]) - flat)

    @property
    def edge_width(self) -> float:
        """Length (m) that elements at the expected edge of contact resolve: half the width of contact.

        Beside a flat face, contact ends on a narrow rounding.
        """
        flat = self.section.flat
        return min(self.contact_width, ON_ROUNDING * (self.contact_width - flat)) if flat else self.contact_width

    @property
    @abstractmethod
    def expected_radius(self) -> float:
        """Radius (m) of the smallest circle about the axis that contains the expected contact."""

    @property
    def edge_band(self) -> tuple[float, float]:
        """The smallest and the largest half width (m) at which contact is expected to end."""
        most = self.footprint.half_width
        least, largest = self.contact_widths
        return min(least, most), min(BAND * largest, most)

    @property
    def contact_ends(self) -> tuple[Probe, ...]:
        """The flat tools of these half widths."""
        return tuple(map(self.touching, self.edge_band))

    @property
    def rim_offset(self) -> float:
        """Distance (m) from the expected edge of contact to that of the candidates."""
        return self.footprint.half_width - self.edge_band[1]

    def check_tip(self, problems: Problems) -> None:
        """Report the keys of a tool that deforms, and a depth at which its side is steep where contact ends."""
        super().check_tip(problems)
        flat, (_, widest), tip = self.section.flat, self.contact_widths, self.tip_shape
        if tip and flat + BAND * (widest - flat) > tip.face and self.force is None:
            told = (
                "is too large for a tool that deforms: its side is steep where contact ends. Omit `young`, or use less"
            )
            problems.error("probe.depth", in_mm(self.depths[1]), told)

    def check(self, problems: Problems) -> None:
        """Report a depth outside the range of the mesh."""
        least, largest = self.depths
        if least > largest:
            problems.error("probe.mesh_depths", _texts(self.depths), "must begin with the smaller depth")
        elif not (1 - _ROUNDING) * least <= self.depth <= (1 + _ROUNDING) * largest:
            problems.error(
                "probe.depth",
                in_mm(self.depth),
                f"is outside mesh_depths, {in_mm(least)} to {in_mm(largest)}, "
                "for which the mesh is made: widen it, or leave it out for one mesh per depth",
            )

    def warn_of_strains(self, problems: Problems) -> None:
        """Warn of a depth at which the slope of the tool at the edge of contact is steep: strains are of that order."""
        if self.section.flat:
            super().warn_of_strains(problems)
            return
        if self.contact_width >= self.footprint.half_width:  # an error of its own
            return
        slope = float(self.section.slope(np.array([self.contact_width]))[0])
        if slope > _STEEPEST:
            problems.warn(
                "probe.depth",
                f"{self.depth * 1e3:.4g} mm",
                f"the {self.shape} has a slope of {slope:.2g} against the surface at the edge of contact, and strains "
                f"are of that order: above {_STEEPEST:g} linear elasticity is an extrapolation",
            )
