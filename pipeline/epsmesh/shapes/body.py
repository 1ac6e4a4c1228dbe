"""The interface of every body. It has no defaults: a class that leaves out a property cannot be instantiated."""

from abc import ABC, abstractmethod
from itertools import accumulate
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from epsmesh.arrays import FloatArray
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.closed import Closed
from epsmesh.shapes.frame import Frame, Units, Vector
from epsmesh.shapes.ground import Ground
from epsmesh.shapes.half_plane import HalfPlane
from epsmesh.shapes.part import Around, is_part_mirrored
from epsmesh.shapes.regions import Embedded, Inclusion, Layer, Loose, Region
from epsmesh.shapes.resting import OnBottom, Resting
from epsmesh.shapes.section import Section, Words, kept
from epsmesh.shapes.segment import Segment
from epsmesh.shapes.support import Below, Fixed, Support, support_of
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.tissue import Tissue
from epsmesh.units import canonical

# Keys of a body's regions.
PIECES = ("layer", "inclusion", "region")
# Layers fill the body if their sum differs from its height by at most this share.
_SAME = 1e-9
# An embedded region is centred on the z axis within this share of the extent.
_ON_AXIS = 1e-9
# Sampling points on an embedded region.
_POINTS = 2000


class Body(Section, ABC):
    """A body of tissue in its own coordinates, and its support.

    A place on it is the :class:`Frame` of a probe there.
    """

    shape: Annotated[str, Words("Shape of the body.", '"box"', is_used=True)]
    fixed: Annotated[
        Fixed,
        Words(
            "Support of the body: its bottom, its sides, both, or all tissue below a height. "
            'Displacements are zero there. "none": [body.support], two jaws, or a term of your own in [load] hold the '
            "body.",
            '"bottom"',
            takes='"bottom" | "sides" | "bottom+sides" | {below = length} | "none"',
        ),
    ] = "bottom"
    inclusion: Annotated[
        tuple[Inclusion, ...],
        Words("Inclusions: balls and ellipsoids of another material inside the body.", "[[body.inclusion]]"),
    ] = ()
    region: Annotated[
        tuple[Segment, ...],
        Words("Regions of any shape, of another material, inside the body.", "[[body.region]]"),
    ] = ()

    # Not of its shape: meshes do not depend on it.
    capsule: Annotated[
        Capsule | None,
        Words("Capsule: a membrane on the body's surface.", "[body.capsule]", default="none"),
    ] = None

    is_loaded: Annotated[
        Literal["none", "gravity", "all"],
        Words(
            "Loads under which the body has the given shape: none, gravity alone, or all of [load] and pressures in "
            "hollow regions. The shape without them is computed, and loaded again before the tool presses.",
            '"gravity"',
        ),
    ] = "none"

    def is_capsule_mirrored(self, normal: Vector) -> bool:
        """Tell whether the capsule, if any, is its own image in a plane with that unit normal, as the shape is.

        Those of regions are, as the regions themselves.
        """
        return self.capsule is None or is_part_mirrored(self.capsule.on, normal)

    @kept
    def capsules(self) -> dict[str, Capsule]:
        """Its capsule, and those of its regions, by their places in a study, such as inclusion[2].capsule."""
        regions = zip(self.places, self.regions, strict=True)
        own = {"capsule": self.capsule} if self.capsule else {}
        return own | {
            f"{place}.capsule": piece.capsule.around(piece.name)
            for place, piece in regions
            if isinstance(piece, Embedded) and piece.capsule
        }

    @kept
    def skins(self) -> tuple[Capsule, ...]:
        """The capsules that a tool may touch: its own, and those of regions that may meet its surface."""
        inner = {piece.name for piece in self.embedded} - {piece.name for piece in self.meeting}
        return tuple(one for one in self.capsules.values() if not (isinstance(one.on, Around) and one.on in inner))

    @kept
    def pieces(self) -> dict[str, tuple[Region, ...]]:
        """Its regions with a material of their own, by their key in a study."""
        return {key: found for key in PIECES if (found := getattr(self, key, ()))}

    @kept
    def regions(self) -> tuple[Region, ...]:
        """Regions with a material of their own, numbered from 1 in meshes; 0 is the rest of the body.

        Layers come first, from the top down.
        """
        return tuple(piece for found in self.pieces.values() for piece in found)

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names of the rest of the body and of its regions, in the order of their numbers."""
        return "tissue", *(piece.name for piece in self.regions)

    @kept
    def places(self) -> tuple[str, ...]:
        """Places of its regions in a study, such as inclusion[2], in their order."""
        return tuple(f"{key}[{n}]" for key, found in self.pieces.items() for n in range(1, len(found) + 1))

    @kept
    def embedded(self) -> tuple[Embedded, ...]:
        """The last of its regions: those wholly inside it, each bounded by a closed surface."""
        return tuple(piece for piece in self.regions if isinstance(piece, Embedded))

    @property
    def meeting(self) -> tuple[Embedded, ...]:
        """Those of the embedded regions that may meet each other and the body's surface."""
        return ()

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Heights z (m) of the interfaces between layers of different materials, from the top down."""
        return ()

    @property
    def is_filled(self) -> bool:
        """Whether its layers fill it, so that `[material]` applies nowhere."""
        return False

    def main(self, material: Tissue) -> Tissue:
        """Return ``material``, or where layers fill the body, and it applies nowhere, the first layer."""
        return self.regions[0] if self.is_filled else material

    def completed(self, piece: Region, material: Tissue) -> Region:
        """Return a region with what it lacks of ``material``; of another region, it has nothing."""
        is_hollow = isinstance(piece, Embedded) and piece.is_hollow
        return piece if self.is_filled and not is_hollow else piece.completed(material)

    def completed_by(self, material: Tissue) -> Self:
        """Return the body; what its regions lack of law, relaxation and density, they have from ``material``.

        Where layers fill the body, there is no such material: each region has its own or none.
        """
        if not self.pieces:
            return self
        return self.model_copy(
            update={
                key: tuple(self.completed(piece, material) for piece in found) for key, found in self.pieces.items()
            }
        )

    @property
    def cavities(self) -> dict[str, Closed]:
        """Surfaces of its hollow regions, by name."""
        return {piece.name: piece.surface for piece in self.embedded if piece.is_hollow}

    @property
    def pressures(self) -> dict[str, float]:
        """Pressures (Pa) in its hollow regions, by name, where there is one."""
        return {piece.name: piece.pressure for piece in self.region if piece.hollow and piece.pressure}

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices about what was read from files that the author of the study should know."""
        return tuple(f"{piece.name}: {notice}" for piece in self.region for notice in piece.notices)

    def layer_at(self, height: float) -> int:
        """Return the number of the layer at a height (m), 0 in the rest of the body."""
        if not self.interfaces and not self.is_filled:
            return 0
        number = 1 + sum(height < end for end in self.interfaces)
        return number if self.is_filled or number <= len(self.interfaces) else 0

    @property
    def resting(self) -> Resting | None:
        """The support that lets go, on which it rests; None if its support is fixed."""
        return None

    @property
    def loose(self) -> Loose | None:
        """The layer or the region that lies loose on other tissue; None if all are bonded."""
        pieces = zip(range(1, 1 + len(self.regions)), self.regions, self.places, strict=True)
        found = (Loose(each.name, place, each.friction, (n,)) for n, each, place in pieces if each.contact != "bonded")
        return next(found, None)

    @property
    def ground(self) -> Ground | None:
        """The surface of that support, which the body at rest touches with its lowest points."""
        return None if self.resting is None else self.resting.ground(self.heights[0], self.reach_below)

    def reach_below(self, directions: FloatArray) -> float:
        """Return the largest distance (m) of a point of the bottom from the z axis, in horizontal ``directions``
        (n, 3), unit vectors; infinite without one."""
        return inf

    @kept
    def hold(self) -> Support:
        """The fixed part of its boundary, or the part that rests on a support that lets go."""
        return support_of(self.fixed if self.resting is None else self.resting.on)

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
        """Return the frame at two or three coordinates ``at`` (m); ``axis`` defaults to the inward normal there.

        Two coordinates, x and y, name the highest surface point there; three are projected to the nearest one.

        Raises:
            PlaceError: if a probe cannot touch the body there.
        """

    def frame_below(self, at: tuple[float, ...], axis: Vector | None, around: float) -> Frame:
        """Return the frame for a footprint of radius ``around`` (m): see :meth:`frame`.

        A smooth surface has one normal per point. A surface of triangles has the mean normal below the footprint.
        """
        return self.frame(at, axis)

    @abstractmethod
    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along a probe's axis enter the body near the contact, and the outward unit normals there.

        The lines pass through ``points`` (n, 2), m, in the probe's plane. Both results are (n, 3), the first in m; they
        are NaN for lines that miss the body.
        """

    @abstractmethod
    def thickness(self, frame: Frame) -> float:
        """Return the extent (m) of the body along a probe's axis, below the point of contact."""

    @abstractmethod
    def reach(self, frame: Frame) -> float:
        """Return the largest distance (m) of a point of the body from a probe's axis."""

    @abstractmethod
    def farthest(self, frame: Frame) -> float:
        """Return a distance (m) from the point of contact that no point of the body exceeds."""

    @abstractmethod
    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points (n, 3) to the surface, negative outside."""

    def room(self, surface: Closed) -> float:
        """Return the distance (m) between the body's surface and a ``surface`` inside, negative if that sticks out."""
        return float(self.inside(surface.sample(_POINTS)).min())

    @abstractmethod
    def gap(self, point: Vector) -> float:
        """Return the distance (m) of a point of a face to its edge, negative outside; infinite without edges."""

    @property
    @abstractmethod
    def is_smooth(self) -> bool:
        """Whether its surface has no edges; facets that approximate a smooth surface do not count."""

    @property
    @abstractmethod
    def face(self) -> str:
        """The size of the face under a probe, in words."""

    # ---- symmetry -------------------------------------------------------------------------------------

    # Planes of mirror symmetry of its shape: x = 0 ("x") and y = 0 ("y").
    mirror_planes: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def is_round(self) -> bool:
        """Whether its shape and its regions are axisymmetric about z, whatever its support."""

    @property
    def holds_round(self) -> bool:
        """Whether its regions are axisymmetric about z."""
        return all(piece.surface.has_axis(_ON_AXIS * self.extent) for piece in self.embedded)

    @property
    @abstractmethod
    def half_sides(self) -> tuple[float, float] | None:
        """Half extents (m) along x and y of a body centred on the z axis, twice the radius of a round one; or None."""

    def half_plane(self) -> HalfPlane | None:
        """Return its half plane if it and its regions are axisymmetric about z, otherwise None."""
        return None

    # ---- geometry -------------------------------------------------------------------------------------

    @abstractmethod
    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return all boundary surfaces, by the names that a support can use."""

    @property
    @abstractmethod
    def bend(self) -> float:
        """Smallest radius of curvature (m) of its sides, which elements must resolve; infinite if all are flat."""

    @property
    def curvature(self) -> float:
        """Twice the surface integral (m) of the mean curvature, as far as ``bend`` does not include it."""
        return 0.0

    @abstractmethod
    def outline(self) -> list[FloatArray]:
        """Return its edges as polylines of points (n, 3), in m, for pictures."""


class Drawn(Body):
    """A body drawn by a CAD kernel, centred on the z axis."""

    mirror_planes: ClassVar[tuple[str, ...]] = ("x", "y")

    @abstractmethod
    def draw(self, kernel: Any, units: Units, frame: Frame | None = None) -> int:
        """Add it to a CAD ``kernel`` (gmsh's ``occ``), in the model's ``units``; return the tag of the volume.

        The seam of a curved surface is placed far from ``frame``, where a footprint will be imprinted.
        """


class Layered(Drawn):
    """A body with a flat top, and horizontal layers if any."""

    layer: Annotated[tuple[Layer, ...], Words("Layers of other materials, from the top down.", "[[body.layer]]")] = ()
    support: OnBottom = None

    @property
    def resting(self) -> Resting | None:
        """The support that lets go."""
        return self.support

    @property
    def loose(self) -> Loose | None:
        """The layer that lies loose, or the region; not the lowest layer, which no tissue is below."""
        for number, (layer, height) in enumerate(zip(self.layer, self.interfaces, strict=False), start=1):
            if layer.contact != "bonded":
                parts = tuple(range(1, number + 1))
                return Loose(layer.name, self.places[number - 1], layer.friction, parts, height)
        loose = super().loose
        return None if loose is None or loose.place.startswith("layer") else loose

    @abstractmethod
    def reach_below(self, directions: FloatArray) -> float:
        """Return the largest distance (m) of a point of the bottom from the z axis, in horizontal ``directions``
        (n, 3), unit vectors."""

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Heights z (m) of the interfaces between layers of different materials, from the top down."""
        low, high = self.heights
        ends = (high - total for total in accumulate(layer.thickness or inf for layer in self.layer))
        return tuple(end for end in ends if end - low > _SAME * (high - low))

    @abstractmethod
    def without_top(self, depth: float) -> dict[str, Any]:
        """Return the keys of its size without the tissue above a ``depth`` (m) below the top."""

    def below(self, number: int) -> Self:
        """Return the body without its first ``number`` layers: the top is where they ended."""
        depth = self.heights[1] - self.interfaces[number - 1]
        fixed = self.fixed
        if isinstance(fixed, Below):
            fixed = Below.model_construct(below=canonical(fixed.below + depth))
        changes = self.without_top(depth) | {"layer": self.layer[number:], "fixed": fixed}
        own = {name: getattr(self, name) for name in type(self).model_fields}
        return cast("Self", type(self).model_construct(self.model_fields_set, **(own | changes)))

    @property
    @abstractmethod
    def half_sides(self) -> tuple[float, float]:
        """Half extents (m) of the top along x and y, twice the radius of a round one."""

    @property
    @abstractmethod
    def has_round_top(self) -> bool:
        """Whether the top is a circle about the z axis."""

    @property
    def is_round(self) -> bool:
        """Whether the top and the regions are axisymmetric about z."""
        return self.has_round_top and self.holds_round

    @property
    @abstractmethod
    def corners(self) -> FloatArray:
        """Points (n, 3), in m, whose convex hull contains the body tightly."""

    @abstractmethod
    def far_side(self, x: float, y: float) -> float:
        """Return the largest distance (m) of its sides from a vertical line through x and y (m)."""

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
        """Depth (m) below the top of the first interface between materials, or of the bottom."""
        low, top = self.heights
        ends = [low, *self.interfaces, *(piece.surface.bounds[1][2] for piece in self.embedded)]
        return top - max(ends)

    @abstractmethod
    def to_side(self, point: tuple[float, float], direction: tuple[float, float]) -> float:
        """Return the distance (m) to the side from a point of the top, along a unit vector in it."""

    @property
    def is_filled(self) -> bool:
        """Whether its layers reach the bottom."""
        return len(self.interfaces) < len(self.layer)
