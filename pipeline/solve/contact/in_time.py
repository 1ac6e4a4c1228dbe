"""Contact in time steps: at each time, equilibrium of the relaxing tissue and the active set are found together.

The contact may grow, shrink, and be lost: a tool that moves off faster than tissue recovers touches no node, and has no
force. With a linear law the gap is that along the axis, above the undeformed place of a node, as in
:mod:`.active_set`; with a law of large displacements it is that at the deformed place.
"""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.shapes.distance import Distance
from pipeline.solve import SolveError
from pipeline.solve.contact.active_set import ContactError
from pipeline.solve.contact.contact_steps import check_outside
from pipeline.solve.contact.deformed import first_set, solve_contact
from pipeline.solve.contact.large import placed_tool, touched_area
from pipeline.solve.contact.levels import Surface
from pipeline.solve.contact.tissue import DeformedBody
from pipeline.solve.contact.tool import Tool
from pipeline.solve.elements.base import Elements
from pipeline.solve.newton import LargeError
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.time_steps import Pressed

# Share of the largest contact forces so far to which the residual is compared, where forces have become small.
_SCALE = 1e-2


def along_axis(tool: Tool, places: FloatArray) -> Tool:
    """Return a tool whose gaps to nodes are those along −z, above their undeformed ``places`` (n, 3)."""
    heights = tool.height(places) - tool.first

    def distance(points: FloatArray, depth: float) -> Distance:
        return Distance.along_axis(heights - depth - (points - places)[:, 2], 3)

    return replace(tool, distance=distance)


class PressedTool(Pressed):
    """Relaxing tissue of a ``law`` and a tool that is pressed in by shares of a ``depth`` (m)."""

    is_found = True

    def __init__(
        self, surface: Surface, elements: Elements, tool: Tool, law: MaterialLaw, depth: float, stack: ExitStack
    ):
        """Set up; what is made is freed with the ``stack``; collective."""
        self._tissue = DeformedBody(elements, surface, law, "iterative", stack, prestressed=True)
        self.body, self._depth = self._tissue.hyperelastic, depth
        self._tool = along_axis(tool, self._tissue.candidates.points) if law.is_linear else tool
        self._active = np.zeros(len(self._tissue.candidates), dtype=bool)
        self._scale = 0.0
        self._last = self._tissue.state
        self.force, self.rate, self.area = np.zeros(3), 0.0, 0.0

    def equilibrate(self, state: PETSc.Vec, share: float) -> None:
        """Find equilibrium and contact at a share.

        Raises:
            LargeError: if the loop does not converge.
            ContactError: if contact reaches the edge of the candidates.
        """
        tissue = self._tissue
        tissue.state = state.array
        if not tissue.is_sound:
            tissue.state = self._last
        placed = replace(placed_tool(tissue, self._tool, share * self._depth), depth=self._depth)
        try:
            touched = solve_contact(tissue, placed, first_set(tissue, placed, self._active), scale=_SCALE * self._scale)
            check_outside(tissue, touched, self._depth)
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        at_edge = tissue.candidates.points[touched.active & tissue.candidates.is_edge]
        if not np.all(self._tool.ends_at(at_edge)):
            raise ContactError("the contact reaches the edge of the region that is searched: use a smaller depth")
        self._active, self._last = touched.active, tissue.state
        self._scale = max(self._scale, float(np.linalg.norm(touched.pressed)))
        self.force = touched.forces.sum(axis=0)
        self.rate = -float(self.force[2]) * self._depth
        self.area = 0.0
        if touched.active.any():
            # Pressures beside the edge tell its place with the modulus of the law: those without relaxation.
            elastic = replace(touched, forces=tissue.elastic_forces() * touched.active[:, None])
            places = tissue.candidates
            if not tissue.law.is_linear:
                places = replace(places, points=tissue.positions())
            area = touched_area(tissue, places, elastic, share * self._depth).value
            self.area = 2.0 ** len(tissue.elements.body.mirrored) * area
        state.array[:] = self._last

    def guess(self, state: PETSc.Vec) -> None:
        """Return nothing: the tangent does not know which nodes the tool will touch."""
        return

    def unit(self, state: PETSc.Vec, share: float) -> FloatArray:
        """Return the displacement, scaled such that the forces at the nodes do the work of the force in it."""
        tissue = self._tissue
        space = tissue.elements.displacements
        moved = state.array[: space.owned]
        work = float((tissue.forces() * self._active[:, None] * (tissue.positions() - tissue.candidates.points)).sum())
        return np.asarray(moved * (-self.force[2] / work if work else 0.0))
