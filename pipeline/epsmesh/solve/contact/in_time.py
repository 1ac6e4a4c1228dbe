"""Contact in time steps: at each time, equilibrium of the relaxing tissue and the active set are found together.

The contact may grow, shrink, and be lost: a tool that moves off faster than tissue recovers touches no node, and has no
force. With a linear law the gap is that along the axis, above the undeformed place of a node, as in
:mod:`.active_set`; with a law of large displacements it is that at the deformed place.

With friction a step is one of a load path, which may also return: nodes remember where on the tool they stick. Loads
have acted for long, and the depth counts from the first touch of the surface that has crept under them.
"""

from abc import abstractmethod
from contextlib import ExitStack
from dataclasses import replace
from math import isnan

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.checks import check_edge
from epsmesh.solve.contact.contact_steps import ContactPathPoint, Friction, check_outside, friction_step
from epsmesh.solve.contact.deformed import first_set, solve_contact
from epsmesh.solve.contact.friction_step import Placed
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.placed import placed_tool
from epsmesh.solve.contact.sagged import sagged_body
from epsmesh.solve.contact.surface_contact import on_surface
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool, SteppedTissue
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.movement import Loads
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.time_steps import Indentation

# Share of the largest contact forces so far to which the residual is compared, where forces have become small.
_SCALE = 1e-2
# The same, before the tool touches, in units of the loads on the tissue.
_OF_LOADS = 1e-4


class ContactIndentation(Indentation):
    """Relaxing ``tissue`` with nodes at ``places`` (n, d), and a tool whose contact with them is found.

    ``unit`` (J) is that of the nodes' forces times their displacements; ``depth`` is that of the whole movement, in the
    unit of the places. Without ``friction`` there is none.
    """

    is_found = True

    def __init__(
        self, tissue: SteppedTissue, places: FloatArray, unit: float, depth: float, friction: Friction | None = None
    ):
        """Begin in the state of the tissue."""
        self._found_on, self._places, self._unit = tissue, places, unit
        self._depth, self._friction, self.rubs = depth, friction, friction is not None
        self._scale, self._references = 0.0, places
        self._start, self._last = tissue.state, ContactPathPoint(0.0, tissue.state)
        self.force, self.rate, self.area = np.zeros(3), 0.0, 0.0

    def equilibrate(self, state: PETSc.Vec, fraction: float) -> None:
        """Find equilibrium and contact at a fraction.

        Raises:
            LargeError: if the loop does not converge.
            ContactError: if contact reaches the edge of the candidates.
        """
        tissue = self._found_on
        tissue.state = np.array(state.array_r)
        if not tissue.is_sound:
            tissue.state = self._last.state
        try:
            touched = self._touched(fraction)
            self._check(touched)
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        now = ContactPathPoint(fraction * self._depth, tissue.state, touched)
        if self.rubs:
            self.rubbed += self._unit * self._heat(touched, fraction)
        self._last = now
        self._scale = max(self._scale, float(np.linalg.norm(touched.pressed)))
        self._measure(touched, fraction)
        state.array[:] = now.state

    def _touched(self, fraction: float) -> ContactSolution:
        """Return contact at a share, from the state of the tissue on."""
        tissue, placed, last, step = self._found_on, self._placed(fraction), self._last, None
        if self._friction is not None:
            step = friction_step(tissue, self._at, last, fraction * self._depth, self._friction)
            self._references = step.references
        active = np.zeros(len(self._places), dtype=bool) if last.touched is None else last.touched.active
        return solve_contact(tissue, placed, first_set(tissue, placed, active), step, scale=_SCALE * self._scale)

    def _at(self, depth: float) -> PlacedTool:
        return self._placed(depth / self._depth)

    def _heat(self, touched: ContactSolution, fraction: float) -> float:
        """Return the work of friction since the last point: the mean forces along the tool, times the slips there."""
        positions, before = self._found_on.positions(), self._last.touched
        place = Placed(positions, self._placed(fraction).distance(positions).normal)
        forces = touched.forces if before is None else touched.forces + before.forces
        return -float((forces * place.slips(self._references)).sum()) / 2

    @abstractmethod
    def _placed(self, fraction: float) -> PlacedTool:
        """Return the tool at a fraction."""

    @abstractmethod
    def _check(self, touched: ContactSolution) -> None:
        """Check a solution.

        Raises:
            SolveError: if a shorter step may be better.
        """

    @abstractmethod
    def _measure(self, touched: ContactSolution, fraction: float) -> None:
        """Set force, rate of work and area.

        Raises:
            ContactError: if contact reaches the edge of the candidates.
        """

    def guess(self, state: PETSc.Vec) -> None:
        """Return nothing: the tangent does not know which nodes the tool will touch."""
        return

    def unit(self, state: PETSc.Vec, fraction: float) -> FloatArray:
        """Return the displacement, scaled such that the forces at the nodes do the work of the force in it."""
        tissue, touched = self._found_on, self._last.touched
        moved = 0.0 if touched is None else float((touched.forces * (tissue.positions() - self._places)).sum())
        return np.asarray((state.array_r - self._start) * (-self.force[2] / (moved * self._unit) if moved else 0.0))


class ToolIndentation(ContactIndentation):
    """Relaxing tissue of a ``law`` and a tool that is pressed in by shares of a ``depth`` (m), under ``loads``."""

    def __init__(
        self,
        surface: Surface,
        elements: Elements,
        tool: Tool,
        law: MaterialLaw,
        depth: float,
        loads: Loads | None,
        stack: ExitStack,
    ):
        """Set up; what is made is freed with the ``stack``; collective.

        Raises:
            SolveError: if there is no equilibrium under the loads.
        """
        applied = None if loads is None else elements.displacements.applied(loads)
        tissue = self._tissue = DeformedBody(elements, surface, law, "iterative", stack, applied, prestressed=True)
        self.body = tissue.hyperelastic
        sagged = sagged_body(tissue, tool, loads, has_crept=True)
        tissue.state = sagged.state
        self._tool, self._is_loaded = sagged.placed(tool, tissue), not isnan(sagged.sag)
        self.sag, self.load_energy = sagged.sag, sagged.stored
        self._elastic_before = tissue.elastic_forces()
        friction = Friction.on(tissue, tool, depth) if tool.friction else None
        super().__init__(tissue, tissue.positions(), 1.0, depth, friction)
        self._scale = 0.0 if applied is None else _OF_LOADS * applied.size

    def start(self) -> FloatArray | None:
        """Return the sagged state; None without loads."""
        return self._start if self._is_loaded else None

    def _placed(self, fraction: float) -> PlacedTool:
        return replace(placed_tool(self._tissue, self._tool, fraction * self._depth), depth=self._depth)

    def _check(self, touched: ContactSolution) -> None:
        check_outside(self._tissue, self._placed(1.0), touched, self._depth)

    def _measure(self, touched: ContactSolution, fraction: float) -> None:
        tissue = self._tissue
        check_edge(self._tool.ends_at, tissue.candidates, touched.active)
        self.force = touched.forces.sum(axis=0)
        self.rate = -float(self.force[2]) * self._depth
        self.area = 0.0
        if touched.active.any():
            # Pressures beside the edge tell its place with the modulus of the law: those without relaxation.
            forces = (tissue.elastic_forces() - self._elastic_before) * touched.active[:, None]
            self.area = on_surface(tissue, self._tool, replace(touched, forces=forces)).whole_area
