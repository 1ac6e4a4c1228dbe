"""Meshes for the far field of a body: one for each place, or one for many places of a study."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from epsmesh.plan import estimate
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import PROBES
from epsmesh.study.case import Case
from epsmesh.study.closure import FarRegion, room
from epsmesh.study.schema import Mesh

# Number of elements to the nearest side or the bottom, and through the thickness; growth. Half as many change F by less
# than 1e-3.
_NEAR, _THROUGH, _GROWTH = 4, 3, 0.5
# Number of elements through the thickness, for a mesh of many places.
_THROUGH_FOR_MANY = 4


def far_regions(cases: Collection[Case]) -> dict[Body, FarRegion]:
    """Return, by body, the region of all places of ``cases``, if one mesh for it has fewer elements than one each."""
    places: dict[Body, dict[tuple[float, ...], Case]] = {}
    for case in cases:
        if case.has_own_far_field:
            places.setdefault(case.body, {})[case.frame.point] = case
    found = {body: _region(list(there.values())) for body, there in places.items()}
    return {body: region for body, region in found.items() if region is not None}


def far_mesh(case: Case) -> Case:
    """Return the case whose mesh is for the far field of ``case``; its probe only marks fine elements."""
    shapes: Mapping[str, Any] = PROBES  # loaded on access
    if (region := case.far_region) is None:
        low, high = case.body.heights
        radius = room(case.body, case.probe)
        disc = shapes["disc"].model_construct(shape="disc", radius=radius / 2, depth=radius, at=case.probe.at)
        return _meshed_round(case, disc, radius, max(radius / _NEAR, (high - low) / _THROUGH))
    (left, front), (right, back) = region.low, region.high
    blade = shapes["blade"].model_construct(
        shape="blade",
        length=right - left,
        width=back - front,
        depth=region.radius,
        at=((left + right) / 2, (front + back) / 2),
    )
    bottom, top = case.body.heights
    return _meshed_round(case, blade, region.radius, max(region.radius / _NEAR, (top - bottom) / _THROUGH_FOR_MANY))


def _meshed_round(case: Case, probe: Probe, radius: float, coarse: float) -> Case:
    near = radius / _NEAR
    mesh = Mesh.model_construct(epsilon=radius, fine=near, coarse=coarse, rim=near, growth=_GROWTH)
    return replace(case, probe=probe, mesh=mesh)


def _region(cases: list[Case]) -> FarRegion | None:
    """Return the region of ``cases`` at several places on one body; None if a mesh for each has fewer elements."""
    radius = min(room(case.body, case.probe) for case in cases)
    near = radius / _NEAR
    xs, ys, (top, *_) = zip(*(case.frame.point for case in cases), strict=True)
    low, high = (min(xs) - near, min(ys) - near), (max(xs) + near, max(ys) + near)
    corners = [(x, y, top) for x in (low[0], high[0]) for y in (low[1], high[1])]
    if len(cases) < 2 or any(cases[0].body.gap(corner) < near for corner in corners):
        return None
    region = FarRegion(low, high, radius)
    each = sum(estimate.cells(one) * 0.5 ** len(mirror_planes(one)) for one in map(far_mesh, cases))
    return region if estimate.cells(far_mesh(replace(cases[0], far_region=region))) < each else None
