"""Element sizes of the regions of a body, in addition to those of the study."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import inf
from typing import Any, Protocol

import gmsh
import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray
from epsmesh.plan.estimate import FAR, FLATTEST, IN_LAYER
from epsmesh.scene.model import Scene
from epsmesh.shapes.body import Body
from epsmesh.shapes.closed import FarSizes
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.shell import Shell

# Elements on a surface of triangles have sizes in steps of this factor, each with the points of its own part.
_STEP = 1.3
# On coarse meshes the points of a part are so many elements apart: gmsh's time is that for the nearest of them.
_APART = 0.5
# Sampling points on an embedded region, for the point nearest to anything else.
_POINTS = 2000
_MANY = 1000  # cached points


# Largest element size along the probe's edge, in units of the size for a thin layer below it. At 4 some meshes have
# flat elements, at 10 most, and F errs by more than its bar.
_LONGER = 2


def longest_at_rim(body: Body) -> float:
    """Return the largest element size (m) along the probe's edge above a thin layer; infinite without one."""
    return _LONGER * IN_LAYER * (body.heights[1] - body.interfaces[0]) if body.interfaces else inf


class LocalSizes(Protocol):
    """Upper limits of the element size (m) near a part of a scene."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the limit (m) at points (n, 3)."""

    def terms(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield limits, whose minimum counts, as text for gmsh, with ``unit`` units in a metre.

        Points that they refer to are added to gmsh's current model with its ``kernel``.
        """


def region_sizes(scene: Scene, growth: float, largest: float = inf, coarseness: float = 0.0) -> tuple[LocalSizes, ...]:
    """Return the element sizes of the regions of a body, which grow by ``growth`` per unit of distance.

    No element exceeds the ``largest`` size (m) anyway; ``coarseness`` is that of :class:`.FarSizes`.
    """
    body, contact = scene.body, scene.frame.point
    low, high = body.heights
    # The part below the last interface is treated as a layer, too.
    heights = (high, *body.interfaces, low) if body.interfaces else ()
    layers = [
        LayerSizes(bottom, top, contact, scene.probe.circumradius + high - bottom, growth, largest)
        for top, bottom in pairwise(heights)
    ]
    return (*layers, *embedded_sizes(body, scene.probe.far_sizes(scene.frame, growth, coarseness)))


@dataclass(frozen=True)
class LayerSizes:
    """Element sizes (m) in a layer between two heights, within a distance ``reach`` of the ``contact``; all in m.

    Farther away they grow, but not until elements are flat. ``largest`` is the size that no element exceeds anyway.
    """

    bottom: float
    top: float
    contact: Vector
    reach: float
    growth: float
    largest: float = inf

    @property
    def thickness(self) -> float:
        """Thickness (m) of the layer."""
        return self.top - self.bottom

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3)."""
        off = np.maximum(np.maximum(self.bottom - points[:, 2], points[:, 2] - self.top), 0.0)
        away = np.maximum(np.linalg.norm(points - np.array(self.contact), axis=1) - self.reach, 0.0)
        flattest = FLATTEST * self.thickness * np.maximum(away / (FAR * self.reach), 1.0)
        size = np.minimum(IN_LAYER * self.thickness + self.growth * away, flattest)
        return np.asarray(size + self.growth * off)

    def terms(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the same as text for gmsh."""
        bottom, top = unit * self.bottom, unit * self.top
        away = f"Max({_distance(self.contact, unit)}-({unit * self.reach:.12g}),0)"
        off = f"Max(Max({bottom:.12g}-z,z-({top:.12g})),0)"
        yield f"{IN_LAYER * (top - bottom):.12g}+{self.growth:.12g}*({off}+{away})"
        if FLATTEST * self.thickness < self.largest:
            farther = f"Max({away}/{unit * FAR * self.reach:.12g},1)"
            yield f"{FLATTEST * (top - bottom):.12g}*{farther}+{self.growth:.12g}*{off}"


@dataclass(frozen=True, eq=False)
class PointSizes:
    """Elements of one ``size`` (m) at ``points`` (n, 3), in m."""

    size: float
    points: FloatArray
    growth: float

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3)."""
        return np.asarray(self.size + self.growth * self._tree.query(points)[0])

    def terms(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the same as text for gmsh."""
        yield f"{unit * self.size:.12g}+{self.growth:.12g}*F{distance_field(self.points * unit, kernel)}"


@dataclass(frozen=True, eq=False)
class EmbeddedSizes:
    """Element sizes (m) of an embedded region: on its surface, and at the point ``nearest`` to anything else.

    At that point they are at most the ``room`` (m) between the two. They grow by ``growth`` per unit of distance.
    """

    nearest: Vector
    room: float
    growth: float

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3)."""
        return np.minimum(
            self.on_surface(points), self.room + self.growth * np.linalg.norm(points - np.array(self.nearest), axis=1)
        )

    def terms(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the same as text for gmsh."""
        yield from self.terms_on_surface(unit, kernel)
        yield f"{unit * self.room:.12g}+{self.growth:.12g}*{_distance(self.nearest, unit)}"

    def on_surface(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) that the surface needs."""
        raise NotImplementedError

    def terms_on_surface(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the sizes that the surface needs as text for gmsh: see :meth:`terms`."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class OvoidSizes(EmbeddedSizes):
    """Those of an ellipsoid, ``far`` from a tool."""

    surface: Ovoid
    far: FarSizes

    @cached_property
    def _size(self) -> float:
        """The size (m) on the surface."""
        return float(self.surface.sizes(self.far)[1][0])

    def on_surface(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) by the factor that scales the surface to them."""
        return self._size + self.growth * self.surface.least * np.abs(self.surface.level(points) - 1)

    def terms_on_surface(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the same as text for gmsh."""
        surface = self.surface
        level = "+".join(
            f"((({name})-({unit * c:.12g}))/{unit * a:.12g})^2"
            for name, c, a in zip("xyz", surface.centre, surface.axes, strict=True)
        )
        yield f"{unit * self._size:.12g}+{self.growth * unit * surface.least:.12g}*Abs(Sqrt({level})-1)"


@dataclass(frozen=True, eq=False)
class ShellSizes(EmbeddedSizes):
    """Those of a surface of triangles: each part of it has elements by its own thickness, ``far`` from a tool."""

    surface: Shell
    far: FarSizes

    @cached_property
    def _parts(self) -> list[PointSizes]:
        """Parts with elements of one size."""
        points, sizes, areas = self.surface.sizes(self.far)
        least = float(sizes.min())
        step = np.floor(np.log(sizes / least) / np.log(_STEP)).astype(int)
        parts = []
        for number in np.unique(step).tolist():
            size = least * _STEP**number
            every = max(1, int(self.far.coarseness * (_APART * size) ** 2 / areas[0]))
            parts.append(PointSizes(size, points[step == number][::every], self.growth))
        return parts

    def on_surface(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) by their distance to parts of the surface."""
        return np.asarray(np.min([part.at(points) for part in self._parts], axis=0))

    def terms_on_surface(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield the same as text for gmsh."""
        for part in self._parts:
            yield from part.terms(unit, kernel)


def embedded_sizes(body: Body, far: FarSizes) -> tuple[EmbeddedSizes, ...]:
    """Return the element sizes of the embedded regions of a body, ``far`` from a tool that touches it."""

    def sizes(piece: Embedded) -> EmbeddedSizes:
        at, growth = _nearest(body, piece), far.of_regions
        if isinstance(surface := piece.surface, Shell):
            return ShellSizes(*at, growth, surface, far)
        assert isinstance(surface, Ovoid)
        return OvoidSizes(*at, growth, surface, far)

    return tuple(map(sizes, body.embedded))


def distance_field(points: FloatArray, kernel: Any) -> int:
    """Add points (n, 3), in units of gmsh's current model, with its ``kernel``; return the field of the distance.

    The kernel is to be synchronized before meshing.
    """
    tags = [kernel.addPoint(*point) for point in points.tolist()]
    field = gmsh.model.mesh.field
    distance = int(field.add("Distance"))
    field.setNumbers(distance, "NodesList", tags)
    return distance


def _distance(point: Vector, unit: float) -> str:
    squares = "+".join(f"({name}-({unit * c:.12g}))^2" for name, c in zip("xyz", point, strict=True))
    return f"Sqrt({squares})"


@lru_cache(_MANY)
def _nearest(body: Body, piece: Embedded) -> tuple[Vector, float]:
    """Return the point of an embedded region that is nearest to anything else, and its distance (m) from that.

    Regions that may meet, and meet the body's surface, need no elements between them.
    """
    points, meeting = piece.surface.sample(_POINTS), body.meeting
    meets = piece in meeting
    rooms: list[FloatArray] = [np.full(len(points), body.extent)] if meets else [body.inside(points)]
    rooms += [np.abs(points[:, 2] - height) for height in body.interfaces]
    rooms += [
        other.surface.distance(points)
        for other in body.embedded
        if other is not piece and not (meets and other in meeting)
    ]
    room = np.min(rooms, axis=0)
    x, y, z = map(float, points[int(np.argmin(room))])
    return (x, y, z), float(room.min())
