"""Unilateral contact in the half plane (r, z), found along a load path: large displacements, friction, or both.

The loop is that of :mod:`pipeline.solve.contact`. The first mesh is refined at the edge of contact on a half-space, the
next one at that found before. On each, contact is found along a load path in elements of degree p - 1, and again in
those of degree p. The force is the sum of the reactions. The support must carry it, and the reactions must do the work
that a small change of the displacement stores.

With friction the force depends on the path, which both degrees follow in load steps. The change from half as many of
them is the bar of the steps. Finer meshes have more steps.

Lengths are in units of the contact radius of the mesh, stresses in units of μ of region 0.
"""

from typing import Any

from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import Grading
from pipeline.solve.meridian.large import LargeSolver, stopped
from pipeline.solve.meridian.problem import Answer
from pipeline.solve.meridian.punch import Punches, RoundTool
from pipeline.solve.meridian.system import HalfPlane, max_strain
from pipeline.solve.meridian.touch import MeridianTouch
from pipeline.solve.newton import LargeError
from pipeline.solve.physics import MaterialLaw

# Bar: this many times the difference of the degrees, and the square of the distance of nodes at the edge.
_BETWEEN_DEGREES = 2.0
# With friction: load steps of each mesh, whose bar is rarely below a tenth of a per cent, the accuracy that is tried,
# and a degree whose error is well below that of the steps.
_STEPS = {Grading(0.1, 1.0, 4.0): 8, Grading(0.02, 0.7, 4.0): 16}
_ACCURACY_OF_STEPS, DEGREE_OF_STEPS = 1e-3, 3


class LargeMeridianContact(LargeSolver):
    """The meridian of a body on which a round tool presses; without friction, its law is of large displacements."""

    gradings: tuple[Grading, ...] = (
        Grading(0.1, 1.0, 4.0),
        Grading(0.02, 1.0, 4.0),
        Grading(5e-3, 0.7, 2.0),
        Grading(2e-3, 0.5, 1.0),
    )

    def __init__(self, meridian: HalfPlane, tool: RoundTool, **how: Any):
        """Prepare, as :class:`LargeSolver`; ``how`` are its ``accuracy`` and ``degree``."""
        if tool.friction:
            self.gradings = tuple(_STEPS)
            how = {"accuracy": _ACCURACY_OF_STEPS, "degree": DEGREE_OF_STEPS} | how
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
        coarse, fine = (MeridianTouch.of(arrays, meshes, degree, law, self._tool) for degree in degrees)
        try:
            coarse, fine, path_bar = self._along_path(coarse, fine, depth, _STEPS.get(grading, 0))
        except LargeError as stop:
            raise stopped(stop, arrays, law, depth) from stop
        fine.check()
        deep, force, balance = depth / arrays.unit, fine.force, fine.balance
        mesh_bar = _BETWEEN_DEGREES * abs(coarse.force / force - 1) + coarse.resolution**2
        return Answer(
            stiffness=force / deep,
            on_probe=-force / deep,
            balance=balance,
            error=mesh_bar + path_bar + 3 * balance,
            unit=arrays.unit,
            max_strain=max_strain(fine.tissue.system.forms, arrays),
            dofs=fine.tissue.system.forms.dofs,
            cells=len(arrays.cells),
            iterations=coarse.tissue.iterations + fine.tissue.iterations,
            area=fine.area * arrays.unit**2,
            slip_area=fine.slip_area * arrays.unit**2,
            friction=fine.friction / deep,
            energy=fine.energy * arrays.unit**2,
            edge=fine.edge * arrays.unit,
        )

    def _along_path(
        self, coarse: MeridianTouch, fine: MeridianTouch, depth: float, steps: int
    ) -> tuple[MeridianTouch, MeridianTouch, float]:
        """Return the contact in both degrees at a ``depth`` (m), and the bar of load steps, relative.

        Raises:
            LargeError: if a path ends before; ``reached`` are the depth and the force there.
        """
        if not self._tool.friction:
            coarse = coarse.pressed(depth)
            return coarse, fine.raised(coarse, depth), 0.0
        rough = coarse.rubbed(depth, steps // 2).force
        coarse = coarse.rubbed(depth, steps)
        return coarse, fine.rubbed(depth, steps), abs(rough / coarse.force - 1)
