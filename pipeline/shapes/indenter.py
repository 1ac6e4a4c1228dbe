"""Tools whose area of contact is not known beforehand: what they may touch, and where contact is expected to end.

The nodes below what a tool may touch, its ``footprint``, are candidates: a solver finds which of them are in contact.
That region is imprinted on the surface like the footprint of a flat tool; elements are small where contact is expected
to end, and nothing is singular at the edge of the candidates.
"""

from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from pipeline.shapes.probe import Probe
from pipeline.shapes.rounded import Rounded
from pipeline.shapes.section import Problems, Words, in_mm
from pipeline.units import Length

# Candidates reach this far past where the undeformed tool and surface intersect: on a thin incompressible layer tissue
# is pushed up beside the tool, and a ball touches √2 and a cone 3/2 times as far out, so that its volume is kept.
CANDIDATES = 1.5
# Contact is expected to end between its edge on a half-space and this much farther out: bodies are finite.
BAND = 1.15
# Depths that differ by less than this share are one.
_ROUNDING = 1e-9
# The steepest a tool may stand on the surface at the edge of contact: strains are of that order.
_STEEPEST = 0.3


def _texts(lengths: tuple[float, ...]) -> list[str]:
    return [in_mm(length) for length in lengths]


def _found(value: Any) -> Any:
    if value != "unilateral":
        message = 'must be "unilateral": how much of this tool touches the tissue is found, not prescribed'
        raise PydanticCustomError("not_supported", message)
    return value


class _OfFootprint:
    """What a tool has from its footprint, by the same name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, probe: "Indenter | None", owner: type) -> Any:
        return self if probe is None else getattr(probe.footprint, self._name)


class Indenter(Probe):
    """A tool of which no one knows beforehand how much will touch the tissue.

    Sizes, symmetry and outline are those of its ``footprint``.
    """

    # Contact ends where the pressure has fallen to nought.
    has_singular_edge: ClassVar[bool] = False

    PROPORTIONAL_TO = ()
    # On meshes graded to where contact ends nothing is singular: not more than a disc's.
    EXPECTED_ERROR = 1.0
    NOT_DRAWN: ClassVar[tuple[str, ...]] = ("action", "contact", "motion")
    SWEPT = ("depth_range",)

    action: Literal["pierce"] = "pierce"
    depth: Annotated[
        Length,
        Words(
            "How far the tool is pushed in along its axis, from where it first touches the surface as loads leave it.",
            '"0.5 mm"',
            is_used=True,
        ),
    ]
    depth_range: Annotated[
        tuple[Length, Length] | None,
        Words(
            "Least and largest depth of a sweep on one mesh: nodes where the tool touches at the largest, small "
            "elements wherever contact ends in between. Such a sweep starts each depth from its neighbours.",
            '["0.1 mm", "0.5 mm"]',
            default="a mesh for each depth",
        ),
    ] = None
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

    # ---- what is the footprint's ----------------------------------------------------------------------

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

    # ---- what follows ---------------------------------------------------------------------------------

    @property
    def not_drawn(self) -> tuple[str, ...]:
        """Keys on which the mesh does not depend: nor on the depth, where the mesh is one for many."""
        return (*self.NOT_DRAWN, "depth") if self.depth_range else self.NOT_DRAWN

    @property
    def depths(self) -> tuple[float, float]:
        """The least and the largest depth (m) that the mesh is for."""
        return self.depth_range or (self.depth, self.depth)

    @property
    def contact_widths(self) -> tuple[float, float]:
        """Half the widths (m) of contact that are expected at these depths."""
        least, largest = (self.model_copy(update={"depth": depth}).contact_width for depth in self.depths)
        return least, largest

    @property
    @abstractmethod
    def expected_radius(self) -> float:
        """Radius (m) of the smallest circle about the axis that contact is expected to stay within."""

    @property
    def half_length(self) -> float:
        """Half the length (m) along which it touches at any depth; 0 unless it has a straight edge."""
        return 0.0

    @property
    def edge_band(self) -> tuple[float, float]:
        """The least and the largest half width (m) at which contact is expected to end."""
        most = self.footprint.half_width
        least, largest = self.contact_widths
        return min(least, most), min(BAND * largest, most)

    @property
    def rim_offset(self) -> float:
        """How far (m) the candidates reach past where contact is expected to end."""
        return self.footprint.half_width - self.edge_band[1]

    def check(self, problems: Problems) -> None:
        """Report a depth that the mesh is not for, and warn of one at which strains are large."""
        least, largest = self.depths
        if least > largest:
            problems.error("probe.depth_range", _texts(self.depths), "must begin with the smaller depth")
        elif not (1 - _ROUNDING) * least <= self.depth <= (1 + _ROUNDING) * largest:
            problems.error(
                "probe.depth",
                in_mm(self.depth),
                f"is not within depth_range, {in_mm(least)} to {in_mm(largest)}, "
                "which the mesh is for: widen that, or leave it out for a mesh of each depth",
            )
        slope = float(self.section.slope(np.array([self.contact_width]))[0])
        if slope > _STEEPEST:
            problems.warn(
                "probe.depth",
                f"{self.depth * 1e3:.4g} mm",
                f"the {self.shape} stands on the surface at a slope of {slope:.2g} where contact ends, and strains are "
                f"of that order: above {_STEEPEST:g} linear elasticity is an extrapolation",
            )
