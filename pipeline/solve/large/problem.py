"""A neo-Hookean body that a bonded probe presses, by displacement elements, in steps of the depth.

The force is the reaction: nodal forces on the probe's dofs, along the travel as the work that they do on it. It must
be the derivative of the stored energy by the depth, whose integral over the steps is held against the energy itself.

Its error bar is made as that of linear elasticity, by one degree more. With the residual r of the solution u there,
and r' that of v = ∂u/∂d under the tangent K,

    F_p - F_{p+1} = r'·K⁻¹ r,    of second order in what degree p + 1 changes.

(r'·K⁻¹ r' · r·K⁻¹ r)^½ is at least that, and takes its place: it does not vanish by chance. For K stands the operator
of linear elasticity: at moderate depths the result is the same to a few per cent, and at larger ones elements of one
degree more give way at the probe's edge, where the tangent is not definite.
"""

from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.elements import DisplacementElements
from pipeline.solve.enrich import energy_decrements
from pipeline.solve.error import error_bar
from pipeline.solve.large.forms import NeoHookeanForms
from pipeline.solve.large.newton import Equilibrium, LargeError, assemble, tangent_product
from pipeline.solve.linear import Level, LinearSolver, is_direct
from pipeline.solve.loads import Loads, Motion
from pipeline.solve.material import MaterialLaw
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.reaction import Response, reaction, sums
from pipeline.solve.rim import plain_share
from pipeline.solve.solution import BALANCE_LIMIT, TOLERANCE, Solution
from pipeline.solve.strain import largest_of
from pipeline.solve.vectors import vector
from pipeline.stages import Times, recharge, recorded, stage

# The depth is reached in so many steps at least; smaller ones than this share of it are not tried.
_FEWEST, _SMALLEST = 3, 1 / 50
# A step that leaves less than this share of the way goes to its end.
_SLIVER = 1e-6
# Newton's steps that make a step of the depth one to lengthen the next of.
_EASY = 4
# Work and energy may differ by this share, and by what rounding makes of energies where strains are tiny. Where an
# element at the edge folds between the points that it is integrated at, energy is lost that no work was done for.
_WORK, _ROUNDING = 3e-4, 1e-13


@dataclass
class Walk:
    """How far a ``motion`` of the probe has gone in a body of a ``law``.

    ``path`` has depth (m), force (N) and energy (J) of each step, of the modelled part; ``displacement`` (owned dofs)
    is that at the last one. ``times`` and ``iterations`` are what it took, and no depth begins with a step of more than
    the last one, ``step`` (m).
    """

    law: MaterialLaw
    motion: Motion
    displacement: FloatArray
    path: list[tuple[float, float, float]] = field(default_factory=lambda: [(0.0, 0.0, 0.0)])
    step: float = inf
    iterations: int = 0
    times: list[Times] = field(default_factory=list)

    @property
    def reached(self) -> float:
        """The depth (m) of the last step."""
        return self.path[-1][0]


