"""Contacts besides the tool's: a support off which a body may lift, an opposite jaw, or tissue below loose tissue.

A contact is a constraint between nodes of a surface and a distance. All contacts of a body are found together, in one
loop: the tool's nodes have the tool's distance, those above a bed have the bed's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from math import inf

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance, heights_along
from epsmesh.shapes.ground import Ground

# Depths of which gaps are kept: friction goes from one to the next, and asks for both.
_DEPTHS = 4


def above_places(
    distance: Callable[[FloatArray, float], Distance], normal: FloatArray, places: FloatArray
) -> Callable[[FloatArray, float], Distance]:
    """Return the distance of linear elasticity: along a unit ``normal`` of the surface, above ``places`` (n, 3)."""

    @lru_cache(_DEPTHS)
    def heights(depth: float) -> FloatArray:
        return heights_along(normal, lambda points: distance(points, depth), places)

    return lambda points, depth: Distance.along(normal, heights(depth), points - places)


class Kind(Enum):
    """What a bed is."""

    SUPPORT = "support"
    JAW = "jaw"
    TISSUE = "tissue"


@dataclass(frozen=True, eq=False)
class LooseTissue:
    """What lies loose on other tissue: its ``name``, and the numbers of its regions, ``parts``. The rows of ``axes``
    (3, 3) are those of the body's coordinates on the mesh."""

    name: str
    parts: tuple[int, ...]
    axes: FloatArray


@dataclass(frozen=True)
class Bed:
    """A rigid surface by its ``distance`` from points (n, 3), m, where the tool is at a depth (m) from its first touch.

    The body at rest touches it. ``height`` are its heights (m) at rest above points (n, 3) of the undeformed surface,
    along its axis, ``normal``: the unit vector from the bed into the body, in the mean. On it tissue has Coulomb's
    coefficient ``friction``. ``sticks`` says that tissue which touches it is held where that was at rest, without a
    path of friction. A support ``fits`` that touches all of its candidates at rest.

    It is a support, or a jaw that has an edge: ``ends_at`` is a mask of points (n, 3) on the edge of its candidates,
    true where it ends itself. A jaw advances along its normal by ``pace`` times the tool's depth; ``foot`` (m) is on
    its axis, and ``is_sharp`` says that it ends at a sharp edge. ``touched`` is the outward unit normal of the surface
    where a jaw first touches it, if that is inclined to its axis. Or it is what loose ``tissue`` touches, whose
    displacements are those relative to it.
    """

    distance: Callable[[FloatArray, float], Distance]
    normal: tuple[float, float, float]
    height: Callable[[FloatArray], FloatArray]
    friction: float = 0.0
    sticks: bool = False
    fits: bool = True
    pace: float = 0.0
    ends_at: Callable[[FloatArray], BoolArray] | None = None
    foot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_sharp: bool = False
    touched: tuple[float, float, float] | None = None
    tissue: LooseTissue | None = None

    @property
    def kind(self) -> Kind:
        """A support on which the body rests, a jaw, or tissue."""
        if self.tissue is not None:
            return Kind.TISSUE
        return Kind.SUPPORT if self.ends_at is None else Kind.JAW

    @property
    def is_tissue(self) -> bool:
        """Whether it is tissue."""
        return self.kind is Kind.TISSUE

    @property
    def drags(self) -> bool:
        """Whether it is a support along which friction holds the body."""
        return self.kind is Kind.SUPPORT and self.friction > 0

    @property
    def advance(self) -> FloatArray:
        """How far (3), m, it goes where the tool goes 1 m."""
        return self.pace * np.array(self.normal)

    def beside_tissue(self, places: FloatArray, normals: Callable[[], FloatArray]) -> "Bed":
        """Return tissue as a bed: gaps are those of nodes to their partners, zero at ``places`` (n, 3), along its
        current ``normals`` (n, 3)."""
        nothing = np.zeros(len(places))
        return replace(self, distance=lambda points, _: Distance.along(-normals(), nothing, points - places))

    def at_rest(self, places: FloatArray) -> "Bed":
        """Return the bed of linear elasticity: gaps are those above ``places`` (n, 3) at rest, along its axis.

        Of a jaw that is inclined to the surface, they are along the surface's normal.
        """
        if self.touched is not None:
            return replace(self, distance=above_places(self.distance, np.array(self.touched), places))
        heights, outward = self.height(places), -np.array(self.normal)
        return replace(
            self,
            distance=lambda points, depth: Distance.along(outward, heights - self.pace * depth, points - places),
        )

    def holding(self) -> "Bed":
        """Return the support to which tissue sticks wherever it touches, without a path; a jaw as it is."""
        return replace(self, friction=inf, sticks=True) if self.drags else self

    def moved(self, by: FloatArray) -> "Bed":
        """Return the jaw elsewhere, ``by`` (3), m."""
        ends_at = self.ends_at
        assert ends_at is not None
        x, y, z = map(float, np.array(self.foot) + by)
        return replace(
            self,
            distance=lambda points, depth: self.distance(points - by, depth),
            height=lambda points: self.height(points - by),
            ends_at=lambda points: ends_at(points - by),
            foot=(x, y, z),
        )

    def advanced(self, change: float) -> "Bed":
        """Return the bed where the tool is farther by ``change`` (m), as :meth:`.Tool.advanced` does."""
        if self.touched is None:
            return replace(
                self,
                distance=lambda points, depth: self.distance(points, depth + change),
                height=lambda points: self.height(points) - self.pace * change,
            )
        nearer = -change * float(self.advance @ np.array(self.touched))

        def distance(points: FloatArray, depth: float) -> Distance:
            found = self.distance(points, depth)
            return replace(found, gap=found.gap - nearer)

        return replace(self, distance=distance)


def support_of(ground: Ground, friction: float, *, fits: bool) -> Bed:
    """Return the support whose surface is the ``ground``. What ``fits`` is touched at rest, and tissue sticks there."""
    sticks = fits and friction == inf
    return Bed(lambda points, _: ground.distance(points), ground.normal, ground.height, friction, sticks, fits)


def tissue_below(tissue: LooseTissue, friction: float, *, is_level: bool) -> Bed:
    """Return what loose ``tissue`` touches at rest, along the normals of its nodes: below it, if it ``is_level``."""

    def no_distance(points: FloatArray, _: float) -> Distance:
        raise NotImplementedError("tissue has gaps to other tissue at rest only")

    x, y, z = map(float, tissue.axes[2] if is_level else np.zeros(3))
    at_rest, sticks = lambda points: np.zeros(len(points)), friction == inf
    return Bed(no_distance, (x, y, z), at_rest, friction, sticks, tissue=tissue)


@dataclass(frozen=True, eq=False)
class Resting:
    """The ``nodes`` (n) above beds, among all that may be touched; those that touch at the start of a path, ``begin``.

    In a loop without friction, those that ``stick`` (n) are held at ``anchors`` (n, 3), m, where they touch. Those that
    ``yields`` (n) marks may penetrate more where sets repeat. ``jaws`` are masks (n) of those of each second jaw.
    Of ``holds`` (n), masks, each has a node that touches, or the body floats: nothing else holds it.
    """

    nodes: BoolArray
    begin: BoolArray
    stick: BoolArray
    anchors: FloatArray
    yields: BoolArray
    jaws: tuple[BoolArray, ...] = ()
    holds: tuple[BoolArray, ...] = ()
