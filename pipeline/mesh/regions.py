"""Element sizes of layers and inclusions, in addition to those of the study."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.scene.model import Scene
from pipeline.shapes.body import Body
from pipeline.shapes.frame import Vector
from pipeline.shapes.ovoid import Ovoid
from pipeline.shapes.regions import Inclusion

# Element size on an inclusion in units of its smallest semi-axis, and in a layer below the probe in units of its
# thickness. With elements of degree 2, F is then within .1 and .4 % of its value for half these sizes
# (docs/accuracy.md), and the error bar accounts for the rest.
_ON_INCLUSION = 0.4
_IN_LAYER = 0.5
# Sampling points on an inclusion, for the point nearest to anything else.
_POINTS = 2000


# Largest element size along the probe's edge, in units of the size for a thin layer below it. At 4 some meshes have
# flat elements, at 10 most, and F errs by more than its bar.
_LONGER = 2


def longest_at_rim(body: Body) -> float:
    """Return the largest element size (m) along the probe's edge above a thin layer; infinite without one."""
    return _LONGER * _IN_LAYER * (body.heights[1] - body.interfaces[0]) if body.interfaces else inf


def region_sizes(scene: Scene, growth: float) -> Iterator[str]:
    """Yield the element sizes of the regions of a body, as text for gmsh in units of the model.

    They grow by ``growth`` per unit of distance.
    """
    body, unit = scene.body, 1 / scene.scale
    low, high = body.heights
    # The part below the last interface is treated as a layer, too.
    heights = (high, *body.interfaces, low) if body.interfaces else ()
    for top, bottom in pairwise(heights):
        yield _in_layer(scene, (unit * bottom, unit * top), growth)
    for inclusion in inclusion_sizes(body, growth):
        yield from inclusion.terms(unit)


@dataclass(frozen=True)
class InclusionSizes:
    """Element sizes (m) of an inclusion: on its ``surface``, and at the point ``nearest`` to anything else.

    At that point they are at most the ``room`` (m) between the two. They grow by ``growth`` per unit of distance.
    """

    surface: Ovoid
    nearest: Vector
    room: float
    growth: float

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3)."""
        on_it = min(self.surface.axes) * (_ON_INCLUSION + self.growth * np.abs(self.surface.level(points) - 1))
        return np.minimum(on_it, self.room + self.growth * np.linalg.norm(points - np.array(self.nearest), axis=1))

    def terms(self, unit: float) -> tuple[str, str]:
        """Return the two sizes, whose minimum counts, as text for gmsh, with ``unit`` units in a metre."""
        surface = self.surface
        least = unit * min(surface.axes)
        level = "+".join(
            f"((({name})-({unit * c:.12g}))/{unit * a:.12g})^2"
            for name, c, a in zip("xyz", surface.centre, surface.axes, strict=True)
        )
        return (
            f"{least:.12g}*({_ON_INCLUSION}+{self.growth:.12g}*Abs(Sqrt({level})-1))",
            f"{unit * self.room:.12g}+{self.growth:.12g}*{_distance(self.nearest, unit)}",
        )


def inclusion_sizes(body: Body, growth: float) -> tuple[InclusionSizes, ...]:
    """Return the element sizes of the inclusions of a body."""
    return tuple(InclusionSizes(one.surface, *_nearest(body, one), growth) for one in body.inclusion)


def _in_layer(scene: Scene, heights: tuple[float, float], growth: float) -> str:
    """Return the element size in a layer as text: fine below the probe, within the layer's thickness of it."""
    bottom, top = heights
    unit = 1 / scene.scale
    beyond = unit * scene.probe.circumradius + unit * scene.body.heights[1] - bottom
    away = f"Max({_distance(scene.frame.point, unit)}-({beyond:.12g}),0)"
    off = f"Max(Max({bottom:.12g}-z,z-({top:.12g})),0)"
    return f"{_IN_LAYER * (top - bottom):.12g}+{growth:.12g}*({off}+{away})"


def _distance(point: Vector, unit: float) -> str:
    squares = "+".join(f"({name}-({unit * c:.12g}))^2" for name, c in zip("xyz", point, strict=True))
    return f"Sqrt({squares})"


def _nearest(body: Body, inclusion: Inclusion) -> tuple[Vector, float]:
    """Return the point of an inclusion that is nearest to anything else, and its distance (m) from that."""
    points = inclusion.surface.sample(_POINTS)
    rooms: list[FloatArray] = [body.inside(points)]
    rooms += [np.abs(points[:, 2] - height) for height in body.interfaces]
    rooms += [other.surface.distance(points) for other in body.inclusion if other is not inclusion]
    room = np.min(rooms, axis=0)
    x, y, z = map(float, points[int(np.argmin(room))])
    return (x, y, z), float(room.min())
