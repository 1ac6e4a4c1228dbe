"""A reduced basis: many Poisson's ratios on one mesh from few solves, with a bound on the error of F.

Divided by μ the operator is K(t) = A_μ + t A_λ, t = λ/μ. In the span of solutions for a few t, the Galerkin solution
has the smallest energy: F is an upper bound, with error

    F_rb·d - F_h·d = r K(t)⁻¹ r <= r K(t₀)⁻¹ r <= r P r / λ_min(P K(t₀))        for t >= t₀,

with r the residual and P the preconditioner for the smallest t: one application of P for each t (A. K. Noor and
J. M. Peters, AIAA J. 18, 455, 1980; G. Rozza, D. B. P. Huynh and A. T. Patera, Arch. Comput. Methods Eng. 15, 229,
2008).
"""

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import global_sum, vector
from epsmesh.solve.krylov import keep, solver_of
from epsmesh.solve.linear_solver import LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import Response, reaction
from epsmesh.solve.spaces import ElasticSpace

# Lanczos gives λ_min from above: safety factor on it.
_TRUST = 0.5
_LAMBDA, _MU = MaterialLaw.of(1.0, 0.0), MaterialLaw.of(0.0, 1.0)


@dataclass(frozen=True)
class Reduced:
    """Result of the basis for one t and μ = 1 Pa: response, relative bound on F, coefficient of each solution."""

    response: Response
    bound: float
    weights: FloatArray


class ReducedBasis:
    """Reduced basis in a space of displacements: solutions for a few t, evaluated for others; a context manager."""

    def __init__(self, space: ElasticSpace, solver: LinearSolver, movement: Movement):
        """Begin without solutions, for a ``movement`` of one motion; collective.

        ``solver`` is that of the ``space`` for the smallest t to be evaluated, and must live as long.
        """
        self._space, self._solver = space, solver
        (motion,) = movement.motions
        self._movement, self._mirrored = movement, self._space.body.mirrored
        self._stack = ExitStack()
        # Terms of the residual: first the loads, then two for each w.
        self._parts: list[PETSc.Vec] = []
        self._solutions: list[PETSc.Vec] = []
        self._reactions: list[FloatArray] = []
        self._products = np.zeros((0, 2))  # w_i · parts_j
        self._result = self._vector()
        held = self._vector()
        held.array[:] = self._space.held(motion)[: self._space.owned]
        self._held = held
        self._held_energy = [self._add(held, law, sign=-1.0) for law in (_LAMBDA, _MU)]
        self._residual, self._under_p = self._vector(), self._vector()
        self._residual.array[:] = self._parts[0].array + self._parts[1].array
        self._least = _TRUST * _smallest_eigenvalue(self._solver, self._residual)

    def __enter__(self) -> "ReducedBasis":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add(self, correction: FloatArray) -> None:
        """Add a solution, less the prescribed displacements, to the basis; owned dofs, collective."""
        added = self._vector()
        added.array[:] = correction
        # Orthogonalised, so that the small systems stay well conditioned.
        for other in self._solutions:
            added.axpy(-added.dot(other), other)
        norm = added.norm()
        if norm <= 1e-10 * float(
            np.linalg.norm(global_sum(self._space.comm, np.array([correction @ correction]))) ** 0.5
        ):
            return
        added.scale(1 / norm)
        known = len(self._parts)
        self._solutions.append(added)
        for law in (_LAMBDA, _MU):
            self._add(added, law, sign=1.0)
        new = self._parts[known:]
        products = np.zeros((len(self._solutions), len(self._parts)))
        products[:-1, :known] = self._products
        products[:-1, known:] = np.reshape([part.dot(w) for w in self._solutions[:-1] for part in new], (-1, len(new)))
        products[-1] = [part.dot(added) for part in self._parts]
        self._products = products

    def evaluate(self, t: float) -> Reduced:
        """Return force, energy and bound for t = λ/μ, at the cost of one application of P; collective.

        The products of terms and solutions give the loads b_q = -A_q·held and the w_i·A_q·w_j.
        """
        count = len(self._solutions)
        theta = np.array([t, 1.0])
        movement, columns = self._products[:, :2], self._products[:, 2:].reshape(count, count, 2)
        weights = np.linalg.solve(columns @ theta, movement @ theta)
        mixture = np.concatenate([theta, -np.outer(weights, theta).reshape(-1)])
        self._residual.set(0.0)
        self._residual.maxpy(mixture, self._parts)
        self._solver.precondition(self._residual, self._under_p)
        residual = float(self._residual.dot(self._under_p))
        twice_energy = float(np.dot(self._held_energy, theta) - weights @ (movement @ theta))
        reactions = np.array(self._reactions)  # for each part, of the unmodified operator
        on_probe = reactions.T @ np.concatenate([theta, np.outer(weights, theta).reshape(-1)])
        response = reaction(self._movement, np.array([[twice_energy]]), on_probe[None, :], self._mirrored)
        bound = max(residual, 0.0) / self._least / twice_energy
        return Reduced(response, bound, weights)

    def displacement(self, reduced: Reduced) -> PETSc.Vec:
        """Return the displacement of an evaluation, with the motion's amount.

        The basis owns it; the next call overwrites it.
        """
        self._held.copy(self._result)
        for weight, solution in zip(reduced.weights, self._solutions, strict=True):
            self._result.axpy(float(weight), solution)
        self._result.scale(self._movement.amounts[0])
        return self._result

    def _add(self, values: PETSc.Vec, law: MaterialLaw, *, sign: float) -> float:
        """Add sign · A·``values`` to the terms of the residual; return ``values``·A·``values``; collective."""
        space, part = self._space, self._vector()
        space.set_displacement(values)
        space.apply(part, law)
        energy = float(part.dot(values))
        on_probe = part.array.reshape(-1, 3)[space.probe_owned].sum(axis=0)
        self._reactions.append(global_sum(space.comm, on_probe))
        part.scale(sign)
        part.array[space.prescribed_owned] = 0.0
        self._parts.append(part)
        return energy

    def _vector(self) -> PETSc.Vec:
        return self._stack.enter_context(vector(self._space.space))


def _smallest_eigenvalue(solver: LinearSolver, load: PETSc.Vec) -> float:
    """Return an upper estimate of the smallest eigenvalue of preconditioner times operator, by Lanczos; collective."""
    if solver.ksp.getType() == "preonly":
        return 1.0
    with ExitStack() as stack:
        ksp = solver_of("eigenvalues", solver.matrix, stack, solver.ksp.pc)
        ksp.setComputeEigenvalues(True)
        solution = keep(stack, load.duplicate())
        ksp.solve(load, solution)
        return float(np.min(np.real(ksp.computeEigenvalues())))
