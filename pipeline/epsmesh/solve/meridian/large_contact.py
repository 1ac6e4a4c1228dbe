"""Unilateral contact in the half plane (r, z), found along a load path: large displacements, friction, or both.

The loop is that of :mod:`epsmesh.solve.contact`. The first mesh is refined at the edge of contact on a half-space, the
next one at that found before. On the first mesh, contact is found along a load path in elements of degree p - 1, and
again in those of degree p. A finer mesh begins with the solution of the one before. The force is the sum of the
reactions. The support must carry it, and the reactions must do the work that a small change of the displacement stores.

With friction the force depends on the path, which both degrees follow in load steps. The change from half as many of
them is the bar of the steps. Finer meshes have more steps.

Lengths are in units of the contact radius of the mesh, stresses in units of μ of region 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading
from epsmesh.solve.contact.checks import check_support
from epsmesh.solve.contact.in_time import ContactIndentation
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.meridian.in_time import RelaxingHalfPlane
from epsmesh.solve.meridian.large import LargeSolver, stopped
from epsmesh.solve.meridian.problem import Answer
from epsmesh.solve.meridian.punch import Punches, RoundTool
from epsmesh.solve.meridian.system import HalfPlane, max_strain
from epsmesh.solve.meridian.touch import MeridianTouch
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw

# With friction: load steps of each mesh, whose bar is rarely below a tenth of a per cent, the accuracy that is tried,
# and a degree whose error is well below that of the steps.
_STEPS = {Grading(0.1, 1.0, 4.0): 8, Grading(0.02, 0.7, 4.0): 16}
_ACCURACY_OF_STEPS, DEGREE_OF_STEPS = 1e-3, 3
# Of pictures: a mesh whose corners follow the tool, and the degree of its elements.
_SHOWN, _SHOWN_DEGREE = Grading(0.1, 0.2, 4.0), 2


class LargeMeridianContact(LargeSolver):
    """The meridian of a body on which a round tool presses; without friction, its law is of large displacements."""

    gradings: tuple[Grading, ...] = (Grading(0.1, 1.0, 4.0), Grading(0.02, 0.7, 4.0), Grading(4e-3, 0.5, 2.0))

    def __init__(self, meridian: HalfPlane, tool: RoundTool, **how: Any):
        """Prepare, as :class:`LargeSolver`; ``how`` are its ``accuracy`` and ``degree``."""
        if tool.friction:
            self.gradings = tuple(_STEPS)
            how = {"accuracy": _ACCURACY_OF_STEPS, "degree": DEGREE_OF_STEPS} | how
        super().__init__(meridian, **how)
        self._tool = tool
        self._kept = meridian.radius if isinstance(meridian, EllipticMeridian) else meridian.kept_radius

    def sections(self, law: MaterialLaw, depths: Sequence[float]) -> list[tuple[FloatArray, FloatArray]]:
        """Return triangles (n, 3, 2) at rest and their displacements, in m, at rising ``depths`` (m) as far as it goes.

        They are for pictures: the mesh is even round the tool, and has elements of a low degree.
        """
        arrays, meshes = Punches(self._meridian, self._tool, law).mesh(min(self._tool.limit, 0.9 * self._kept), _SHOWN)
        touch = MeridianTouch.of(arrays, meshes, _SHOWN_DEGREE, law, self._tool)
        found = (each.tissue.system.forms.triangles(each.tissue.state) for each in touch.along(depths))
        return [(arrays.unit * places, arrays.unit * moved) for places, moved in found]

    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float, before: Answer | None) -> Answer:
        touch = before.touch if isinstance(before, _ContactAnswer) else None
        if touch is None:
            radius, _ = self._tool.on_half_space(depth, min(self._tool.limit, 0.9 * self._kept))
        else:
            radius = touch.edge * touch.unit
        arrays, meshes = Punches(self._meridian, self._tool, law).mesh(radius, grading)
        begins_with = None if self._tool.friction or arrays.order > 1 else touch

        def at(degree: int) -> MeridianTouch:
            return MeridianTouch.of(arrays, meshes, degree, law, self._tool)

        try:
            fine, bars = self._from(begins_with, at, depth) or self._along_path(at, depth, _STEPS.get(grading, 0))
        except LargeError as stop:
            raise stopped(stop, arrays, law, depth, is_found=True, friction=self._tool.friction) from stop
        fine.check()
        deep, force, balance = depth / arrays.unit, fine.force, fine.balance
        error = float(fitted.MERIDIAN_RESULTS[0] * bars[0]) / fine.results[0] + fine.resolution**2 + 3 * balance
        error += fine.tissue.system.forms.unresolved(fine.tissue.state)
        return _ContactAnswer(
            stiffness=force / deep,
            on_probe=-force / deep,
            balance=balance,
            error=error,
            unit=arrays.unit,
            max_strain=max_strain(fine.tissue.system.forms, arrays),
            dofs=fine.tissue.system.forms.dofs,
            cells=len(arrays.cells),
            iterations=fine.tissue.iterations,
            contact=self._contact(fine, bars, error),
            energy=fine.energy * arrays.unit**2,
            touch=fine,
            in_time=lambda: RoundToolIndentation(replace(fine, touched=None), deep),
        )

    def _contact(self, fine: MeridianTouch, bars: FloatArray, error: float) -> ContactResult:
        """Return the contact with ``bars`` on its results (4,); ``error`` is the relative bar of the force."""
        _, friction, area, slip_area = fine.results.tolist()
        _, of_friction, of_area, of_slip = (np.array(fitted.MERIDIAN_RESULTS) * bars).tolist()
        found = ContactResult(area, of_area / area + fitted.MERIDIAN_EDGE * fine.resolution)
        if not self._tool.friction:
            return found
        # Too few steps make friction too large, which then errs by more than by its share of itself.
        of_friction /= 1 - min(of_friction / max(friction, of_friction), fitted.MOST) if of_friction else 1.0
        of_friction += fitted.RUBBING_UNEVEN * fine.uneven * fine.unit**2
        # Sliding may begin between the last two nodes. Tissue that sticks by definition does not slide.
        of_slip += fine.slip_resolution * fine.unit**2 + fine.resolution * area
        return replace(
            found,
            slip_area=slip_area,
            slip_area_bar=of_slip if self._tool.friction < inf else 0.0,
            friction_force=fine.law.lame_mu[0] * friction,
            friction_force_bar=fine.law.lame_mu[0] * (of_friction + error * friction),
            torque=0.0,
            torque_bar=0.0,
        )

    def _from(
        self, before: MeridianTouch | None, at: Callable[[int], MeridianTouch], depth: float
    ) -> tuple[MeridianTouch, FloatArray] | None:
        """Return the contact at a ``depth`` (m), found from that on the mesh ``before``, and bars on its results (4,).

        ``at`` makes the tissue of a degree. None if there is no such mesh, or contact is not found.
        """
        if before is None:
            return None
        try:
            fine = at(self._degree).moved(before, depth)
        except LargeError:
            return None
        return fine, fitted.MERIDIAN_FOUND_MESHES * np.abs(before.results - fine.results)

    def _along_path(
        self, at: Callable[[int], MeridianTouch], depth: float, steps: int
    ) -> tuple[MeridianTouch, FloatArray]:
        """Return the contact at a ``depth`` (m), and bars on its results (4,): of degrees, and of steps with friction.

        ``at`` makes the tissue of a degree.

        Raises:
            LargeError: if a path ends before; ``reached`` are the depth and the force there.
        """
        coarse, fine, bars = at(self._degree - 1), at(self._degree), np.zeros(4)
        if self._tool.friction:
            rough = coarse.at_depth_with_friction(depth, steps // 2).results
            coarse = coarse.at_depth_with_friction(depth, steps)
            fine, bars = fine.at_depth_with_friction(depth, steps), np.abs(rough - coarse.results)
        else:
            coarse = coarse.at_depth(depth)
            try:
                fine = fine.raised(coarse, depth)
            except LargeError:  # its own path tells how far it comes
                fine = fine.at_depth(depth)
        return fine, bars + fitted.MERIDIAN_FOUND_DEGREES * np.abs(coarse.results - fine.results)


class RoundToolIndentation(ContactIndentation):
    """Relaxing tissue below a round tool, ``at_rest``, that is pressed in to a ``depth`` (units of the mesh)."""

    def __init__(self, at_rest: MeridianTouch, depth: float):
        tissue = at_rest.tissue
        tissue.state = np.zeros_like(tissue.state)
        self.body = RelaxingHalfPlane.of(tissue.system.forms, at_rest.law, at_rest.unit)
        self._touch = at_rest
        super().__init__(tissue, tissue.places, self.body.unit, depth, at_rest.friction_to(depth))

    def _placed(self, fraction: float) -> PlacedTool:
        return replace(self._touch.placed(fraction * self._depth), depth=self._depth)

    def _check(self, touched: ContactSolution) -> None:
        check_support(self._touch.tissue.fixed, touched.gap)

    def _measure(self, touched: ContactSolution, fraction: float) -> None:
        found, is_touched = replace(self._touch, touched=touched), bool(touched.active.any())
        self.body.iterations = self._touch.tissue.iterations
        of_force = self.body.unit / self._touch.unit
        self.force = np.array([0.0, 0.0, of_force * float(touched.forces[:, 1].sum())])
        self.rate = -float(self.force[2]) * self._depth * self._touch.unit
        self.area = found.area * self._touch.unit**2 if is_touched else 0.0
        self.rough = found.resolution**2 if is_touched else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _ContactAnswer(Answer):
    """An answer with its contact, from which that of a finer mesh begins."""

    touch: MeridianTouch
