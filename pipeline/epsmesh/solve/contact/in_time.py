"""Contact in time steps: at each time, equilibrium of the relaxing tissue and the active set are found together.

The contact may grow, shrink, and be lost: a tool that moves off faster than tissue recovers touches no node, and has no
force. With a linear law the gap is that along the axis, above the undeformed place of a node, as in
:mod:`.active_set`; with a law of large displacements it is that at the deformed place.
"""

from abc import abstractmethod
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.checks import check_edge
from epsmesh.solve.contact.contact_steps import check_outside
from epsmesh.solve.contact.deformed import ContactSolution, PlacedTool, SteppedTissue, first_set, solve_contact
from epsmesh.solve.contact.large import on_surface, placed_tool
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.time_steps import Indentation

# Share of the largest contact forces so far to which the residual is compared, where forces have become small.
_SCALE = 1e-2


class ContactIndentation(Indentation):
    """Relaxing ``tissue`` with nodes at ``places`` (n, d), and a tool whose contact with them is found.

    ``unit`` (J) is that of the nodes' forces times their displacements.
    """

    is_found = True

    def __init__(self, tissue: SteppedTissue, places: FloatArray, unit: float):
        """Begin at rest."""
        self._found_on, self._places, self._unit = tissue, places, unit
        self._active = np.zeros(len(places), dtype=bool)
        self._scale = 0.0
        self._last = tissue.state
        self.force, self.rate, self.area = np.zeros(3), 0.0, 0.0

    def equilibrate(self, state: PETSc.Vec, share: float) -> None:
        """Find equilibrium and contact at a share.

        Raises:
            LargeError: if the loop does not converge.
            ContactError: if contact reaches the edge of the candidates.
        """
        tissue = self._found_on
        tissue.state = np.array(state.array_r)
        if not tissue.is_sound:
            tissue.state = self._last
        placed = self._placed(share)
        try:
            touched = solve_contact(tissue, placed, first_set(tissue, placed, self._active), scale=_SCALE * self._scale)
            self._check(touched)
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        self._active, self._last = touched.active, tissue.state
        self._scale = max(self._scale, float(np.linalg.norm(touched.pressed)))
        self._measure(touched, share)
        state.array[:] = self._last

    @abstractmethod
    def _placed(self, share: float) -> PlacedTool:
        """Return the tool at a share."""

    @abstractmethod
    def _check(self, touched: ContactSolution) -> None:
        """Check a solution.

        Raises:
            SolveError: if a shorter step may be better.
        """

    @abstractmethod
    def _measure(self, touched: ContactSolution, share: float) -> None:
        """Set force, rate of work and area.

        Raises:
            ContactError: if contact reaches the edge of the candidates.
        """

    def guess(self, state: PETSc.Vec) -> None:
        """Return nothing: the tangent does not know which nodes the tool will touch."""
        return

    def unit(self, state: PETSc.Vec, share: float) -> FloatArray:
        """Return the displacement, scaled such that the forces at the nodes do the work of the force in it."""
        tissue = self._found_on
        work = float((tissue.forces() * self._active[:, None] * (tissue.positions() - self._places)).sum()) * self._unit
        return np.asarray(state.array_r * (-self.force[2] / work if work else 0.0))


class ToolIndentation(ContactIndentation):
    """Relaxing tissue of a ``law`` and a tool that is pressed in by shares of a ``depth`` (m)."""

    def __init__(
        self, surface: Surface, elements: Elements, tool: Tool, law: MaterialLaw, depth: float, stack: ExitStack
    ):
        """Set up; what is made is freed with the ``stack``; collective."""
        self._tissue = DeformedBody(elements, surface, law, "iterative", stack, prestressed=True)
        self.body, self._depth = self._tissue.hyperelastic, depth
        self._tool = tool.along_axis(self._tissue.candidates.points) if law.is_linear else tool
        super().__init__(self._tissue, self._tissue.candidates.points, 1.0)

    def _placed(self, share: float) -> PlacedTool:
        return replace(placed_tool(self._tissue, self._tool, share * self._depth), depth=self._depth)

    def _check(self, touched: ContactSolution) -> None:
        check_outside(self._tissue, touched, self._depth)

    def _measure(self, touched: ContactSolution, share: float) -> None:
        tissue = self._tissue
        check_edge(self._tool, tissue.candidates, touched.active)
        self.force = touched.forces.sum(axis=0)
        self.rate = -float(self.force[2]) * self._depth
        self.area = 0.0
        if touched.active.any():
            # Pressures beside the edge tell its place with the modulus of the law: those without relaxation.
            elastic = replace(touched, forces=tissue.elastic_forces() * touched.active[:, None])
            self.area = on_surface(tissue, self._tool, elastic).whole_area
