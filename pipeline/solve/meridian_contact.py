"""Unilateral contact of round scenes in the half plane (r, z): how much of a tool touches, and F to about 1e-6.

With a trial radius a of contact the scene is linear: below the tool u_z = -(d - g(r)) for r < a, with the gap g before
anything moves, all else free; the solution is d u₁ + u₂, of a flat punch and of the gap alone. Both have stresses like
(a - r)^-½ at the edge of contact. Where contact ends by itself these cancel, which tells the depth that belongs to a:
d(a) = -k₂/k₁, the k being the reactions of the one node at the edge. A few trials on coarse meshes find the radius that
belongs to the depth asked for. At a given depth F is stationary in the radius, being the largest of
F(a) = d E₁₁(a) + E₁₂(a), E the work of one solution on the other: what the radius is off by, F is by its square.

Lengths are in units of a, stresses in units of μ of region 0, displacements in metres.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import exp, inf, log, pi

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import AXIS, Grading, MeridianArrays
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.linear import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.material import MaterialLaw
from pipeline.solve.meridian_forms import JoinedForms, MeridianForms
from pipeline.solve.meridian_refine import DirectProblem, best_answer, error_bar, meshes_of, only_along_axis, refined
from pipeline.solve.meridian_signs import check_signs
from pipeline.solve.meridian_system import Clock, HalfPlane, Meshes, factorised, forms_of, max_strain
from pipeline.solve.reaction import reaction
from pipeline.solve.solution import Solution
from pipeline.stages import stage

DEGREE = 5
# Trials are on this mesh, by elements of this degree: the depth of a radius comes out to some 1e-5.
TRIAL_DEGREE = 3
_TRIAL = Grading(1e-4, 1.0, 4.0)
# A depth this near to the one asked for is near enough: F errs by its square.
_NEAR, _MOST_TRIALS = 3e-4, 12
# Powers of the radius that the depth may go like: 1 of a cone, 2 of a ball, more of flat tools with round edges.
_POWERS = (0.5, 8.0)
# Contact as wide as this share of what is kept of the body has no edge left.
_WIDEST = 0.999
# A kink nearer to the edge of contact than this, in units of a, is within the small elements there.
_APART = 1e-2
_POINTS, _STEP = 48, 1e-5


@dataclass(frozen=True)
class RoundTool:
    """A tool that is the same all round its axis, above the surface that it touches.

    ``gap`` returns the distance (n,) along the axis (m) between tool and surface, at radii (n,) up to ``limit`` (m),
    where the tool ends, when its lowest point touches; ``kinks`` are the radii (m) at which that is not smooth.
    """

    gap: Callable[[FloatArray], FloatArray]
    limit: float
    kinks: tuple[float, ...] = ()

    def indentation(self, radius: float) -> float:
        """Return the depth (m) at which contact on an elastic half-space has a ``radius`` (I. N. Sneddon, 1965)."""
        sine, weights = _quarter_turn()
        at = radius * sine
        slope = (self.gap(at) - self.gap((1 - _STEP) * at)) / (_STEP * at)
        return radius * float(weights @ slope)


@cache
def _quarter_turn() -> tuple[FloatArray, FloatArray]:
    """Return sines and weights of a rule over a quarter of a turn."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    return np.sin(pi / 4 * (nodes + 1)), pi / 4 * weights


