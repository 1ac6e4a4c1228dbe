"""Punch solutions: a round tool in contact up to a given radius; linear scenes in the half plane (r, z).

See :mod:`epsmesh.solve.meridian.contact`. Lengths are in units of the outer contact radius, stresses in units of μ of
region 0, displacements in metres.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log, pi

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading, MeridianArrays
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.rounded import quarter_turn
from epsmesh.solve import SolveError
from epsmesh.solve.meridian.forms import MeridianForms, Meshes
from epsmesh.solve.meridian.system import HalfPlane, System, meshes_of
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Mesh and degree of trials: they give the depth of a radius to about 1e-5.
TRIAL_DEGREE = 3
_TRIAL = Grading(1e-4, 1.0, 4.0)
# A kink closer to an edge of contact than this, in units of a, lies within the small elements there.
_APART = 1e-2
_POINTS, STEP = 48, 1e-5
# Range of the exponent of the radius in the depth: 1 for a cone, 2 for a ball, more for flat tools with round edges.
POWERS = (0.5, 8.0)
_MOST_SETS, _SLACK = 40, 1e-6


# Pairs of radii (m), from the innermost on.
Rings = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class RoundTool:
    """An axisymmetric tool, above the surface that it touches.

    ``gap`` returns the initial distance (n,) along the axis (m) between tool and surface, at radii (n,) up to ``limit``
    (m), where the tool ends. ``kinks`` are the radii (m) at which the gap is not smooth. ``distance`` is that of points
    (n, 3), in m from the first touch, to the tool at a depth (m), for contact at large displacements. Up to
    the radius ``flat`` (m) the tool is flat. ``friction`` is the coefficient, infinite for tissue that sticks.
    """

    gap: Callable[[FloatArray], FloatArray]
    limit: float
    kinks: tuple[float, ...] = ()
    distance: Callable[[FloatArray, float], Distance] | None = None
    flat: float = 0.0
    friction: float = 0.0

    def is_flat(self, radius: float) -> bool:
        """Return whether the gap is zero all the way to a ``radius`` (m)."""
        return not np.any(self.gap(np.linspace(0.0, radius, _POINTS)))

    def indentation(self, radius: float) -> float:
        """Return the depth (m) at which contact on an elastic half-space has this ``radius`` (I. N. Sneddon, 1965)."""
        if radius <= self.flat:
            return 0.0
        sine, weights = quarter_turn(self.flat / radius)
        at = radius * sine
        slope = (self.gap(at) - self.gap((1 - STEP) * at)) / (STEP * at)
        return radius * float(weights @ slope)

    def on_half_space(self, depth: float, limit: float) -> tuple[float, float]:
        """Return the contact radius on an elastic half-space, up to a ``limit`` (m), and an exponent in the depth.

        It is that of the part outside of its flat face.
        """
        if self.indentation((1 - STEP) * limit) <= depth:
            return limit, 2.0
        low, high = self.flat, limit
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if self.indentation(middle) < depth else (low, middle)
        wider = min(low + 0.01 * (low - self.flat), limit)
        power = log(self.indentation(wider) / depth) / log((wider - self.flat) / (low - self.flat))
        return low, min(max(power, POWERS[0]), POWERS[1])


@dataclass(frozen=True, eq=False)
class PunchSolution:
    """Solution for contact up to a radius, with or without rings: ``punch`` is u₁ (per m of depth), ``pressed`` u₂ (m).

    ``depth`` (m) is the depth at which this is the true radius, ``stiffness`` E₁₁ (per m) and ``preload`` E₁₂ those of
    F = d E₁₁ + E₁₂, in units of μ a.
    """

    radius: float
    unit: float
    depth: float
    stiffness: float
    preload: float
    balance: float
    punch: FloatArray
    pressed: FloatArray
    forms: MeridianForms

    def force(self, depth: float) -> float:
        """Return F at a depth (m), in units of μ a times a metre."""
        return depth * self.stiffness + self.preload


class Punches:
    """Punch solutions of one tool on the meridian of one body; ``count`` is the number of solves."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, law: MaterialLaw):
        self._meridian, self._tool, self._law = meridian, tool, law
        self.count = 0

    def at(self, radius: float) -> PunchSolution:
        """Return the punch solution for a contact ``radius`` (m), on a coarse mesh."""
        arrays, meshes = self.mesh(radius, _TRIAL)
        return self.solve(meshes, arrays, radius, TRIAL_DEGREE)

    def mesh(
        self, radius: float, grading: Grading, lost: Rings = (), marks: tuple[float, ...] = ()
    ) -> tuple[MeridianArrays, Meshes]:
        """Return the mesh for a contact ``radius`` (m) without rings ``lost``, with nodes at ``marks`` (m)."""
        kinks = {kink for kink in self._tool.kinks if kink < (1 - _APART) * radius}
        for edge in (edge for ring in lost for edge in ring):
            kinks = {kink for kink in kinks if abs(kink - edge) > _APART * radius}
        meridian = replace(self._meridian, probe_radius=radius, kinks=tuple(sorted(kinks | set(marks))))
        if lost and not isinstance(meridian, EllipticMeridian):
            meridian = replace(meridian, lost=lost)
        with stage("meshing"):
            arrays = meridian.mesh(grading)
            return arrays, meshes_of(arrays)

    def solve(self, meshes: Meshes, arrays: MeridianArrays, radius: float, degree: int) -> PunchSolution:
        """Solve for a flat punch and for the gap, in one degree."""
        self.count += 1
        with stage("assembly"):
            system = System(meshes, degree, self._law)
            gap = self._gap(system, arrays)
        with system.factors(system.probe) as solve:
            flat, own = solve(np.full(len(gap), -1.0)), solve(gap)
        edge = system.probe[-1]
        return PunchSolution(
            radius=radius,
            unit=arrays.unit,
            depth=-own.residual[edge] / flat.residual[edge],
            stiffness=flat.twice_energy,
            preload=2 * pi * float(flat.solution @ own.residual),
            balance=max(flat.balance, own.balance),
            punch=flat.solution,
            pressed=own.solution,
            forms=system.forms,
        )

    def _gap(self, system: System, arrays: MeridianArrays) -> FloatArray:
        """Return the gap (m) at the tool's nodes."""
        return self._tool.gap(np.minimum(system.radii * arrays.unit, self._tool.limit))

    def touching(
        self, radius: float, depth: float, marks: tuple[float, ...], lost: Rings
    ) -> tuple[FloatArray, BoolArray]:
        """Return the radii (m) of nodes up to a ``radius`` (m), sorted, and which are active at a ``depth`` (m).

        A primal-dual active set, as in three dimensions, on a mesh with nodes at the ``marks`` (m). Its initial guess
        is contact without the rings ``lost``.

        Raises:
            SolveError: if the set does not settle.
        """
        arrays, meshes = self.mesh(radius, _TRIAL, marks=marks)
        with stage("assembly"):
            system = System(meshes, TRIAL_DEGREE, self._law)
            bounds = self._gap(system, arrays) - depth
        radii = system.radii * arrays.unit
        active = bounds < 0
        for inner, outer in lost:
            active &= (radii < inner) | (radii > outer)
        for _ in range(_MOST_SETS):
            self.count += 1
            with system.factors(system.probe[active]) as solve:
                found = solve(bounds[active])
            reactions, moved = found.residual[system.probe], found.solution[system.probe]
            slack = _SLACK * np.abs(reactions[active]).mean()
            following = np.where(active, reactions < slack, moved - bounds > _SLACK * depth)
            if np.array_equal(following, active):
                return radii, active
            active = following
            if not active.any():
                break
        raise SolveError('the contact area on the meridian does not settle: use model = "3d"')
