"""Contact at equilibrium as what a tool does to the candidates of a body: one result for linear and other tissue.

Force, area, slip, friction and torque follow from the nodes alone, whatever the body, the law or the load path.
"""

from dataclasses import dataclass
from functools import cached_property
from math import nan

from epsmesh.arrays import FloatArray
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.coulomb import rubbing_of
from epsmesh.solve.contact.deformed import ContactSolution
from epsmesh.solve.contact.geometry import Area, contact_area
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact_result import ContactResult


@dataclass(frozen=True, eq=False)
class SurfaceContact:
    """A ``tool`` that has ``touched`` the ``candidates`` of the modelled part of a body; ``coarse`` with friction.

    The points of the candidates are where the contact is: at rest in linear elasticity, else deformed. ``modulus`` (n)
    is E / (1 - ν²) of the tissue there (Pa), ``mirrored`` are the axes of the planes of symmetry. ``coarse`` is the
    contact from half as many load steps.
    """

    candidates: Candidates
    touched: ContactSolution
    tool: Tool
    modulus: FloatArray
    mirrored: tuple[int, ...]
    coarse: ContactSolution | None = None

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

    def result(self, sag: float, load_energy: float, shift: float = nan) -> ContactResult:
        """Return the whole contact; ``sag`` (m), ``load_energy`` (J) of the whole body and ``shift`` (m) are the
        effects of loads."""
        found = ContactResult(self.whole_area, sag=sag, load_energy=load_energy, is_ended=self.is_ended, shift=shift)
        if self.coarse is None:
            return found
        rubbing = rubbing_of(self.candidates, self.tool.friction, self.touched, self.coarse)
        torque = self.tool.torque(self.candidates.points, self.touched.forces)
        return found.with_friction(rubbing, torque, self.mirrored)
