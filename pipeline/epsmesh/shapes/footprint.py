"""The footprint of a probe: sizes, symmetry and drawing, which an indenter takes from a flat tool."""

from abc import ABC, abstractmethod
from typing import Any, Self

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import Frame, Units
from epsmesh.shapes.section import Section


class Footprint(Section, ABC):
    """The part of a surface that moves with a tool, or that a tool may touch.

    It is given in the probe's own coordinates, along and across: see :class:`Frame`.
    """

    @property
    @abstractmethod
    def circumradius(self) -> float:
        """Radius of the smallest circle round the footprint (m)."""

    @property
    @abstractmethod
    def half_width(self) -> float:
        """Half of the footprint's smallest extent (m)."""

    @property
    @abstractmethod
    def perimeter(self) -> float:
        """Length of the footprint's edge (m)."""

    @abstractmethod
    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) from the footprint to the edge of its face, negative outside."""

    # ---- symmetry -------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def is_round(self) -> bool:
        """Whether the footprint is axisymmetric about the probe's axis."""

    @abstractmethod
    def is_mirrored(self, along: float, across: float) -> bool:
        """Return whether the footprint has mirror symmetry in the line through its centre normal to (along, across)."""

    # ---- geometry -------------------------------------------------------------------------------------

    @abstractmethod
    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the footprint, in its frame, to a CAD ``kernel`` (gmsh's ``occ``); return the tag of the face."""

    @property
    @abstractmethod
    def is_curved(self) -> bool:
        """Whether a part of the footprint's edge is curved, so that elements must be curved, too."""

    @abstractmethod
    def inscribed(self, edges: int) -> Self:
        """Return a probe of the same shape, enlarged so that its inscribed polygon of ``edges`` has this one's area."""

    @abstractmethod
    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the footprint's edge as text, in units of 1/``unit`` m, from own coordinates as text.

        It is exact at the edge, where elements are smallest, and approximate elsewhere.
        """

    @abstractmethod
    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the nearest points (n, 2) of the footprint's edge to ``points`` (n, 2) near it, in m.

        Without curved edges, return ``points`` unchanged: no element needs to be curved.
        """

    @abstractmethod
    def outline(self) -> FloatArray:
        """Return the edge as a closed polyline (n, 2), in m, counterclockwise: the reference of the other methods."""
