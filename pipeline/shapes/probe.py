"""What every probe tells of itself. There are no defaults for what may be wrong silently."""

from abc import ABC, abstractmethod
from functools import lru_cache
from math import hypot, inf
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from pipeline.arrays import BoolArray, FloatArray
from pipeline.shapes.body import Body
from pipeline.shapes.frame import Frame, Units, Vector
from pipeline.shapes.section import Problems, Section, Words
from pipeline.shapes.slit import Slit
from pipeline.units import Coordinate, Length

# The candidates for mirror planes, by the coordinate that is zero on them, and their normals.
PLANES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
_ALIGNED = 1e-12
_MANY = 200_000  # pairs of body and probe of a large study

Contact = Literal["bonded", "frictionless", "unilateral"]
ON_EDGE = 1e-6  # of a footprint: a point this near to its edge is on it


def _two_or_three(at: tuple[float, ...]) -> tuple[float, ...]:
    if len(at) not in (2, 3):
        raise PydanticCustomError("not_supported", "must be a list of 2 or 3 values")
    return at


class Probe(Section, ABC):
    """A tool: where it touches, how it moves, and its shape.

    Its footprint is what of the surface moves with it, or what of it may come into contact where that is to be found
    (``is_unilateral``). It is described in the probe's own coordinates, along and across it: see :class:`Frame`.
    """

    shape: Annotated[
        str, Words("Shape of the footprint: a blunt needle's tip, or a blade's edge.", '"disc"', is_used=True)
    ]
    action: Annotated[
        Literal["pierce", "cut"], Words("What the tool does; only a blade cuts.", '"pierce"', is_used=True)
    ] = "pierce"
    depth: Annotated[
        Length,
        Words(
            "How far the tool is pushed in. F is proportional to it, unless contact is unilateral or it stands in a "
            "slit.",
            '"0.2 mm"',
            is_used=True,
        ),
    ]
    at: Annotated[
        tuple[Coordinate, ...],
        AfterValidator(_two_or_three),
        Words(
            "Where its axis meets the body: x and y of the highest point there, or three coordinates, from which the "
            "nearest point of the surface is taken.",
            '["0 mm", "0 mm"]',
        ),
    ] = (0.0, 0.0)
    axis: Annotated[
        tuple[float, float, float] | None,
        Words(
            "Direction in which it advances, of any length; at most 60° from the inward normal.",
            "[0.0, 0.0, -1.0]",
            default="the inward normal where it touches",
        ),
    ] = None
    contact: Annotated[
        Contact,
        Words(
            "Tissue sticks to the footprint (bonded), slides along it (frictionless), or slides and may lift off where "
            "it would be pulled (unilateral).",
            '"bonded"',
        ),
    ] = "bonded"
    motion: Annotated[
        Literal["press", "all"],
        Words(
            "Which movements are solved for: those of the study (`press`), or all six rigid motions (`all`), for the "
            "6 × 6 stiffness of the bonded tool: forces and torques about the point of contact.",
            '"all"',
        ),
    ] = "press"

    # Keys that F is proportional to where contact is known, if all of them change together; the first one is the unit
    # of the others.
    PROPORTIONAL_TO: ClassVar[tuple[str, ...]]
    # Keys on which its footprint, and so the mesh, does not depend.
    NOT_DRAWN: ClassVar[tuple[str, ...]]
    # Keys that serve sweeps of a tool on one mesh, and say nothing of the tool itself.
    SWEPT: ClassVar[tuple[str, ...]] = ()
    # Contacts for which real-time models know the tool.
    REALTIME: ClassVar[tuple[Contact, ...]] = ()
    # Error of F on a mesh that is graded to the footprint's edge, in units of that of a disc: docs/accuracy.md.
    EXPECTED_ERROR: ClassVar[float]

    # ---- place and movement ---------------------------------------------------------------------------

    def frame_on(self, body: Body) -> Frame:
        """Return its place on ``body``.

        Raises:
            PlaceError: if it cannot touch the body there.
        """
        return _frame_on(self, body)

    @property
    def lies_along(self) -> Vector:
        """Direction of its length: its key ``direction``, or x for a tool without that key."""
        along: Vector = getattr(self, "direction", (1.0, 0.0, 0.0))
        return along

    def travel(self, frame: Frame) -> Vector:
        """Return the prescribed displacement (m) of the footprint: the depth along the axis, unless it slices, too."""
        return frame.inward(self.depth)

    @property
    def not_drawn(self) -> tuple[str, ...]:
        """Keys on which the mesh does not depend."""
        return self.NOT_DRAWN

    @property
    def is_unilateral(self) -> bool:
        """Whether which part of the footprint is in contact is to be found."""
        return self.contact == "unilateral"

    @property
    def slit(self) -> Slit | None:
        """The slit that it stands in, and whose faces are then all that it touches; None if it is on the surface."""
        return None

    @property
    def proportional_to(self) -> tuple[str, ...]:
        """Keys that F is proportional to: none where more of the tool touches the deeper it is.

        Nor does what holds a slit's faces apart grow with the depth.
        """
        return () if self.is_unilateral or self.slit else self.PROPORTIONAL_TO

    @property
    def scale(self) -> float:
        """The length (m) that F is proportional to; 1 if there is none."""
        return float(getattr(self, self.proportional_to[0])) if self.proportional_to else 1.0

    # ---- size -----------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def circumradius(self) -> float:
        """Radius of the smallest circle round the footprint (m)."""

    @property
    def pressed(self) -> float:
        """Radius (m) of the smallest circle round what goes below the surface: tissue that is held there is in the way.

        Of a flat tool that is all of its footprint.
        """
        return self.circumradius

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
        """Return the distance (m) between the footprint and the edge of the face it touches, negative outside."""

    # ---- symmetry -------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def is_round(self) -> bool:
        """Whether the footprint is the same all round its axis."""

    @abstractmethod
    def is_mirrored(self, along: float, across: float) -> bool:
        """Tell whether the footprint is its own image in the line through its centre normal to (along, across)."""

    # ---- geometry -------------------------------------------------------------------------------------

    @abstractmethod
    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the footprint, at its place, to a CAD ``kernel`` (gmsh's ``occ``); return the tag of the face."""

    @property
    @abstractmethod
    def is_curved(self) -> bool:
        """Whether a part of the footprint's edge is curved, which elements must be bent to follow."""

    @abstractmethod
    def inscribed(self, edges: int) -> "Probe":
        """Return a probe of the same form in which the polygon of ``edges`` equal edges has this one's area."""

    @abstractmethod
    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Write the distance to the footprint's edge, in units of 1/``unit`` m, from text of the own coordinates.

        It is exact at the edge, where elements are smallest, and never off by much.
        """

    @abstractmethod
    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the nearest points (n, 2) of the footprint's edge to ``points`` (n, 2) near it, in m.

        Where no part of the edge is curved, return ``points``: nothing is to be bent.
        """

    @abstractmethod
    def outline(self) -> FloatArray:
        """Return the edge as a closed line of points (n, 2), in m, counterclockwise: what the rest is held against."""

    # ---- contact --------------------------------------------------------------------------------------

    @abstractmethod
    def profile(self, points: FloatArray) -> FloatArray:
        """Return the height (n,), in m, of the tool above its lowest point at ``points`` (n, 2) of its own coordinates.

        It is measured against the axis, and infinite where there is no tool. At a node of the surface, at a height h
        in own coordinates, contact is unilateral if the displacement w along the axis is at least depth - (profile - h)
        and the pressure is not negative, one of them nought.
        """

    @abstractmethod
    def ends_at(self, points: FloatArray) -> BoolArray:
        """Tell of ``points`` (n, 2) on the footprint's edge whether the tool itself ends there (n,).

        Contact that is found to reach the edge elsewhere is cut off by what was taken for a candidate.
        """

    @property
    @abstractmethod
    def has_singular_edge(self) -> bool:
        """Whether the displacement goes like r^½ at the footprint's edge, which is then the edge of contact."""

    @property
    @abstractmethod
    def rim_size(self) -> tuple[float, float]:
        """Length (m) of where contact is expected to end, and its area (m²) if that is not known to the point."""

    @property
    @abstractmethod
    def rim_offset(self) -> float:
        """Distance (m) of the footprint's edge from where contact is expected to end."""

    @abstractmethod
    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Write the distance to where contact is expected to end, as :meth:`edge_distance` does."""

    # ---- on a half-space ------------------------------------------------------------------------------

    @property
    @abstractmethod
    def force_exponent(self) -> float | None:
        """The power of the depth that F goes with on a half-space; None if there is no such power."""

    @property
    @abstractmethod
    def mean_square(self) -> float:
        """Mean square distance (m²) of F from the axis on a half-space, without friction, as it counts for compliance.

        A compliance c + g (s² + s'²)/2 between points at s and s' from the axis adds c + g ``mean_square``. Where
        contact grows with depth, this is the mean square of the pressure times 1 + p / 2n, F going with the power n of
        the depth and the square of the radius with p: energies change by F² times the mean square. NaN where
        that is not known.
        """

    def realtime_error(self) -> str:
        """Return which of its keys no real-time model knows, and what would do; "" if all are known."""
        return ""

    # ---- sense ----------------------------------------------------------------------------------------

    def check(self, problems: Problems) -> None:
        """Report what makes no sense in its keys taken together; what each may be alone its annotation says."""


@lru_cache(_MANY)
def _frame_on(probe: Probe, body: Body) -> Frame:
    return body.frame_below(probe.at, probe.axis, probe.circumradius).facing(probe.lies_along)


def is_direction(vector: Vector) -> bool:
    """Tell whether a vector has a direction."""
    return 0 < hypot(*vector) < inf
