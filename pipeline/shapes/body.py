"""What every body tells of itself. There are no defaults: a body that leaves something out cannot be made."""

from abc import ABC, abstractmethod
from functools import cached_property
from itertools import accumulate
from math import inf
from typing import Annotated, Any, ClassVar

from pipeline.arrays import FloatArray
from pipeline.shapes.frame import Frame, Units, Vector
from pipeline.shapes.half_plane import HalfPlane
from pipeline.shapes.ovoid import Ovoid
from pipeline.shapes.regions import Inclusion, Layer, Region
from pipeline.shapes.section import Section, Words
from pipeline.shapes.support import Fixed, Support, support_of
from pipeline.shapes.surface import Surface

# Layers that miss the height by this share of it fill the body.
_SAME = 1e-9
# Of the extent: an inclusion so near to the z axis is centred on it.
_ON_AXIS = 1e-9
# Points on an inclusion, besides the ends of its axes, that are looked at.
_POINTS = 2000


class Body(Section, ABC):
    """A piece of tissue in its own coordinates, and where it is held.

    Places on it are given as the :class:`Frame` of the probe there.
    """

    shape: Annotated[str, Words("Shape of the body.", '"box"', is_used=True)]
    fixed: Annotated[
        Fixed,
        Words(
            "Where the body is held: on its bottom, its sides, both, or everywhere below a height.",
            '"bottom"',
            takes='"bottom" | "sides" | "bottom+sides" | {below = length}',
        ),
    ] = "bottom"
    inclusion: Annotated[
        tuple[Inclusion, ...], Words("Balls and ellipsoids inside it, of another material.", "[[body.inclusion]]")
    ] = ()

    @property
    def regions(self) -> tuple[Region, ...]:
        """Its pieces of materials of their own, whose numbers in meshes begin with 1; 0 is what none of them is."""
        return self.inclusion

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Heights z (m) at which one of its layers ends and another material begins, from the top down."""
        return ()

    @property
    def is_filled(self) -> bool:
        """Whether its layers leave nothing of it to any other material."""
        return False

    @cached_property
    def support(self) -> Support:
        """What is held of its boundary."""
        return support_of(self.fixed)

    # ---- size -----------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def extent(self) -> float:
        """Largest extent (m)."""

    @property
    @abstractmethod
    def heights(self) -> tuple[float, float]:
        """Lowest and highest z (m)."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume (m³)."""

    # ---- under a probe --------------------------------------------------------------------------------

    @abstractmethod
    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the place that two or three coordinates ``at`` (m) name; ``axis`` defaults to the inward normal there.

        Two are x and y of the highest point of the surface over them; three are projected to the nearest.

        Raises:
            PlaceError: if a probe cannot touch the body there.
        """

    def frame_below(self, at: tuple[float, ...], axis: Vector | None, around: float) -> Frame:
        """Return the place as a footprint of radius ``around`` (m) has it, as :meth:`frame` does.

        A smooth surface has one normal at a point, whatever covers it. One of triangles has that of what is covered.
        """
        return self.frame(at, axis)

    @abstractmethod
    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along a probe's axis through ``points`` (n, 2), in its own plane, enter the body nearby.

        That is (n, 3), in m, not a number where they miss; and the outward unit normals there.
        """

    @abstractmethod
    def thickness(self, frame: Frame) -> float:
        """Return how far (m) the body reaches along a probe's axis, below the point of contact."""

    @abstractmethod
    def reach(self, frame: Frame) -> float:
        """Return the largest distance (m) of a point of the body from a probe's axis."""

    @abstractmethod
    def farthest(self, frame: Frame) -> float:
        """Return a distance (m) from the point of contact within which the whole body lies."""

    @abstractmethod
    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points (n, 3) of the body to its surface, negative outside."""

    def room(self, surface: Ovoid) -> float:
        """Return the distance (m) between the body's surface and another one within, negative if that sticks out."""
        return float(self.inside(surface.sample(_POINTS)).min())

    @abstractmethod
    def gap(self, point: Vector) -> float:
        """Return the distance (m) from a point of a face to its edge, negative outside; infinite if it has none."""

    @property
    @abstractmethod
    def is_smooth(self) -> bool:
        """Whether its surface has no edges, but for facets that stand for what is smooth."""

    @property
    @abstractmethod
    def face(self) -> str:
        """The size of the face that a probe touches, in words."""

    # ---- symmetry -------------------------------------------------------------------------------------

    # The planes, of x = 0 ("x") and y = 0 ("y"), in which its shape is its own image.
    mirror_planes: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def is_round(self) -> bool:
        """Whether its shape and what is in it, wherever it is held, are the same all round the z axis."""

    @property
    def holds_round(self) -> bool:
        """Whether what is in it is the same all round the z axis."""
        return all(
            max(map(abs, piece.at[:2])) <= _ON_AXIS * self.extent and piece.surface.axes[0] == piece.surface.axes[1]
            for piece in self.inclusion
        )

    @property
    @abstractmethod
    def half_sides(self) -> tuple[float, float] | None:
        """Half extents (m) along x and y of a body whose middle is the z axis, of a round one its radius twice."""

    def half_plane(self) -> HalfPlane | None:
        """Return its half plane if it and its regions are the same all round the z axis, None if they are not."""
        return None

    # ---- geometry -------------------------------------------------------------------------------------

    @abstractmethod
    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return all the surfaces that bound it, by the names under which they can be held."""

    @property
    @abstractmethod
    def bend(self) -> float:
        """Radius (m) of the roundest of its sides, which elements must resolve; infinite if all are flat."""

    @property
    def curvature(self) -> float:
        """Integral (m) of the mean curvature over its surface, twice, as far as ``bend`` does not tell of it."""
        return 0.0

    @abstractmethod
    def outline(self) -> list[FloatArray]:
        """Return its edges as lines of points (n, 3), in m, for pictures."""


class Drawn(Body):
    """A body that a CAD kernel draws, its middle on the z axis."""

    mirror_planes: ClassVar[tuple[str, ...]] = ("x", "y")

    @abstractmethod
    def draw(self, kernel: Any, units: Units, frame: Frame | None = None) -> int:
        """Add it to a CAD ``kernel`` (gmsh's ``occ``), in the model's ``units``; return the tag of the volume.

        Where a curved surface must have a seam, it is far from the ``frame`` at which a footprint will be imprinted.
        """


class Layered(Drawn):
    """A body with a flat top, which may be made of horizontal layers."""

    layers: Annotated[
        tuple[Layer, ...], Words("Horizontal layers of other materials, from the top down.", "[[body.layers]]")
    ] = ()

    @property
    def regions(self) -> tuple[Region, ...]:
        """Its layers from the top down, then its inclusions."""
        return (*self.layers, *self.inclusion)

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Heights z (m) at which one of its layers ends and another material begins, from the top down."""
        low, high = self.heights
        ends = (high - total for total in accumulate(layer.thickness or inf for layer in self.layers))
        return tuple(end for end in ends if end - low > _SAME * (high - low))

    @property
    @abstractmethod
    def half_sides(self) -> tuple[float, float]:
        """Half extents (m) of the top along x and y, of a round one its radius twice."""

    @property
    @abstractmethod
    def has_round_top(self) -> bool:
        """Whether the top is a circle about the z axis."""

    @property
    def is_round(self) -> bool:
        """Whether the top and what is in it are the same all round the z axis."""
        return self.has_round_top and self.holds_round

    @property
    @abstractmethod
    def corners(self) -> FloatArray:
        """Points (n, 3), in m, whose convex hull just holds it."""

    @abstractmethod
    def far_side(self, x: float, y: float) -> float:
        """Return the largest distance (m) of its sides from an upright line through x and y (m)."""

    def reach(self, frame: Frame) -> float:
        """Return the largest distance (m) of a corner, or of a side, from a probe's axis."""
        return self.far_side(*frame.point[:2]) if frame.is_upright else frame.reach(self.corners)

    def farthest(self, frame: Frame) -> float:
        """Return the distance (m) of the farthest corner."""
        low, high = self.heights
        if not frame.is_upright:
            return frame.farthest(self.corners)
        return float((self.reach(frame) ** 2 + (high - low) ** 2) ** 0.5)

    @property
    def depth_of_tissue(self) -> float:
        """How far (m) below the top the first other tissue begins, or the bottom lies."""
        low, top = self.heights
        ends = [low, *self.interfaces, *(piece.at[2] + piece.surface.axes[2] for piece in self.inclusion)]
        return top - max(ends)

    @abstractmethod
    def to_side(self, point: tuple[float, float], direction: tuple[float, float]) -> float:
        """Return how far (m) it is from x and y of a point of the top, along a unit vector in it, to the side."""

    @property
    def is_filled(self) -> bool:
        """Whether its layers reach the bottom."""
        return len(self.interfaces) < len(self.layers)
