"""Contact at equilibrium as what a tool does to the candidates of a body: one result for linear and other tissue.

Force, area, slip, friction and torque follow from the nodes alone, whatever the body, the law or the load path.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.coulomb import rubbing_of
from epsmesh.solve.contact.geometry import Area, contact_area, share_at_end
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.contact_result import ContactResult, RestResult
from epsmesh.solve.response import whole_force


@dataclass(frozen=True, eq=False)
class SurfaceContact:
    """A ``tool`` that has ``touched`` the ``candidates`` of the modelled part of a body; ``coarse`` with friction.

    The points of the candidates are where the contact is: at rest in linear elasticity, else deformed. ``modulus`` (n)
    is E / (1 - ν²) of the tissue there (Pa), with a tool that deforms that of both in series, ``mirrored`` are the axes
    of the planes of symmetry. ``coarse`` is the contact from half as many load steps. With ``is_halved`` a second jaw
    is the image of the tool.
    """

    candidates: Candidates
    touched: ContactSolution
    tool: Tool
    modulus: FloatArray
    mirrored: tuple[int, ...]
    coarse: ContactSolution | None = None
    is_halved: bool = False

    @property
    def force(self) -> float:
        """The force (N) on the modelled part of the tool, along its axis."""
        return force_of(self.touched)

    @property
    def is_ended(self) -> bool:
        """Whether the contact reaches the edge of the candidates, where the tool itself ends."""
        return bool((self.touched.active & self.candidates.is_edge).any())

    @cached_property
    def area(self) -> Area:
        """The contact area of the modelled part, with the bar by the size of elements at its edge."""
        return contact_area(self.candidates, self.touched, self.modulus, self.mirrored)

    @property
    def whole_area(self) -> float:
        """The contact area (m²) of the whole body, normal to the axis."""
        return float(2.0 ** len(self.mirrored) * self.area.value)

    @property
    def at_sharp_end(self) -> float:
        """Return the share of the facets in contact that are at a sharp end of the tool, off which nodes slide."""
        if not self.tool.is_sharp:
            return 0.0
        return share_at_end(self.candidates, self.touched.active, self.tool.ends_at)

    def result(self, sag: float, load_energy: float, shift: float = nan) -> ContactResult:
        """Return the whole contact; ``sag`` (m), ``load_energy`` (J) of the whole body and ``shift`` (m) are the
        effects of loads."""
        found = ContactResult(self.whole_area, sag=sag, load_energy=load_energy, is_ended=self.is_ended, shift=shift)
        if self.coarse is not None:
            rubbing = rubbing_of(self.candidates, self.tool.friction, self.touched, self.coarse)
            torque = self.tool.torque(self.candidates.points, self.touched.forces)
            found = found.with_friction(rubbing, torque, self.mirrored)
        return replace(found, rests=(self._image(found),)) if self.is_halved else found

    def _image(self, found: ContactResult) -> RestResult:
        """Return what the image of the tool does, in a plane normal to its axis; ``found`` is the tool's contact."""
        forces = np.zeros(3)
        forces[-self.touched.forces.shape[1] :] = self.touched.forces.sum(axis=0)
        x, y, z = map(float, whole_force(forces, self.mirrored))
        return RestResult(
            force=(x, y, 0.0 - z),
            normal=(0.0, 0.0, 1.0),
            pressed=0.0 - z,
            area=found.area,
            lifted=0.0,
            torque=0.0 - found.torque,
            torque_bar=found.torque_bar,
        )


def on_surface(
    body: DeformedBody, tool: Tool, touched: ContactSolution, coarse: ContactSolution | None = None
) -> SurfaceContact:
    """Return contact with a body, where its candidates are; ``coarse`` is that from half as many load steps."""
    part = body.part()
    candidates = part.candidates
    if not body.law.is_linear:
        candidates = replace(candidates, points=part.of(body.positions()))
    modulus, mirrored = candidates.from_regions(body.moduli()), body.elements.body.mirrored
    coarse, is_halved = None if coarse is None else part.solution(coarse), body.elements.body.is_halved
    return SurfaceContact(candidates, part.solution(touched), tool, modulus, mirrored, coarse, is_halved)
