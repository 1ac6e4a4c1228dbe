"""Contact with friction at large displacements: the load path in steps, and the error bar.

Contact without friction is found first; it gives the error bar of the mesh. The path is then followed in load steps
with friction, and again in half as many: the change of the force is the bar of the steps.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.contact.contact_steps import ContactPath, ContactStage, Friction, press_with_friction
from epsmesh.solve.contact.coulomb import Neighbours, rubbing_of
from epsmesh.solve.contact.deformed import ContactSolution
from epsmesh.solve.contact.frictional import with_friction
from epsmesh.solve.contact.large import LargeContact, LargeContactSolution, placed_tool, stopped
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.elements.base import Equilibrium, HierarchicalEstimate
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.movement import Movement
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import of_regions
from epsmesh.solve.response import Contact
from epsmesh.solve.solution import Request


class LargeFrictionalContact(LargeContact):
    """Contact with a tool that has friction; each depth has a path of its own.

    ``STEPS`` is the number of load steps: enough for a bar of some tenths of a per cent where tissue sticks.
    """

    STEPS: ClassVar[int] = 8

    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find equilibrium and contact at the depth of the movement; the ``stack`` frees what is made; collective.

        Raises:
            LargeError: if the load steps end before the depth, or the solution fails a check.
            ContactError: if contact reaches the support or the edge of the candidates.
        """
        smooth, iterations = self.find(asked, stack)
        tool = smooth.placed
        body, depth, state = smooth.body, smooth.depth, smooth.body.state
        friction, touched = friction_of(body, self._tool.friction, depth), []
        for steps in (self.STEPS // 2, self.STEPS):
            path = ContactPath(ContactStage(0.0, smooth.sagged.state))
            try:
                iterations += press_with_friction(
                    body, lambda there: placed_tool(body, tool, there), path, depth, friction, steps
                )
            except LargeError as error:
                raise stopped(body, path, depth, error, self._tool.friction) from error
            assert path.last.touched is not None
            touched.append(path.last.touched)
        body.state = path.last.state
        coarse, fine = touched
        found = LargeFrictionalSolution(
            self._surface, body, self._tool, fine, depth, smooth.sagged, smooth.corrections, smooth, state, coarse
        )
        return found.equilibrium(asked.movement, iterations, stack)


def friction_of(body: DeformedBody, coefficient: float, depth: float) -> Friction:
    """Return the friction of a tool that advances along −z to a ``depth`` (m) on the candidates of a body."""
    candidates = body.candidates
    width = float(np.median(candidates.widths[candidates.widths > 0]))
    modulus = float(np.mean(of_regions(body.law.plane_moduli, candidates.regions, len(candidates.facets))))
    return Friction(
        coefficient,
        np.array([0.0, 0.0, -1.0]),
        np.full(len(candidates), modulus * width),
        Neighbours(candidates.is_corner, candidates.beside_corners(np.arange(len(candidates)))),
        depth,
    )


@dataclass(frozen=True, eq=False)
class LargeFrictionalSolution(LargeContactSolution):
    """Contact with friction, beside the frictionless one, ``smooth``, with its state.

    ``coarse`` is the contact from half as many load steps.
    """

    smooth: LargeContactSolution
    smooth_state: FloatArray
    coarse: ContactSolution

    def summary(self) -> Contact:
        """Return the area of the whole contact, the part that slides, and the friction."""
        rubbing = rubbing_of(self.body.candidates, self.tool.friction, self.touched, self.coarse)
        torque = self.tool.torque(self.body.positions(), self.touched.forces)
        return super().summary().with_friction(rubbing, torque, self.body.elements.body.mirrored)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the change of the frictionless force in one degree more, and the bar with those of friction.

        Raises:
            LargeError: if the next degree does not converge.
        """
        state = self.body.state
        self.body.state = self.smooth_state
        found, frictionless = self.smooth.hierarchical_estimate(columns, movement, stack, keep=keep), self.smooth.force
        self.body.state = state
        path_bar = abs(float(self.coarse.forces[:, 2].sum() / self.touched.forces[:, 2].sum()) - 1)
        return with_friction(found, path_bar, added=self.force / frictionless - 1)
