"""Found contact of round scenes in the half plane (r, z): the radius of contact as an unknown, and F to about 1e-6.

For a trial radius a of contact the scene is linear: u_z = -(d - g(r)) for r < a, g the gap before anything moves. The
solution is d u₁ + u₂, of a flat punch and of the gap alone. Both have stresses like (a - r)^-½ at the edge, which
cancel where contact ends by itself: d(a) = -k₂/k₁, k the reactions of the node at the edge. A few trials on coarse
meshes find the radius for a depth. F(a) = d E₁₁(a) + E₁₂(a), E the work of one solution on the other, is largest at the
true radius: an error of the radius changes F by its square.

A blunt tool on a stiff skin may lift off within its outline. An active set on the meridian's nodes finds the rings, the
second time with many more nodes at their edges. F is stationary in these radii, too.

Lengths are in units of a, stresses in units of μ of region 0, displacements in metres.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, inf, log, pi

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import Grading
from pipeline.solve import SolveError
from pipeline.solve.meridian.problem import DEGREE, Answer, MeridianSolver, error_bar
from pipeline.solve.meridian.punch import STEP, Punches, Rings, RoundTool
from pipeline.solve.meridian.signs import LiftsOff, check_signs
from pipeline.solve.meridian.system import HalfPlane, max_strain
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# A depth this near to the one asked for is near enough: F errs by its square.
_NEAR, _MOST_TRIALS = 3e-4, 12
# Powers of the radius that the depth may go like: 1 of a cone, 2 of a ball, more of flat tools with round edges.
_POWERS = (0.5, 8.0)
# Contact as wide as this share of what is kept of the body has no edge left.
_WIDEST = 0.999
# Nodes along the radius where rings that are lost are looked for, and between two of them the second time.
_ALONG, _BETWEEN = 20, 8


class MeridianContact(MeridianSolver):
    """The meridian of a round scene that a tool presses along its axis, in contact as far as that is pressed."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, *, accuracy: float = 1e-5, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``."""
        super().__init__(meridian, accuracy=accuracy, degree=degree)
        self._tool = tool

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        search = _Search(self._meridian, self._tool, law)
        patch = search.find(depth)
        try:
            found = self._settled(search, patch, depth)
        except LiftsOff:
            if isinstance(self._meridian, EllipticMeridian):
                raise
            found = self._settled(search, search.find_rings(patch, depth), depth)
        return replace(found, iterations=search.punches.count)

    def _settled(self, search: "_Search", patch: "_Patch", depth: float) -> Answer:
        return self._best(lambda grading: search.settle(patch, depth, grading, self._degree))


@dataclass(frozen=True)
class _Patch:
    """Where contact is: within a radius (m), but for the rings that are ``lost``.

    ``power`` is that of the radius which the depth goes like, inf where the tool ends; ``off`` what the edges of rings
    may be off by, in units of the narrowest piece.
    """

    radius: float
    power: float
    lost: Rings = ()
    off: float = 0.0

    def area(self, radius: float) -> float:
        """Return the area (m²) up to another ``radius`` (m)."""
        return pi * (radius**2 - sum(outer**2 - inner**2 for inner, outer in self.lost))


