"""Prescribed components of the displacement, independent of their values, and the position of a slit's front."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.scene.model import FIXED
from epsmesh.solve import SolveError
from epsmesh.solve.movement import Vector
from epsmesh.solve.terms import AddedTerm
from epsmesh.solve.variation import Variation

# The virtual extension v is 1 up to the first of these shares of its radius, and 0 from the second on.
_INNER, _OUTER = 0.4, 1.0
# A direction counts as a coordinate axis within this tolerance.
_SAME = 1e-9


@dataclass(frozen=True)
class Front:
    """Front of a slit, or tip of a blade in it, in a mesh whose probe presses along -z; lengths in m.

    ``point`` is where the probe's axis meets the surface. The front is ``depth`` below it, along the unit vector
    ``along``, from -``reach`` to ``reach`` or through the whole body. Within ``radius`` of the front there is no other
    edge.
    """

    point: Vector
    along: Vector
    depth: float
    reach: float
    radius: float

    @property
    def normal(self) -> Vector:
        """Unit vector across the slit."""
        x, y, _ = self.along
        return 0.0 - y, x, 0.0

    def advance(self, x: FloatArray) -> FloatArray:
        """Return the displacement (n,) along the axis of the points (3, n) under a unit advance of the front."""
        offset = x.T - np.array(self.point)
        away = np.maximum(np.abs(offset @ np.array(self.normal)), np.abs(offset[:, 2] + self.depth))
        if isfinite(self.reach):
            away = np.maximum(away, np.abs(offset @ np.array(self.along)) - self.reach)
        return np.asarray(np.clip((_OUTER - away / self.radius) / (_OUTER - _INNER), 0.0, 1.0))


@dataclass(frozen=True)
class Conditions:
    """Prescribed components, independent of their values: all on the footprint (``bonded``), or that along z alone.

    With ``unilateral`` contact the footprint prescribes nothing: the active set does. The support is fixed. On planes
    of symmetry that bound the mesh the normal displacement is zero. A probe in a slit with that ``front`` touches both
    faces of the slit. Without bond it prescribes their opening only, and its driving force acts at its ``tip``.
    ``terms`` act on the body besides its law, whose stiffness has a ``variation``, if it varies within regions. A
    support that is ``released`` fixes nothing: the active set does. ``beds`` are the groups of facets that
    contacts besides the tool's may touch: that of a released support, or of a jaw. A tool that ``deforms`` is a part of
    the mesh, fixed at its mount.
    """

    bonded: bool = True
    unilateral: bool = False
    front: Front | None = None
    tip: Front | None = None
    terms: tuple[AddedTerm, ...] = ()
    variation: Variation | None = None
    beds: tuple[str, ...] = ()
    deforms: bool = False

    @property
    def without_footprint(self) -> "Conditions":
        """The same without a tool."""
        kept = {name: getattr(self, name) for name in ("terms", "variation", "beds", "deforms")}
        return replace(WITHOUT_FOOTPRINT, **kept)

    @property
    def released(self) -> bool:
        """Whether the support lets go."""
        return FIXED in self.beds

    @property
    def components(self) -> tuple[int, ...]:
        """Components of the displacement that the probe prescribes.

        Raises:
            SolveError: if a sliding direction is no coordinate axis, so that no single component describes it.
        """
        if self.unilateral:
            return ()
        if self.bonded:
            return (0, 1, 2)
        if self.front is None:
            return (2,)
        normal = [axis for axis, part in enumerate(self.front.normal) if abs(part) > 1 - _SAME]
        if not normal:
            raise SolveError("frictionless contact in a slit needs a slit along x or along y")
        return tuple(normal)


# Conditions without a footprint: no tool, or one whose active set alone prescribes displacements.
WITHOUT_FOOTPRINT = Conditions(bonded=False, unilateral=True)
