"""Unilateral contact at large displacements in the half plane (r, z), by the loop of :mod:`pipeline.solve.contact`.

The first mesh is refined at the edge of contact on a half-space, the next one at that found before. On each, contact is
found along a load path in elements of degree p - 1, and again in those of degree p. The force is the sum of the
reactions. The support must carry it, and the reactions must do the work that a small change of the displacement stores.

Lengths are in units of the contact radius of the mesh, stresses in units of μ of region 0.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import Grading, MeridianArrays
from pipeline.scene.model import FREE, PROBE
from pipeline.shapes.distance import Distance
from pipeline.solve import SolveError
from pipeline.solve.balance import check_balance
from pipeline.solve.contact.contact_steps import ContactPath, Stage, press
from pipeline.solve.contact.deformed import PlacedTool, Touched, first_set, settle
from pipeline.solve.meridian.forms import Meshes
from pipeline.solve.meridian.large import LargeSolver, stopped
from pipeline.solve.meridian.problem import Answer
from pipeline.solve.meridian.punch import Punches, RoundTool
from pipeline.solve.meridian.signs import seen_from_above
from pipeline.solve.meridian.system import HalfPlane, System, max_strain
from pipeline.solve.meridian.tissue import MeridianTissue
from pipeline.solve.newton import LargeError
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# Bar: this many times the difference of the degrees, and the square of the distance of nodes at the edge.
_BETWEEN_DEGREES = 2.0
# Change of the displacement for the check of the work, and the largest relative difference of work and energy.
_SMALL, _WORK = 1e-3, 1e-5
# Rounding error of an energy, in units of μ and the volume.
_ROUNDING = 1e-15


class LargeMeridianContact(LargeSolver):
    """The meridian of a body of a law of large displacements, on which a round tool presses without friction."""

    gradings = (Grading(0.1, 1.0, 4.0), Grading(0.02, 1.0, 4.0), Grading(5e-3, 0.7, 2.0), Grading(2e-3, 0.5, 1.0))

    def __init__(self, meridian: HalfPlane, tool: RoundTool, **how: Any):
        """Prepare, as :class:`LargeSolver`; ``how`` are its ``accuracy`` and ``degree``."""
        super().__init__(meridian, **how)
        self._tool = tool
        self._kept = meridian.radius if isinstance(meridian, EllipticMeridian) else meridian.kept_radius

    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float, before: Answer | None) -> Answer:
        if before is None:
            radius, _ = self._tool.on_half_space(depth, min(self._tool.limit, 0.9 * self._kept))
        else:
            radius = before.edge
        arrays, meshes = Punches(self._meridian, self._tool, law).mesh(radius, grading)
        degrees = self._degree - 1, self._degree
        coarse, fine = (_Touch.of(arrays, meshes, degree, law, self._tool) for degree in degrees)
        try:
            coarse = coarse.pressed(depth)
        except LargeError as stop:
            raise stopped(stop, arrays, law, depth) from stop
        fine = fine.raised(coarse, depth)
        fine.check()
        deep, force, balance = depth / arrays.unit, fine.force, fine.balance
        return Answer(
            stiffness=force / deep,
            on_probe=-force / deep,
            balance=balance,
            error=_BETWEEN_DEGREES * abs(coarse.force / force - 1) + coarse.resolution**2 + 3 * balance,
            unit=arrays.unit,
            max_strain=max_strain(fine.tissue.system.forms, arrays),
            dofs=fine.tissue.system.forms.dofs,
            cells=len(arrays.cells),
            iterations=coarse.tissue.iterations + fine.tissue.iterations,
            area=fine.area * arrays.unit**2,
            energy=fine.energy * arrays.unit**2,
            edge=fine.edge * arrays.unit,
        )


@dataclass(frozen=True, eq=False)
class _Touch:
    """A ``tool`` above ``tissue`` whose nodes are those of the surface, from the axis outwards, and their contact.

    ``volume`` is that of a cylinder round the body.
    """

    tissue: MeridianTissue
    tool: RoundTool
    unit: float
    volume: float
    touched: Touched | None = None

    @staticmethod
    def of(arrays: MeridianArrays, meshes: Meshes, degree: int, law: MaterialLaw, tool: RoundTool) -> "_Touch":
        """Return tissue at rest, in elements of one degree."""
        with stage("assembly"):
            system = System(meshes, degree, law)
        groups = [system.forms.on(name) for name in (PROBE, FREE)]
        dofs, first = np.unique(np.vstack([dofs for dofs, _ in groups]), axis=0, return_index=True)
        places = np.vstack([places for _, places in groups])[first]
        order = np.argsort(places[:, 0], kind="stable")
        order = order[seen_from_above(arrays, places[order])]
        wide, high = arrays.points.ptp(axis=0)
        return _Touch(MeridianTissue(system, dofs[order], places[order]), tool, arrays.unit, pi * wide**2 * high)

    def pressed(self, depth: float) -> "_Touch":
        """Return the contact at the end of the load path to a ``depth`` (m).

        Raises:
            LargeError: if the path ends before; ``reached`` are the depth and the force there.
        """
        path = ContactPath(Stage(0.0, self.tissue.state))
        try:
            press(self.tissue, self._placed, path, depth / self.unit)
        except LargeError as error:
            there = replace(self, touched=path.last.touched)
            raise LargeError(str(error), (path.last.depth, there.force) if path.last.depth else None) from error
        return replace(self, touched=path.last.touched)

    def raised(self, coarse: "_Touch", depth: float) -> "_Touch":
        """Return the contact at a ``depth`` (m), found from that of elements of a lower degree on the same mesh.

        Raises:
            LargeError: if it is not found.
        """
        self.tissue.state = self.tissue.system.forms.interpolate(coarse.tissue.system.forms, coarse.tissue.state)
        if not self.tissue.is_sound:
            raise LargeError("tissue is turned inside out")
        tool = self._placed(depth / self.unit)
        active = first_set(self.tissue, tool, self.tissue.places[:, 0] < coarse.edge)
        return replace(self, touched=settle(self.tissue, tool, active))

    def _placed(self, depth: float) -> PlacedTool:
        """Return the tool at a ``depth`` (units of the mesh)."""
        on_support = self.tissue.fixed.all(axis=1)

        def distance(points: FloatArray) -> Distance:
            assert self.tool.distance is not None
            in_space = self.unit * np.insert(points, 1, 0.0, axis=1)
            found, plane = self.tool.distance(in_space, self.unit * depth), np.ix_([0, 2], [0, 2])
            curvature = self.unit * found.curvature[:, plane[0], plane[1]]
            return Distance(found.gap / self.unit, found.normal[:, [0, 2]], curvature)

        def complete(active: BoolArray) -> BoolArray:
            # The shape function of the node on the axis has no share of the pressure, so its reaction means nothing.
            return np.concatenate([active[1:2], active[1:]]) & ~on_support

        return PlacedTool(distance, complete, np.arange(len(on_support)) == 0, depth)

    @property
    def _contact(self) -> Touched:
        assert self.touched is not None
        return self.touched

    @cached_property
    def force(self) -> float:
        """F on the tool, against its advance."""
        return -2 * pi * float(self._contact.forces[:, 1].sum())

    @cached_property
    def balance(self) -> float:
        """The relative difference of the forces on tool and support."""
        system = self.tissue.system
        return abs(2 * pi * float(self.tissue.residual()[system.support].sum()) / self.force - 1)

    @cached_property
    def energy(self) -> float:
        """The stored energy."""
        return 2 * pi * self.tissue.system.forms.energy(self.tissue.state)

    @property
    def edge(self) -> float:
        """The radius at rest at which contact ends.

        Raises:
            SolveError: if it is that of the surface.
        """
        if self._contact.active[-1]:
            raise SolveError("contact reaches the edge of the modelled part of the body")
        radii, last = self.tissue.places[:, 0], int(np.flatnonzero(self._contact.active)[-1])
        return float(radii[last] + radii[last + 1]) / 2

    @property
    def resolution(self) -> float:
        """The distance of the two nodes between which contact ends, relative to its radius."""
        radii, last = self.tissue.places[:, 0], int(np.flatnonzero(self._contact.active)[-1])
        return float(radii[last + 1] - radii[last]) / self.edge

    @property
    def area(self) -> float:
        """The contact area at the deformed place, normal to the axis."""
        radii, active = self.tissue.positions()[:, 0], self._contact.active[:-1]
        ends = (radii[:-1] + radii[1:]) / 2
        return float(pi * (ends**2 - np.insert(ends[:-1] ** 2, 0, 0.0))[active].sum())

    def check(self) -> None:
        """Check balance and work, and that contact ends on the surface.

        Raises:
            SolveError: if forces do not balance, the work is not the change of the energy, or the support is touched.
        """
        tissue, touched = self.tissue, self._contact
        if np.any(touched.gap[tissue.fixed.all(axis=1)] < 0):
            raise SolveError("the probe reaches the fixed part of the body: no displacement satisfies both")
        check_balance(self.balance)
        work = 2 * pi * float((touched.forces * (tissue.positions() - tissue.places)).sum())
        more, less = (2 * pi * tissue.system.forms.energy((1 + change) * tissue.state) for change in (_SMALL, -_SMALL))
        wrong, rounding = abs((more - less) / (2 * _SMALL * work) - 1), _ROUNDING * self.volume / (2 * _SMALL * work)
        if not wrong <= _WORK + rounding:
            raise LargeError(f"the force is not the derivative of the energy: they differ by {wrong:.1e}")