class LargeProblem(QuasiStaticProblem):
    """The spaces of a mesh, a degree and conditions, for neo-Hookean bodies of one material; a context manager.

    A depth begins where the one before ended, if that was no deeper: depths of a sweep share one walk.
    """

    _walk: Walk | None = None

    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = TOLERANCE,
        estimate: bool = False,
    ) -> Solution:  # fmt: skip
        """Press to the depth of ``loads``, one translation, in steps, and return force, energy and checks; collective.

        ``tolerance`` has no part in it: Newton's method ends where what it gains is rounding.

        Raises:
            LargeError: if Newton's method does not get there, or what it finds fails a check.
        """
        (motion,), (depth,) = loads.motions, loads.amounts
        elements, fine = self.elements, self.elements.displacements
        assert isinstance(elements, DisplacementElements)
        held = fine.dofs.held(motion)
        self._forms = NeoHookeanForms(fine.dofs.space, fine.forms)
        with recorded() as times, ExitStack() as stack:
            direct = is_direct(method, self.dofs, fine.degree)
            levels = elements.levels(law, stack, direct=direct)
            solver = LinearSolver(levels, direct=direct, tolerance=TOLERANCE)
            stack.callback(solver.close)
            body = Equilibrium(fine, self._forms, solver)
            stack.callback(body.close)
            displacement, rate = (stack.enter_context(vector(fine.dofs.space)) for _ in range(2))
            with stage("solve"):
                walk = self._begun(law, motion, depth)
                path = self._press(body, displacement, held, depth, walk)
                response = self._reaction_at(body, displacement, held, loads)
                self._check(path, law)
                fine.set_displacement(displacement)
            whole = 2.0 ** len(self._body.mirrored)
            solution = Solution(
                response=response,
                max_strain=self._largest_strain(),
                dofs=fine.dofs.whole_dofs,
                cells=self._body.cells,
                iterations=walk.iterations,
                times=times,
                stored=whole * path[-1, 2],
            )
            if not estimate:
                return solution
            with stage("error bar"), vector(fine.dofs.space) as unit:
                unit.array[:] = held[: fine.dofs.owned]
                body.move(displacement, unit, rate)
            found, more = self._decrement(elements, law, levels, displacement, rate, stack)
            fine.set_displacement(displacement)
        plain = plain_share(self._body)
        decrement = whole * np.sqrt(found[0, 0] * found[1, 1])
        if not decrement < response.stiffness[0, 0] * depth:
            raise LargeError(
                f"no error bar: elements of degree {fine.degree + 1}, of which it is made, give way at the probe's "
                "edge; use a smaller depth, a larger rim, or degree 2"
            )
        bar = error_bar(decrement / (response.stiffness[0, 0] * depth), fine.degree, plain=plain)
        return replace(
            solution, decrements=np.array([[decrement / depth]]), plain=plain, bars=bar * response.stiffness,
            estimate_iterations=more,
        )  # fmt: skip

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last displacement (m) and each owned cell's principal stretches, less 1; collective."""
        return self.elements.displacements.forms.displacement, self._forms.principal_strains(self._body)

    def _largest_strain(self) -> float:
        return largest_of(self._forms.principal_strains(self._body), self._body, self._conditions.front)

    def _begun(self, law: MaterialLaw, motion: Motion, depth: float) -> Walk:
        """Return the walk that leads to ``depth``: that of the last solve, or a new one. What it took is charged."""
        walk = self._walk
        if walk is None or (walk.law, walk.motion) != (law, motion) or walk.reached > depth:
            walk = Walk(law, motion, np.zeros(self.elements.displacements.dofs.owned))
        self._walk = walk if self._reuse else None
        for times in walk.times:
            recharge(times)
        return walk

    def _press(
        self, body: Equilibrium, displacement: PETSc.Vec, held: FloatArray, depth: float, walk: Walk
    ) -> FloatArray:
        """Take ``displacement`` along a ``walk`` to ``depth``; return its path, depth, force and energy of each step.

        Each step begins along the tangent; one that Newton's method cannot end is halved.

        Raises:
            LargeError: if that gets too small; the walk has come as far as it says.
        """
        fine = self.elements.displacements
        space, owned = fine.dofs.space, fine.dofs.owned
        fine.forms.set_law(walk.law)
        displacement.array[:] = walk.displacement
        longest = depth / _FEWEST
        step, before = min(walk.step, longest), body.iterations
        with recorded() as times, ExitStack() as stack:
            walk.times.append(times)
            unit, rate, trial, forces = (stack.enter_context(vector(space)) for _ in range(4))
            unit.array[:] = held[:owned]
            while (reached := walk.reached) < depth:
                body.move(displacement, unit, rate)
                step, steps = self._step(body, displacement, rate, trial, walk, step, depth)
                displacement.array[:] = trial.array
                energy = body.energy(displacement)
                body.forces(displacement, forces)
                there = depth if step >= depth - reached else reached + step
                walk.path.append((there, self._work(forces, held), energy))
                walk.displacement[:] = displacement.array
                walk.iterations, before = walk.iterations + body.iterations - before, body.iterations
                walk.step = step = min(step * (2 if steps <= _EASY else 1), longest)
        return np.array(walk.path)

    def _step(
        self,
        body: Equilibrium,
        displacement: PETSc.Vec,
        rate: PETSc.Vec,
        trial: PETSc.Vec,
        walk: Walk,
        step: float,
        depth: float,
    ) -> tuple[float, int]:
        """Write the equilibrium a ``step`` (m) farther into ``trial``; return the step, and Newton's steps to it.

        ``rate`` is the tangent at ``displacement``, for a metre; at ``depth`` (m) the ``walk`` ends.
        """
        reached = walk.reached
        if step > (1 - _SLIVER) * (depth - reached):
            step = depth - reached  # not one more for what rounding leaves
        with vector(self.elements.displacements.dofs.space) as forces:
            while True:
                trial.array[:] = displacement.array + step * rate.array
                try:
                    if not np.isfinite(body.energy(trial)):
                        raise LargeError("tissue is turned inside out")
                    body.forces(trial, forces)
                    return step, body.settle(trial, self._norm_on_held(forces))
                except LargeError as error:
                    step /= 2
                    if step < _SMALLEST * depth:
                        raise LargeError(self._stopped(walk, depth, error)) from error

    def _stopped(self, walk: Walk, depth: float, why: LargeError) -> str:
        """Return what to say of a walk that ends before ``depth`` (m)."""
        reached, force, _ = walk.path[-1]
        whole = 2.0 ** len(self._body.mirrored) * force
        return (
            f"reached {reached * 1e3:.3g} mm of {depth * 1e3:.3g} mm, where F is {whole:.4g} N; Newton's method "
            f"stopped there ({why}): the tissue gives way, or elements at the probe's edge are squeezed to nothing; "
            "use a smaller depth, or a larger rim"
        )

    def _norm_on_held(self, forces: PETSc.Vec) -> float:
        on_held = forces.array[self.elements.displacements.dofs.prescribed_owned]
        return float(np.sqrt(self.elements.displacements.dofs.comm.allreduce(float(on_held @ on_held))))

    def _work(self, forces: PETSc.Vec, held: FloatArray) -> float:
        dofs = self.elements.displacements.dofs
        return float(dofs.comm.allreduce(float(forces.array @ held[: dofs.owned])))

    def _reaction_at(self, body: Equilibrium, displacement: PETSc.Vec, held: FloatArray, loads: Loads) -> Response:
        """Return the response of the whole body, as a secant; see that forces balance."""
        (depth,), fine = loads.amounts, self.elements.displacements
        with vector(fine.dofs.space) as forces:
            body.forces(displacement, forces)
            found = sums(fine.dofs, [forces.array / depth], [held])
        stationary = found.works[None]
        response = reaction(loads, stationary, found.on_probe, self._body.mirrored)
        balance = found.imbalance(found.works, loads, self._body.mirrored)
        if not balance <= BALANCE_LIMIT:
            raise LargeError(f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}")
        return replace(response, balance=balance)

    def _check(self, path: FloatArray, law: MaterialLaw) -> None:
        """See that the force is the derivative of the energy by the depth, along the ``path``.

        Raises:
            LargeError: if it is not.
        """
        depth, force, energy = path.T
        depths = depth / depth[-1]
        through = np.polynomial.Polynomial.fit(depths, force, min(len(path) - 1, 4)).integ(lbnd=0.0)
        wrong = abs(float(through(1.0)) * depth[-1] / energy[-1] - 1)
        rounding = _ROUNDING * law.lame_mu[0] * self._volume() / energy[-1]
        if not wrong <= _WORK + rounding:
            raise LargeError(
                f"the force is not the derivative of the energy by the depth: {wrong:.1e} apart, since an element at "
                "the probe's edge folds; use a smaller depth, a larger rim, or degree 2"
            )

    def _volume(self) -> float:
        points = np.ptp(np.asarray(self._body.mesh.geometry.x), axis=0)
        return float(self._body.comm.allreduce(float(points.prod())))

    @stage("error bar")
    def _decrement(
        self,
        elements: DisplacementElements,
        law: MaterialLaw,
        levels: list[Level],
        displacement: PETSc.Vec,
        rate: PETSc.Vec,
        stack: ExitStack,
    ) -> tuple[FloatArray, int]:
        """Return a·K⁻¹·b (2, 2) of the residuals of the solution and of its ``rate`` in the space of one degree more.

        And the iterations that it took.
        """
        fine = elements.displacements
        above, solver = elements.finer(law, levels, stack)
        finer = above.displacements
        forms = NeoHookeanForms(finer.dofs.space, finer.forms)
        finer.forms.set_law(law)
        residuals = [stack.enter_context(vector(finer.dofs.space)) for _ in range(2)]
        with vector(finer.dofs.space) as there:
            fine.set_displacement(rate)
            finer.forms.displacement.interpolate(fine.forms.displacement)
            there.array[:] = finer.forms.displacement.x.array[: finer.dofs.owned]
            fine.set_displacement(displacement)
            finer.forms.displacement.interpolate(fine.forms.displacement)
            assemble(forms.residual, residuals[0])
            tangent_product(forms, there, residuals[1])
        for residual in residuals:
            residual.scale(-1.0)
            residual.array[finer.dofs.prescribed_owned] = 0.0
        if not all(np.isfinite(residual.norm()) for residual in residuals):
            raise LargeError("elements of one degree more turn tissue inside out, so that no error bar can be made")
        found, _, iterations = energy_decrements(solver, residuals)
        return found, iterations