class MeridianContact(DirectProblem):
    """The meridian of a round scene that a tool presses along its axis, in contact as far as that is pressed."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, *, accuracy: float = 1e-5, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``."""
        self._meridian, self._tool = meridian, tool
        self._accuracy, self._degree = accuracy, degree

    @stage("axisymmetric contact")
    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = 0.0, estimate: bool = True
    ) -> Solution:
        """Find the contact at a depth, 0 <= ν <= 0.5, and its force.

        ``iterations`` counts the linear solves. Bars are there whether ``estimate`` asks for them or not.

        Raises:
            SolveError: if contact is not one round patch, reaches the edge of the body, or is not found; if a solve
                fails a check, or the error bar stays above 1e-3.
        """
        only_along_axis(loads)
        (depth,), clock = loads.amounts, Clock()
        search = _Search(self._meridian, self._tool, law, clock)
        radius, power = search.find(depth)
        best = best_answer(lambda grading: search.settle(radius, depth, power, grading, self._degree), self._accuracy)
        scale = law.lame_mu[0] * best.trial.unit
        per_depth = scale * best.force / depth
        response = reaction(
            loads, np.array([[per_depth]]), np.array([[0.0, 0.0, -per_depth]]), balance=best.trial.balance
        )
        return Solution(
            response, best.max_strain, best.trial.forms.dofs, best.cells, search.trials,
            bars=best.error * response.stiffness, contact_area=pi * best.radius**2, contact_radius=best.radius,
            stored=scale * best.twice_energy / 2,
            time_mesh=clock.seconds["mesh"], time_assemble=clock.seconds["assemble"],
            time_setup=clock.seconds["setup"], time_solve=clock.seconds["solve"],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Trial:
    """What contact of one radius gives; ``punch`` and ``pressed`` are u₁ (per m of depth) and u₂ (m).

    ``depth`` (m) is that at which contact ends there by itself, ``stiffness`` E₁₁ (per m) and ``preload`` E₁₂ those of
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
    forms: MeridianForms | JoinedForms

    def force(self, depth: float) -> float:
        """Return F at a depth (m), in units of μ a times a metre."""
        return depth * self.stiffness + self.preload


@dataclass(frozen=True, eq=False)
class _Found:
    """The contact at a depth: force and energy in units of μ a, radius (m), relative error."""

    trial: _Trial
    radius: float
    force: float
    twice_energy: float
    error: float
    max_strain: float
    cells: int


class _Search:
    """Looks for the radius of contact of a tool on the meridian of a body."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, law: MaterialLaw, clock: Clock):
        self._meridian, self._tool, self._law, self._clock = meridian, tool, law, clock
        kept = meridian.radius if isinstance(meridian, EllipticMeridian) else meridian.kept_radius
        self._widest = _WIDEST * kept
        self._limit = min(tool.limit, self._widest)
        self.trials = 0

    def find(self, depth: float) -> tuple[float, float]:
        """Return the radius (m) of contact and the power of it that the depth goes like; inf where the tool ends."""
        radius, power = self._on_half_space(depth)
        low, high, before = 0.0, self._limit, None
        for _ in range(_MOST_TRIALS):
            trial = self._try(radius)
            if radius == self._limit and trial.depth <= depth:
                if radius == self._widest < self._tool.limit:
                    raise SolveError("contact reaches the edge of what is kept of the body")
                return radius, inf
            if trial.depth <= 0:
                raise SolveError("no area of contact was found: the tool does not touch on its axis first")
            miss = log(trial.depth / depth)
            if before is not None:
                power = (miss - before[1]) / log(radius / before[0])
                power = min(max(power, _POWERS[0]), _POWERS[1])
            if abs(miss) < _NEAR:
                return radius, power
            low, high = (radius, high) if miss < 0 else (low, radius)
            before = radius, miss
            radius *= exp(-miss / power)
            if radius >= high:
                radius = high if high == self._limit != before[0] else (before[0] + high) / 2
            if radius <= low:
                radius = (before[0] + low) / 2
        raise SolveError(f"the radius of contact was not found in {_MOST_TRIALS} trials")

    def settle(self, radius: float, depth: float, power: float, grading: Grading, degree: int) -> _Found:
        """Return the contact at a depth, from solutions of two degrees with nearly the right radius.

        The error bar is that of :func:`error_bar`, and the square of what the radius is off by.
        """
        arrays, meshes = self._mesh(radius, grading)
        coarse = self._answer(meshes, arrays, radius, degree - 1)
        fine = self._answer(meshes, arrays, radius, degree)
        force = fine.force(depth)
        if not force > 0:
            raise SolveError("the solution is not a number or takes no force")
        error = error_bar(coarse.force(depth), force, degree, max(coarse.balance, fine.balance))
        if power < inf:
            misses = [log(trial.depth / depth) for trial in (coarse, fine)]
            error += max(np.square(misses)) * fine.stiffness * depth / force / power
            radius *= exp(-misses[1] / power)
        with self._clock("solve"):
            solution = depth * fine.punch + fine.pressed
            residual = fine.forms.residual(solution)
            check_signs(fine.forms, arrays, solution, residual, depth, self._tool.gap, self._tool.limit)
            strain = max_strain(fine.forms, arrays) / arrays.unit
        twice_energy = 2 * pi * float(solution @ residual)
        return _Found(fine, radius, force, twice_energy, error, strain, len(arrays.cells))

    def _on_half_space(self, depth: float) -> tuple[float, float]:
        """Return the radius on an elastic half-space, and the power of it that the depth goes like."""
        tool = self._tool
        if tool.indentation((1 - _STEP) * self._limit) <= depth:
            return self._limit, 2.0
        low, high = 0.0, self._limit
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if tool.indentation(middle) < depth else (low, middle)
        wider = 1.01 * low
        power = log(tool.indentation(min(wider, self._limit)) / depth) / log(min(wider, self._limit) / low)
        return low, min(max(power, _POWERS[0]), _POWERS[1])

    def _try(self, radius: float) -> _Trial:
        arrays, meshes = self._mesh(radius, _TRIAL)
        return self._answer(meshes, arrays, radius, TRIAL_DEGREE)

    def _mesh(self, radius: float, grading: Grading) -> tuple[MeridianArrays, Meshes]:
        kinks = tuple(kink for kink in self._tool.kinks if kink < (1 - _APART) * radius)
        with self._clock("mesh"):
            arrays = replace(self._meridian, probe_radius=radius, kinks=kinks).mesh(grading)
            return arrays, meshes_of(arrays)

    def _answer(self, meshes: Meshes, arrays: MeridianArrays, radius: float, degree: int) -> _Trial:
        """Solve for a flat punch and for the gap, with one degree."""
        self.trials += 1
        with self._clock("assemble"):
            forms, definite = forms_of(meshes, degree, self._law)
            stiffness = forms.stiffness()
            dofs, places = forms.on(PROBE)
            probe, support = dofs[:, 1], forms.locate(FIXED, 1)
            zero = [support, forms.locate(FIXED, 0), forms.locate(AXIS, 0)]
            free = np.setdiff1d(np.arange(forms.dofs), np.concatenate([probe, *zero]))
            unknown = stiffness[free][:, free]
            gap = self._tool.gap(np.minimum(places[:, 0] * arrays.unit, self._tool.limit))
            edge = probe[np.argmax(places[:, 0])]
        balance, solutions, residuals = 0.0, [], []
        with factorised(unknown, definite=definite, clock=self._clock) as solve, self._clock("solve"):
            for held in (np.full(len(probe), -1.0), gap):
                solution, residual, off, _ = refined(forms, solve, free, probe, support, held)
                solutions.append(solution)
                residuals.append(residual)
                balance = max(balance, off)
        (punch, pressed), (by_punch, by_gap) = solutions, residuals
        depth = -by_gap[edge] / by_punch[edge]
        stiff, preload = (2 * pi * float(punch @ residual) for residual in (by_punch, by_gap))
        return _Trial(radius, arrays.unit, depth, stiff, preload, balance, punch, pressed, forms)
