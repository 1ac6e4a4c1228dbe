"""Neo-Hookean tissue at large displacements in NGSolve: a bonded disc, or a ball in frictionless contact.

Both minimise W = μ/2 (A : A - 3) - μ ln J + λ/2 (J - 1)² by Newton's method, in load steps, with halved steps where the
energy would grow. The disc is a prescribed displacement. The ball is an analytical obstacle for the deformed surface:
its penalty energy ½ k ⟨-g⟩², g the distance from the ball and k = ``gamma`` E p²/h, is minimised with W.
"""

from math import isfinite
from typing import Any

import ngsolve as ng

from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts

# Most steps of Newton's method, and halvings of one, in a load step; and halvings of a load step.
_MOST_STEPS, _HALVINGS, _MOST_REFUSED = 25, 10, 5
_ROUNDING = 1e-13


class _Refused(Exception):
    """Newton's method does not converge."""


def large_force(scene: Task, mesh: Any, order: int, steps: int, gamma: float, tolerance: float, parts: Parts) -> Answer:
    """Return F / d; Newton's method ends when its decrement is below ``tolerance`` of the energy.

    Raises:
        RuntimeError: if a load step does not converge.
    """
    model = _Model(scene, mesh, order, gamma, tolerance)
    reached, step, refused = 0.0, scene.depth / steps, 0
    while reached < scene.depth:
        there = min(scene.depth, reached + step)
        before = model.state.vec.CreateVector()
        before.data = model.state.vec
        try:
            model.advance(there, there - reached)
            reached = there
        except _Refused as why:
            model.state.vec.data = before
            model.depth.Set(reached)
            step, refused = step / 2, refused + 1
            if refused > _MOST_REFUSED:
                raise RuntimeError(f"load steps end at {reached:.3g} of {scene.depth} mm: {why}") from why
    parts.end("solve")
    return Answer(2 ** len(scene.planes) * model.force() / scene.depth, model.space.ndof, parts.seconds)


class _Model:
    """The energy, its state, and Newton's method at one depth."""

    def __init__(self, scene: Task, mesh: Any, order: int, gamma: float, tolerance: float):
        mu = 1 / (2 * (1 + scene.poisson))
        lam = 2 * mu * scene.poisson / (1 - 2 * scene.poisson)
        self.is_ball = scene.probe[0] == "ball"
        mirrors = {f"dirichlet{axis}": f"mirror_{axis}" for axis in scene.planes}
        held = "fixed" if self.is_ball else "probe|fixed"
        self.space = ng.VectorH1(mesh, order=order, dirichlet=held, **mirrors)
        self.depth, self.tolerance = ng.Parameter(0.0), tolerance
        u = self.space.TrialFunction()
        gradient = ng.Id(3) + ng.Grad(u)
        volume = ng.Det(gradient)
        stored = mu / 2 * (ng.InnerProduct(gradient, gradient) - 3) - mu * ng.log(volume)
        stored += lam / 2 * (volume - 1) * (volume - 1)
        self.energy = ng.BilinearForm(self.space, symmetric=True)
        self.energy += ng.Variation(stored.Compile() * ng.dx)
        if self.is_ball:
            radius = scene.probe[1]
            centre = ng.CF((0, 0, radius - self.depth))
            away = ng.CF((ng.x, ng.y, ng.z)) + u - centre
            inside = radius - ng.sqrt(ng.InnerProduct(away, away))
            self.stiff = gamma * order**2 / ng.specialcf.mesh_size
            pressed = ng.IfPos(inside, self.stiff / 2 * inside * inside, 0)
            self.energy += ng.Variation(pressed.Compile() * ng.ds("probe", bonus_intorder=2))
        self.state = ng.GridFunction(self.space)
        self.down = ng.GridFunction(self.space)
        if not self.is_ball:
            self.down.Set(ng.CF((0, 0, -1)), definedon=mesh.Boundaries("probe"))
        self.mesh, self.radius = mesh, scene.probe[1]
        self.residual, self.change, self.trial = (self.state.vec.CreateVector() for _ in range(3))

    def advance(self, depth: float, step: float) -> None:
        """Go on to a ``depth``, by a ``step``.

        Raises:
            _Refused: if Newton's method does not converge.
        """
        self.depth.Set(depth)
        if not self.is_ball:  # the tangent's response to the step is the initial guess
            self._linearise()
            self.residual.data = self.energy.mat * self.down.vec
            self.change.data = self.down.vec - self.inverse * self.residual
            self.state.vec.data += step * self.change
        stored = self.energy.Energy(self.state.vec)
        if not isfinite(stored):
            raise _Refused("tissue is turned inside out")
        for _ in range(_MOST_STEPS):
            self.energy.Apply(self.state.vec, self.residual)
            self._linearise()
            self.change.data = self.inverse * self.residual
            decrement = abs(ng.InnerProduct(self.change, self.residual))
            stored = self._descend(stored)
            if decrement <= self.tolerance * abs(stored):
                return
        raise _Refused(f"no equilibrium after {_MOST_STEPS} steps")

    def _descend(self, stored: float) -> float:
        for halvings in range(_HALVINGS):
            self.trial.data = self.state.vec - 0.5**halvings * self.change
            energy = self.energy.Energy(self.trial)
            if isfinite(energy) and energy <= stored + _ROUNDING * abs(stored):
                self.state.vec.data = self.trial
                return float(energy)
        raise _Refused("no step reduces the energy")

    def _linearise(self) -> None:
        self.energy.AssembleLinearization(self.state.vec)
        self.inverse = self.energy.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")

    def force(self) -> float:
        """Return F of the modelled part: the reaction, or the pressure of the penalty."""
        if not self.is_ball:
            self.energy.Apply(self.state.vec, self.residual)
            return abs(float(ng.InnerProduct(self.residual, self.down.vec)))
        away = ng.CF((ng.x, ng.y, ng.z)) + self.state - ng.CF((0, 0, self.radius - self.depth))
        distance = ng.sqrt(ng.InnerProduct(away, away))
        inside = self.radius - distance
        pressed = ng.IfPos(inside, self.stiff * inside, 0) * -away[2] / distance
        return abs(float(ng.Integrate(pressed, self.mesh, definedon=self.mesh.Boundaries("probe"), order=10)))
