"""What a round tool does that touches as far as is tried: linear scenes in the half plane (r, z).

See :mod:`pipeline.solve.meridian.contact`. Lengths are in units of the outer radius of contact, stresses in units of μ
of region 0, displacements in metres.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import pi

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import AXIS, Grading, MeridianArrays
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.krylov import SolveError
from pipeline.solve.meridian.forms import JoinedForms, MeridianForms
from pipeline.solve.meridian.refine import meshes_of, refined
from pipeline.solve.meridian.system import HalfPlane, Meshes, factorised, forms_of
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# Trials are on this mesh, by elements of this degree: the depth of a radius comes out to some 1e-5.
TRIAL_DEGREE = 3
_TRIAL = Grading(1e-4, 1.0, 4.0)
# A kink nearer to an edge of contact than this, in units of a, is within the small elements there.
_APART = 1e-2
_POINTS, STEP = 48, 1e-5
_MOST_SETS, _SLACK = 40, 1e-6


# Pairs of radii (m), from the innermost on.
Rings = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class RoundTool:
    """A tool that is the same all round its axis, above the surface that it touches.

    ``gap`` returns the distance (n,) along the axis (m) between tool and surface, at radii (n,) up to ``limit`` (m),
    where the tool ends, when its lowest point touches; ``kinks`` are the radii (m) at which that is not smooth.
    """

    gap: Callable[[FloatArray], FloatArray]
    limit: float
    kinks: tuple[float, ...] = ()

    def is_flat(self, radius: float) -> bool:
        """Tell whether it lies on the surface all the way to a ``radius`` (m) when it touches."""
        return not np.any(self.gap(np.linspace(0.0, radius, _POINTS)))

    def indentation(self, radius: float) -> float:
        """Return the depth (m) at which contact on an elastic half-space has a ``radius`` (I. N. Sneddon, 1965)."""
        sine, weights = _quarter_turn()
        at = radius * sine
        slope = (self.gap(at) - self.gap((1 - STEP) * at)) / (STEP * at)
        return radius * float(weights @ slope)


@cache
def _quarter_turn() -> tuple[FloatArray, FloatArray]:
    """Return sines and weights of a rule over a quarter of a turn."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    return np.sin(pi / 4 * (nodes + 1)), pi / 4 * weights


@dataclass(frozen=True, eq=False)
class Trial:
    """What contact up to a radius gives, rings lost or not; ``punch`` is u₁ (per m of depth), ``pressed`` u₂ (m).

    ``depth`` (m) is that at which contact ends by itself at that radius, ``stiffness`` E₁₁ (per m) and ``preload`` E₁₂
    those of F = d E₁₁ + E₁₂, in units of μ a.
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


class Trials:
    """Solves for contact of one tool on the meridian of one body; ``count`` says how often it did."""

    def __init__(self, meridian: HalfPlane, tool: RoundTool, law: MaterialLaw):
        self._meridian, self._tool, self._law = meridian, tool, law
        self.count = 0

    def at(self, radius: float) -> Trial:
        """Return what contact up to a ``radius`` (m) gives, on a coarse mesh."""
        arrays, meshes = self.mesh(radius, _TRIAL)
        return self.solve(meshes, arrays, radius, TRIAL_DEGREE)

    def mesh(
        self, radius: float, grading: Grading, lost: Rings = (), marks: tuple[float, ...] = ()
    ) -> tuple[MeridianArrays, Meshes]:
        """Return the mesh for contact up to a ``radius`` (m) without rings ``lost``, with nodes at ``marks`` (m)."""
        kinks = {kink for kink in self._tool.kinks if kink < (1 - _APART) * radius}
        for edge in (edge for ring in lost for edge in ring):
            kinks = {kink for kink in kinks if abs(kink - edge) > _APART * radius}
        meridian = replace(self._meridian, probe_radius=radius, kinks=tuple(sorted(kinks | set(marks))))
        if lost and not isinstance(meridian, EllipticMeridian):
            meridian = replace(meridian, lost=lost)
        with stage("meshing"):
            arrays = meridian.mesh(grading)
            return arrays, meshes_of(arrays)

    def solve(self, meshes: Meshes, arrays: MeridianArrays, radius: float, degree: int) -> Trial:
        """Solve for a flat punch and for the gap, with one degree."""
        self.count += 1
        with stage("assembly"):
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
        with factorised(unknown, definite=definite) as solve, stage("solve"):
            for held in (np.full(len(probe), -1.0), gap):
                solution, residual, off, _ = refined(forms, solve, free, probe, support, held)
                solutions.append(solution)
                residuals.append(residual)
                balance = max(balance, off)
        (punch, pressed), (by_punch, by_gap) = solutions, residuals
        depth = -by_gap[edge] / by_punch[edge]
        stiff, preload = (2 * pi * float(punch @ residual) for residual in (by_punch, by_gap))
        return Trial(radius, arrays.unit, depth, stiff, preload, balance, punch, pressed, forms)

    def touching(
        self, radius: float, depth: float, marks: tuple[float, ...], lost: Rings
    ) -> tuple[FloatArray, BoolArray]:
        """Return the radii (m) of nodes up to a ``radius`` (m), sorted, and which touch at a ``depth`` (m).

        A primal-dual active set, as in three dimensions, on a mesh with nodes at the ``marks`` (m); it begins without
        the rings ``lost``.

        Raises:
            SolveError: if the set does not settle.
        """
        arrays, meshes = self.mesh(radius, _TRIAL, marks=marks)
        with stage("assembly"):
            forms, definite = forms_of(meshes, TRIAL_DEGREE, self._law)
            stiffness = forms.stiffness()
            dofs, places = forms.on(PROBE)
            order = np.argsort(places[:, 0])
            probe, radii = dofs[order, 1], places[order, 0] * arrays.unit
            zero = [forms.locate(FIXED, 1), forms.locate(FIXED, 0), forms.locate(AXIS, 0)]
            others = np.setdiff1d(np.arange(forms.dofs), np.concatenate(zero))
            bounds = self._tool.gap(np.minimum(radii, self._tool.limit)) - depth
        active = bounds < 0
        for inner, outer in lost:
            active &= (radii < inner) | (radii > outer)
        for _ in range(_MOST_SETS):
            self.count += 1
            free = np.setdiff1d(others, probe[active])
            solution: FloatArray = np.zeros(forms.dofs)
            solution[probe[active]] = bounds[active]
            with (
                factorised(stiffness[free][:, free], definite=definite) as solve,
                stage("solve"),
            ):
                for _ in range(2):
                    solution[free] -= solve(forms.residual(solution)[free])
            reactions = forms.residual(solution)[probe]
            slack = _SLACK * np.abs(reactions[active]).mean()
            following = np.where(active, reactions < slack, solution[probe] - bounds > _SLACK * depth)
            if np.array_equal(following, active):
                return radii, active
            active = following
            if not active.any():
                break
        raise SolveError('the area of contact on the meridian does not settle: use model = "3d"')
