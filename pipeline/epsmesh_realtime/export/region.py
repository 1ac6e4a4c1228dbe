"""The region of a face that a model covers."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from epsmesh.shapes.body import Layered
from epsmesh.study.case import Case
from epsmesh.study.schema import Mesh
from epsmesh_realtime.export.scope import Scope

# Margin beside the sides, in units of half the width or the thickness, whichever is smaller.
MARGIN = 0.15
# Flat bodies: number of elements from the region's edge to the sides, through the thickness, or down to other tissue.
_NEAR, _THROUGH, _TO_TISSUE = 2.5, 4, 2
# Curved bodies: element sizes in the region, in units of the study's radius, and elsewhere, in units of the cube root
# of the volume; radius of the small elements, in units of half the region. Growth of both.
_IN_REGION, _ELSEWHERE, _AROUND, _GROWTH = 0.9, 0.095, 1.2, 0.4
# Half size of the region of an ellipsoid, in its semi-axes.
_OF_AXES = 0.4

# A coordinate this small, in units of the body, is 0.
_SAME = 1e-9


@dataclass(frozen=True)
class Region:
    """A tabulated region: half extents (m) of region (``reach``) and face (``sides``), or their radii twice.

    ``thickness`` (m) is the depth of the support or of other tissue. ``even`` says in which directions the body is its
    own mirror image, ``is_square`` whether exchanging x and y leaves it unchanged. A round region may have a body that
    is not: ``is_axial`` says whether the body is axisymmetric.
    """

    reach: tuple[float, float]
    sides: tuple[float, float]
    thickness: float
    is_round: bool
    even: tuple[bool, bool] = (True, True)
    is_square: bool = False
    is_axial: bool = False

    @staticmethod
    def of(body: Layered, share: float) -> "Region":
        """Return the region with a margin: a ``share`` of the smaller of half the width and the height."""
        sides, height = body.half_sides, body.heights[1] - body.heights[0]
        left = share * min(*sides, height)
        even = tuple(
            all(abs(piece.at[axis]) <= _SAME * height for piece in body.inclusion) and not body.region
            for axis in range(2)
        )
        is_square = sides[0] == sides[1] and body.holds_round
        reach = (sides[0] - left, sides[1] - left)
        is_round, is_axial = body.has_round_top, body.is_round
        return Region(reach, sides, body.depth_of_tissue, is_round, (even[0], even[1]), is_square, is_axial)

    @property
    def margin(self) -> float:
        """The distance (m) from the region to the sides."""
        return self.sides[0] - self.reach[0]

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or the depth of the bottom or other tissue."""
        if self.is_round:
            return min(self.sides[0] - float(np.hypot(x, y)), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)


def coarse_case(case: Case, region: Region) -> Case:
    """Return a case of a flat body with a mesh for all places of a region."""
    from epsmesh.shapes.probes.blade import Blade  # noqa: PLC0415 (a plan loads the shapes that it names alone)
    from epsmesh.shapes.probes.disc import Disc  # noqa: PLC0415

    through = _TO_TISSUE if case.body.regions else _THROUGH
    near, far = region.margin / _NEAR, region.thickness / through
    near = min(near, far) if case.body.regions else near
    size: dict[str, Any] = {"depth": region.margin, "at": (0.0, 0.0), "axis": None}
    if region.is_round:
        probe: Any = Disc.model_construct(shape="disc", radius=region.reach[0], **size)
    else:
        length, width = 2 * region.reach[0], 2 * region.reach[1]
        probe = Blade.model_construct(shape="blade", length=length, width=width, **size)
    mesh = Mesh.model_construct(epsilon=region.margin, fine=near, coarse=max(near, far), rim=near, growth=_GROWTH)
    return replace(case, probe=probe, mesh=mesh)


def surface_case(case: Case, region: Region) -> Case:
    """Return a case of a curved body with a mesh for loads that grow towards a force in a region, and for display."""
    around, fine = _AROUND * max(region.reach), _IN_REGION * case.probe.circumradius
    coarse = max(fine, _ELSEWHERE * case.body.volume ** (1 / 3))
    mesh = Mesh.model_construct(epsilon=around, fine=fine, coarse=coarse, rim=fine, growth=_GROWTH)
    return replace(case, mesh=mesh)


def is_free(scope: Scope) -> bool:
    """Return whether the region of a curved body has the size of the tool, not that of the body."""
    at = scope.case.probe.at
    return not scope.body.half_sides or len(at) > len("xy") or any(at) or bool(scope.body.embedded)


def curved_region(scope: Scope, room: float, half: float) -> Region:
    """Return the region of a curved body round the study's place; ``room`` (m) is the distance to its boundary.

    ``half`` (m) is its half size, unless the body's symmetry gives one.
    """
    is_round, reach, even = False, (half, half), (False, False)
    if not is_free(scope):
        assert scope.body.half_sides is not None
        is_round, even = scope.body.is_round, (True, True)
        reach = (_OF_AXES * scope.body.half_sides[0], _OF_AXES * scope.body.half_sides[1])
    return Region(reach, (reach[0] + 2 * room, reach[1] + 2 * room), room, is_round, even, is_axial=is_round)
