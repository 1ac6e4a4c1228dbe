"""What a bed does to a body that rests on it, or that it holds as a jaw: reaction, and area in contact."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve.contact.bed import Bed
from epsmesh.solve.contact.geometry import Area, contact_area
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.contact.turned import turned_frames
from epsmesh.solve.contact_result import RestResult
from epsmesh.solve.estimate import found_again_bar
from epsmesh.solve.response import whole_force


@dataclass(frozen=True, eq=False)
class Rest:
    """A ``bed`` that has ``touched`` its ``candidates``; ``modulus`` (n) is E / (1 - ν²) of the tissue there (Pa).

    Points and forces are those of the modelled part, bounded by planes of symmetry normal to the axes ``mirrored``.
    """

    bed: Bed
    candidates: Candidates
    touched: ContactSolution
    modulus: FloatArray
    mirrored: tuple[int, ...]

    @property
    def force(self) -> FloatArray:
        """The force (3), N, of the bed on the modelled part."""
        return np.asarray(self.touched.forces.sum(axis=0))

    @cached_property
    def area(self) -> Area:
        """The area in contact, in the plane of the bed, with the bar by the size of elements at its edge."""
        axes = turned_frames(np.array([self.bed.normal]), np.ones(1, dtype=bool))[0].T
        axes[-1] *= -1.0  # as a tool that presses along its last axis
        seen = replace(self.candidates, points=self.candidates.points @ axes.T)
        touched = replace(self.touched, forces=self.touched.forces @ axes.T)
        found = contact_area(seen, touched, self.modulus, self.mirrored)
        return replace(found, value=min(found.value, float(seen.areas.sum())))

    @property
    def bar(self) -> float:
        """The relative bar on the area: by the size of elements, and by nodes that neither press nor are clear."""
        unsure = ~self.touched.active & (self.touched.gap < 0)
        return self.area.bar + float(np.abs(self.candidates.weights[unsure]).sum()) / self.area.value

    @property
    def whole_area(self) -> float:
        """The area (m²) of the modelled part that the bed may touch."""
        axes = turned_frames(np.array([self.bed.normal]), np.ones(1, dtype=bool))[0].T
        return float(replace(self.candidates, points=self.candidates.points @ axes.T).areas.sum())

    def result(self) -> RestResult:
        """Return that of the whole body."""
        whole = 2.0 ** len(self.mirrored)
        x, y, z = map(float, whole_force(self.force, self.mirrored))
        found = RestResult(
            force=(x, y, z),
            normal=self.bed.normal,
            area=whole * self.area.value,
            lifted=whole * max(self.whole_area - self.area.value, 0.0),
        )
        if self.bed.is_support or not self.bed.friction:
            return found
        if self.mirrored:  # a mirror image has the opposite torque
            return replace(found, torque=0.0, torque_bar=0.0)
        arms = self.candidates.points - np.array(self.bed.foot)
        return replace(found, torque=-float(np.cross(arms, self.touched.forces).sum(axis=0) @ self.bed.normal))

    @property
    def pressed(self) -> float:
        """The force (N) on the modelled part along the normal."""
        return float(self.force @ np.array(self.bed.normal))

    def force_bar(self, finer: "Rest", degree: int) -> float:
        """Return the relative bar on the force of a jaw, or of tissue, by contact in a ``finer`` degree."""
        if self.bed.is_support and not self.bed.is_tissue:
            return nan
        return found_again_bar(1 - finer.pressed / self.pressed, self.area.bar, fitted.AT_EDGE_LARGE[degree])[1]


def rests_of(body: DeformedBody, beds: Sequence[Bed], touched: ContactSolution) -> tuple[Rest, ...]:
    """Return what the ``beds`` of a ``body`` do, from what has ``touched`` all of its candidates."""
    found = []
    for number, bed in enumerate(beds, start=1):
        part = body.part(number)
        candidates = part.candidates
        if not body.law.is_linear:
            candidates = replace(candidates, points=part.of(body.positions()))
        modulus = candidates.from_regions(body.law.plane_moduli)
        found.append(Rest(bed, candidates, part.solution(touched), modulus, body.elements.body.mirrored))
    return tuple(found)