class _Search:
    """Looks for the radii of contact of a tool on the meridian of a body."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, law: MaterialLaw):
        self._tool = tool
        kept = meridian.radius if isinstance(meridian, EllipticMeridian) else meridian.kept_radius
        # A flat tool that covers all of a column ends where that does; contact that grows must not get there.
        covers = tool.limit >= kept and tool.is_flat(kept)
        self._widest = kept if covers else _WIDEST * kept
        self._limit = min(tool.limit, self._widest)
        self._covers = covers
        self.punches = Punches(meridian, tool, law)

    def find(self, depth: float) -> _Patch:
        """Return the round patch of contact."""
        radius, power = self._on_half_space(depth)
        low, high, before = 0.0, self._limit, None
        for _ in range(_MOST_TRIALS):
            punch = self.punches.at(radius)
            if radius == self._limit and punch.depth <= depth:
                if radius == self._widest < self._tool.limit and not self._covers:
                    raise SolveError("contact reaches the edge of what is kept of the body")
                return _Patch(radius, inf)
            if punch.depth <= 0:
                raise SolveError("no area of contact was found: the tool does not touch on its axis first")
            miss = log(punch.depth / depth)
            if before is not None:
                power = (miss - before[1]) / log(radius / before[0])
                power = min(max(power, _POWERS[0]), _POWERS[1])
            if abs(miss) < _NEAR:
                return _Patch(radius, power)
            low, high = (radius, high) if miss < 0 else (low, radius)
            before = radius, miss
            radius *= exp(-miss / power)
            if radius >= high:
                radius = high if high == self._limit != before[0] else (before[0] + high) / 2
            if radius <= low:
                radius = (before[0] + low) / 2
        raise SolveError(f"the radius of contact was not found in {_MOST_TRIALS} trials")

    def find_rings(self, patch: _Patch, depth: float) -> _Patch:
        """Return what touches where a round ``patch`` would have to pull somewhere within.

        Raises:
            SolveError: if it is not found, or its outer edge is another one.
        """
        radius = patch.radius
        marks = radius * np.linspace(0, 1, _ALONG + 1)[1:-1]
        lost, step = self._lost(radius, depth, marks)
        edges = [edge for ring in lost for edge in ring if edge > 0]
        close = [edge + step * np.linspace(-1, 1, 2 * _BETWEEN + 1) for edge in edges]
        marks = np.unique(np.round(np.concatenate(close) / radius, 9)) * radius
        lost, step = self._lost(radius, depth, marks[(marks > 0) & (marks < radius)], lost)
        ends = [0.0, *(edge for ring in lost for edge in ring), radius]
        pieces = [high - low for low, high in pairwise(ends) if high > low]
        return replace(patch, lost=lost, off=step / min(pieces))

    def _lost(self, radius: float, depth: float, marks: FloatArray, before: Rings = ()) -> tuple[Rings, float]:
        """Return the rings that do not touch, and the widest distance (m) of nodes at their edges; from ``before``."""
        radii, active = self.punches.touching(radius, depth, tuple(marks), before)
        if not active[-1]:
            raise SolveError('contact on the meridian ends nearer to the axis than one round patch: use model = "3d"')
        (changes,) = np.nonzero(active[1:] != active[:-1])
        edges = [float(radii[i] + radii[i + 1]) / 2 for i in changes]
        if not active[0]:
            edges = [0.0, *edges]
        if not edges:
            raise SolveError('contact on the meridian was not found: use model = "3d"')
        step = max((float(radii[i + 1] - radii[i]) for i in changes), default=0.0)
        return tuple(zip(edges[::2], edges[1::2], strict=True)), step

    def settle(self, patch: _Patch, depth: float, grading: Grading, degree: int) -> Answer:
        """Return the contact at a depth, from solutions of two degrees with nearly the right radii.

        The error bar is that of :func:`error_bar`, and the squares of what the radii are off by.
        """
        radius = patch.radius
        arrays, meshes = self.punches.mesh(radius, grading, patch.lost)
        coarse = self.punches.solve(meshes, arrays, radius, degree - 1)
        fine = self.punches.solve(meshes, arrays, radius, degree)
        force = fine.force(depth)
        if not force > 0:
            raise SolveError("the solution is not a number or takes no force")
        error = error_bar(coarse.force(depth), force, degree, max(coarse.balance, fine.balance))
        if patch.power < inf:
            misses = [log(punch.depth / depth) for punch in (coarse, fine)]
            error += max(np.square(misses)) * fine.stiffness * depth / force / patch.power
            radius *= exp(-misses[1] / patch.power)
        error += patch.off**2 * fine.stiffness * depth / force
        with stage("solve"):
            solution = depth * fine.punch + fine.pressed
            residual = fine.forms.residual(solution)
            check_signs(fine.forms, arrays, solution, residual, tool=self._tool, depth=depth)
            strain = max_strain(fine.forms, arrays) / arrays.unit
        return Answer(
            stiffness=force / depth,
            on_probe=-force / depth,
            balance=fine.balance,
            error=error,
            unit=arrays.unit,
            max_strain=strain,
            dofs=fine.forms.dofs,
            cells=len(arrays.cells),
            iterations=self.punches.count,
            area=patch.area(radius),
            energy=pi * float(solution @ residual),
        )

    def _on_half_space(self, depth: float) -> tuple[float, float]:
        """Return the radius on an elastic half-space, and the power of it that the depth goes like."""
        tool = self._tool
        if tool.indentation((1 - STEP) * self._limit) <= depth:
            return self._limit, 2.0
        low, high = 0.0, self._limit
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if tool.indentation(middle) < depth else (low, middle)
        wider = 1.01 * low
        power = log(tool.indentation(min(wider, self._limit)) / depth) / log(min(wider, self._limit) / low)
        return low, min(max(power, _POWERS[0]), _POWERS[1])
