"""Unilateral contact of axisymmetric scenes in the half plane (r, z): the contact radius is unknown; F to about 1e-6.

For a trial contact radius a the scene is linear: u_z = -(d - g(r)) for r < a, with g the initial gap. The solution is
d u₁ + u₂, the flat punch plus the gap alone. Both have stresses like (a - r)^-½ at the edge, which cancel at the true
radius: d(a) = -k₂/k₁, with k the reactions at the edge's node. A few trials on coarse meshes find the radius for a
depth. F(a) = d E₁₁(a) + E₁₂(a), with E the work of one solution on the other, is largest at the true radius: F errs by
the square of the radius's error.

A blunt tool on stiff skin may lift off inside its outline. An active set on the meridian's nodes finds these rings, the
second time with many more nodes at their edges. F is stationary with respect to their radii, too.

Lengths are in units of a, stresses in units of μ of region 0, displacements in metres.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, inf, log, pi
from typing import Any

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading
from epsmesh.solve import SolveError
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.meridian.problem import Answer, MeridianSolver, error_bar
from epsmesh.solve.meridian.punch import POWERS, Punches, Rings, RoundTool
from epsmesh.solve.meridian.signs import LiftsOff, check_signs
from epsmesh.solve.meridian.system import HalfPlane, max_strain
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Tolerance on the depth of a trial radius (F errs by its square), and most trials.
_NEAR, _MOST_TRIALS = 3e-4, 12
# Largest contact radius, as a share of the modelled body's: beyond it contact has no edge.
_WIDEST = 0.999
# Nodes along the radius for the search for rings that lift off, and between two of them the second time.
_ALONG, _BETWEEN = 20, 8


class MeridianContact(MeridianSolver):
    """The meridian of an axisymmetric scene with unilateral contact: a tool presses along its axis."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, **how: Any):
        """Prepare, as :class:`MeridianSolver`; ``how`` are its keywords."""
        super().__init__(meridian, **how)
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
        return self._best(lambda grading: search.contact_at(patch, depth, grading, self._degree))


@dataclass(frozen=True)
class _Patch:
    """Contact area within a radius (m), without the rings that are ``lost``.

    ``power`` is the exponent of the radius in the depth, inf where the tool ends; ``off`` the position error of the
    rings' edges, in units of the narrowest piece.
    """

    radius: float
    power: float
    lost: Rings = ()
    off: float = 0.0

    def area(self, radius: float) -> float:
        """Return the area (m²) up to another ``radius`` (m)."""
        return pi * (radius**2 - sum(outer**2 - inner**2 for inner, outer in self.lost))


class _Search:
    """Search for the contact radii of a tool on the meridian of a body."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, law: MaterialLaw):
        self._tool = tool
        kept = meridian.radius if isinstance(meridian, EllipticMeridian) else meridian.kept_radius
        # A flat tool that covers a whole column ends with the column; a growing contact must not reach its edge.
        covers = tool.limit >= kept and tool.is_flat(kept)
        self._widest = kept if covers else _WIDEST * kept
        self._limit = min(tool.limit, self._widest)
        self._covers = covers
        self.punches = Punches(meridian, tool, law)

    def find(self, depth: float) -> _Patch:
        """Return the contact area without rings."""
        radius, power = self._tool.on_half_space(depth, self._limit)
        # A flat face is in contact at any depth: its rounding alone grows with the depth.
        flat = self._tool.flat
        low, high, before = flat, self._limit, None
        for _ in range(_MOST_TRIALS):
            punch = self.punches.at(radius)
            if radius == self._limit and punch.depth <= depth:
                if radius == self._widest < self._tool.limit and not self._covers:
                    raise SolveError("contact reaches the edge of the modelled part of the body")
                return _Patch(radius, inf)
            if punch.depth <= 0:
                raise SolveError("no contact area was found: the tool does not touch on its axis first")
            miss = log(punch.depth / depth)
            if before is not None:
                power = (miss - before[1]) / log((radius - flat) / (before[0] - flat))
                power = min(max(power, POWERS[0]), POWERS[1])
            if abs(miss) < _NEAR:
                return _Patch(radius, power * radius / (radius - flat))
            low, high = (radius, high) if miss < 0 else (low, radius)
            before = radius, miss
            radius = flat + (radius - flat) * exp(-miss / power)
            if radius >= high:
                radius = high if high == self._limit != before[0] else (before[0] + high) / 2
            if radius <= low:
                radius = (before[0] + low) / 2
        raise SolveError(f"the contact radius did not converge in {_MOST_TRIALS} trials")

    def find_rings(self, patch: _Patch, depth: float) -> _Patch:
        """Return the contact area with rings, where a round ``patch`` has tension somewhere inside.

        Raises:
            SolveError: if it is not found, or its outer radius differs.
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
        """Return the rings without contact, with initial guess ``before``, and the node distance (m) at their edges."""
        radii, active = self.punches.touching(radius, depth, tuple(marks), before)
        if not active[-1]:
            raise SolveError('the contact area is smaller than one round patch: use model = "3d"')
        (changes,) = np.nonzero(active[1:] != active[:-1])
        edges = [float(radii[i] + radii[i + 1]) / 2 for i in changes]
        if not active[0]:
            edges = [0.0, *edges]
        if not edges:
            raise SolveError('the contact area on the meridian was not found: use model = "3d"')
        step = max((float(radii[i + 1] - radii[i]) for i in changes), default=0.0)
        return tuple(zip(edges[::2], edges[1::2], strict=True)), step

    def contact_at(self, patch: _Patch, depth: float, grading: Grading, degree: int) -> Answer:
        """Return the contact at a depth, from solutions of two degrees with nearly the right radii.

        The error bar is that of :func:`error_bar`, plus the squares of the radii's errors. The area's has the errors
        themselves.
        """
        radius = patch.radius
        arrays, meshes = self.punches.mesh(radius, grading, patch.lost)
        coarse = self.punches.solve(meshes, arrays, radius, degree - 1)
        fine = self.punches.solve(meshes, arrays, radius, degree)
        force = fine.force(depth)
        if not force > 0:
            raise SolveError("the solution is not finite or has no force")
        error = error_bar(coarse.force(depth), force, degree, max(coarse.balance, fine.balance))
        of_area = patch.off + error
        if patch.power < inf:
            misses = [log(punch.depth / depth) for punch in (coarse, fine)]
            error += max(np.square(misses)) * fine.stiffness * depth / force / patch.power
            radius *= exp(-misses[1] / patch.power)
            of_area += fitted.MERIDIAN_RADIUS * max(abs(misses[0] - misses[1]), abs(misses[1])) / patch.power
        error += patch.off**2 * fine.stiffness * depth / force
        with stage("solve"):
            solution = depth * fine.punch + fine.pressed
            error += fine.forms.unresolved(solution)
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
            contact=ContactResult(patch.area(radius), of_area),
            energy=pi * float(solution @ residual),
        )
