"""What a bed does to a body that rests on it, or that it holds as a jaw: reaction, area in contact, and balance."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import nan

import numpy as np
from scipy.spatial import cKDTree

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.bed import Bed, Kind
from epsmesh.solve.contact.geometry import Area, contact_area, semi_axis, share_at_end
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.contact.turned import turned_frames
from epsmesh.solve.contact_result import RestBars, RestResult
from epsmesh.solve.estimate import found_again_bar, of_steps, unresolved
from epsmesh.solve.response import whole_force

# The square of the edge of an equilateral facet, in units of its area.
_OF_FACET = 4 / 3**0.5


class OnSurface(Candidates):
    """Candidates with the areas of their facets in the surface itself."""

    @cached_property
    def areas(self) -> FloatArray:
        """The areas of the facets (m²), (m)."""
        around = self.points[self.facets[:, self.shape.boundary]]
        middle = around.mean(axis=1, keepdims=True)
        doubled = np.cross(around - middle, np.roll(around, -1, axis=1) - middle)
        return np.asarray(np.linalg.norm(doubled.sum(axis=1), axis=1) / 2)


@dataclass(frozen=True, eq=False)
class Rest:
    """A ``bed`` that has ``touched`` its ``candidates``; ``modulus`` (n) is E / (1 - ν²) of the tissue there (Pa).

    ``moved`` (n, 3), m, are the displacements of its nodes.
    Points and forces are those of the modelled part, bounded by planes of symmetry normal to the axes ``mirrored``.
    """

    bed: Bed
    candidates: Candidates
    touched: ContactSolution
    modulus: FloatArray
    moved: FloatArray
    mirrored: tuple[int, ...]

    @property
    def force(self) -> FloatArray:
        """The force (3), N, of the bed on the modelled part."""
        return np.asarray(self.touched.forces.sum(axis=0))

    @cached_property
    def _in_its_plane(self) -> "Rest":
        """It with the axes of the bed, as those of a tool that presses along the last one.

        Between tissue areas are those of the surface itself, and the force along the last axis is the pressing one.
        """
        axes, forces = self._axes, self.touched.forces @ self._axes.T
        candidates = replace(self.candidates, points=self.candidates.points @ axes.T)
        if self.bed.is_tissue:
            candidates = OnSurface(**{each.name: getattr(candidates, each.name) for each in fields(candidates)})
            forces[:, -1] = -self.touched.pressed
        return replace(self, candidates=candidates, touched=replace(self.touched, forces=forces))

    @property
    def _axes(self) -> FloatArray:
        normal = np.array(self.bed.normal)
        if self.bed.is_tissue:  # the direction of most of the surface
            normal = np.linalg.svd(self.touched.normal, full_matrices=False)[2][0]
        axes = turned_frames(normal[None], np.ones(1, dtype=bool))[0].T
        axes[-1] *= -1.0
        return np.asarray(axes)

    @cached_property
    def area(self) -> Area:
        """The area in contact, in the plane of the bed, with the bar by the size of elements at its edge."""
        seen = self._in_its_plane
        found = contact_area(seen.candidates, seen.touched, self.modulus, self.mirrored)
        return replace(found, value=min(found.value, float(seen.candidates.areas.sum())))

    @property
    def bar(self) -> float:
        """The relative bar on the area: by the size of elements, and by nodes that neither press nor are clear."""
        unsure = ~self.touched.active & (self.touched.gap < 0)
        weights = self._in_its_plane.candidates.weights if self.bed.is_tissue else self.candidates.weights
        return self.area.bar + float(np.abs(weights[unsure]).sum()) / self.area.value

    @property
    def unresolved(self) -> float:
        """The least relative bar on F: zero, but for contact with a support with elements larger than itself."""
        if self.bed.kind is not Kind.SUPPORT:
            return 0.0
        seen, active = self._in_its_plane, self.touched.active
        pressed = np.where(active, -seen.touched.forces[:, -1], 0.0)
        half = semi_axis(seen.candidates.points[:, :2], pressed, self.mirrored)
        facets = seen.candidates.areas[active[seen.candidates.facets].any(axis=1)]
        return unresolved(float(np.sqrt(_OF_FACET * facets.mean())) / half) if half else 1.0

    @property
    def slip(self) -> float:
        """The largest distance (m) by which a node in contact has gone along the bed, from where it was at rest.

        It is unknown on a bed that nodes meet on their way.
        """
        if self.bed.sticks or not self.bed.fits:
            return 0.0 if self.bed.fits else nan
        normal = self.touched.normal[self.touched.active]
        moved = self.moved[self.touched.active]
        along = moved - np.einsum("ni,ni->n", moved, normal)[:, None] * normal
        return float(np.linalg.norm(along, axis=1).max(initial=0.0))

    @property
    def whole_area(self) -> float:
        """The area (m²) of the modelled part that the bed may touch."""
        return float(self._in_its_plane.candidates.areas.sum())

    def result(self) -> RestResult:
        """Return that of the whole body."""
        whole = 2.0 ** len(self.mirrored)
        x, y, z = map(float, whole_force(self.force, self.mirrored))
        found = RestResult(
            force=(x, y, z),
            normal=self.bed.normal,
            pressed=whole * self.pressed,
            area=whole * self.area.value,
            lifted=whole * max(self.whole_area - self.area.value, 0.0),
            slip=self.slip if self.bed.kind is Kind.SUPPORT else nan,
        )
        if self.bed.kind is not Kind.JAW or not self.bed.friction:
            return found
        if self.mirrored:  # a mirror image has the opposite torque
            return replace(found, torque=0.0, torque_bar=0.0)
        arms = self.candidates.points - np.array(self.bed.foot)
        return replace(found, torque=-float(np.cross(arms, self.touched.forces).sum(axis=0) @ self.bed.normal))

    @property
    def pressed(self) -> float:
        """The force (N) on the modelled part along the normal; between tissue, along that of each place."""
        if self.bed.is_tissue:
            return float(self.touched.pressed.sum())
        return float(self.force @ np.array(self.bed.normal))

    def force_bar(self, finer: "Rest", degree: int, at_edge: float, at_end: float) -> float:
        """Return the relative bar on the force of a jaw, or of tissue, by contact in a ``finer`` degree.

        What is unknown at the edges and sharp ends of all contacts, as in `found_again_bar`, bounds each force: the
        body hands it on.
        """
        if self.bed.kind is Kind.SUPPORT:
            return nan
        share, least = 1 - finer.pressed / self.pressed, fitted.AT_EDGE_LARGE[degree]
        return found_again_bar(share, at_edge, least, at_end=at_end)[1]

    @property
    def at_sharp_end(self) -> float:
        """The share of the facets in contact that are at a sharp end of a jaw, off which nodes slide."""
        if not (self.bed.is_sharp and self.bed.ends_at):
            return 0.0
        return share_at_end(self.candidates, self.touched.active, self.bed.ends_at, self._axes)

    def half_the_steps(self, found: RestBars, coarse: "Rest", smooth: "Rest", of_friction: float) -> RestBars:
        """Return the bars ``found`` beside this friction, with those of that.

        They are the changes from half as many load steps, ``coarse``, and of a force a share of what friction adds: at
        least ``of_friction``, that of the tool. The relative bar on the slip along a support is that of the contact
        beside, ``smooth``, unknown if the support sticks there.
        """
        if self.bed.kind is not Kind.SUPPORT:
            of_force = of_steps(self.pressed, coarse.pressed, smooth.pressed)
            found = replace(found, force=found.force + max(of_friction, of_force))
        if self.bed.kind is Kind.JAW:
            return found
        of_area, of_slip = abs(coarse.area.value / self.area.value - 1), abs(coarse.slip - self.slip)
        of_mesh = found.slip / smooth.slip if smooth.slip else 0.0 if self.bed.sticks else nan
        return replace(found, area=found.area + of_area, slip=of_mesh * self.slip + of_slip)


def rests_of(body: DeformedBody, beds: Sequence[Bed], touched: ContactSolution) -> tuple[Rest, ...]:
    """Return what the ``beds`` of a ``body`` do, from what has ``touched`` all of its candidates."""
    found = []
    for number, bed in enumerate(beds, start=1):
        part = body.part(number)
        candidates = part.candidates
        if not (body.law.is_linear or bed.is_tissue):  # areas between tissue are those at rest
            candidates = replace(candidates, points=part.of(body.positions()))
        modulus, moved = candidates.from_regions(body.law.plane_moduli), part.of(body.positions() - body.places)
        found.append(Rest(bed, candidates, part.solution(touched), modulus, moved, body.elements.body.mirrored))
    return tuple(found)


def force_left(body: DeformedBody, beds: Sequence[Bed], touched: ContactSolution) -> FloatArray:
    """Return the sum (3), N, of all forces from outside on the modelled part: zero at equilibrium. Collective.

    They are those of what holds it, of terms, and of what has ``touched`` it: the tool and the ``beds``, but for the
    tissue below a loose layer, which is of the body itself. Across planes of symmetry, which bear forces, it is zero.
    """
    space, forces = body.elements.displacements, touched.forces.copy()
    for number, bed in enumerate(beds, start=1):
        if bed.is_tissue:
            forces[body.part(number).nodes] = 0.0
    held = global_sum(space.comm, body.on_support(touched.forces).reshape(-1, 3)[space.bearing_owned].sum(axis=0))
    left = held - body.on_terms + forces.sum(axis=0)
    left[list(body.elements.body.mirrored)] = 0.0
    return np.asarray(left)


def overlap(body: DeformedBody, beds: Sequence[Bed], touched: ContactSolution) -> float:
    """Return how far (m) loose tissue that has lifted off is within that below, beyond its own gaps; collective.

    Gaps are those of nodes to their partners: tissue that has gone far along may have come to another place. They are
    compared with those above the plane of the nearest node below.
    """
    found = 0.0
    for number, bed in enumerate(beds, start=1):
        if bed.is_tissue and bed.sticks:
            part, below, normals = body.part(number), body.below(number), body.normals_on(number)
            is_open, gap = ~part.of(touched.active), part.of(touched.gap)
            upper = below + part.of(body.positions() - body.places)
            nearest = cKDTree(below).query(upper)[1]
            above = np.einsum("ni,ni->n", upper - below[nearest], normals[nearest])
            found = max(found, float((np.minimum(gap, 0.0) - above)[is_open].max(initial=0.0)))
    return found


def height_beside(body: DeformedBody, beds: Sequence[Bed]) -> float:
    """Return how high (m) above a support the lowest nodes are, at rest, that may press on it alone; 0 without one.

    Corners of elements of degree 2 press only if their neighbours do, too.
    """
    found = [0.0]
    for number, bed in enumerate(beds, start=1):
        if bed.kind is not Kind.JAW:
            candidates = body.part(number).candidates
            found.append(float(bed.height(candidates.points)[~candidates.neighbours.followers].min()))
    return max(found)
