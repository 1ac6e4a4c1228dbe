"""Many Poisson's ratios on one mesh from few solves: a reduced basis with a bound on what it costs F.

Divided by μ the operator is K(t) = A_μ + t A_λ, t = λ/μ: one parameter. With solutions w_i for a few t, the Galerkin
solution among their combinations has the smallest energy of them all, so that F from it is too high, and by

    F_rb·d - F_h·d = r K(t)⁻¹ r <= r K(t₀)⁻¹ r <= r P r / λ_min(P K(t₀))        for t >= t₀,

r being its residual, P the preconditioner for the smallest t. As r is a combination of a few vectors, so is the
bound, and costs nothing for another t (A. K. Noor and J. M. Peters, AIAA J. 18, 455, 1980; G. Rozza, D. B. P. Huynh and
A. T. Patera, Arch. Comput. Methods Eng. 15, 229, 2008, for the bound).
"""

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.elasticity import ElasticBody
from pipeline.solve.enrich import smallest_eigenvalue
from pipeline.solve.solution import global_sum

# λ_min is estimated from above, by Lanczos: its share that is relied on.
_TRUST = 0.5
_LAMBDA, _MU = (1.0, 0.0), (0.0, 1.0)


@dataclass(frozen=True)
class Reduced:
    """What the basis gives for one t and μ = 1 Pa: reaction (N), twice the energy (J), and the relative bound."""

    reaction: FloatArray
    twice_energy: float
    bound: float
    weights: FloatArray


class ReducedBasis:
    """Solutions of an :class:`ElasticBody` for a few t, and what follows from them for others; a context manager."""

    def __init__(self, body: ElasticBody, travel: tuple[float, float, float], smallest: float, method: str):
        """Begin with no solutions; ``smallest`` is the least t that will be asked for. Collective."""
        self._body, self._space = body, body.space
        self._travel = np.array(travel)
        self._stack = ExitStack()
        self._solver = self._stack.enter_context(body.solver((smallest, 1.0), method))
        # What the residual is made of, and what each of it becomes under P: first the loads, then two for each w.
        self._parts: list[PETSc.Vec] = []
        self._under_p: list[PETSc.Vec] = []
        self._solutions: list[PETSc.Vec] = []
        self._reactions: list[FloatArray] = []
        self._gram = np.zeros((0, 0))
        self._products = np.zeros((0, 2))  # w_i · parts_j
        self._result = self._vector()
        held = self._vector()
        held.array[:] = self._space.held[: self._space.owned]
        self._held = held
        self._held_energy = [self._add(held, lame, sign=-1.0) for lame in (_LAMBDA, _MU)]
        load = self._vector()
        load.array[:] = self._parts[0].array + self._parts[1].array
        self._least = _TRUST * smallest_eigenvalue(self._solver, load)

    def __enter__(self) -> "ReducedBasis":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add(self, correction: FloatArray) -> None:
        """Take a solution, less the prescribed displacements, into the basis; owned dofs, collective."""
        vector = self._vector()
        vector.array[:] = correction
        # Made orthogonal to the others: the small systems stay well conditioned.
        for other in self._solutions:
            vector.axpy(-vector.dot(other), other)
        norm = vector.norm()
        if norm <= 1e-10 * float(
            np.linalg.norm(global_sum(self._space.comm, np.array([correction @ correction]))) ** 0.5
        ):
            return
        vector.scale(1 / norm)
        known = len(self._parts)
        self._solutions.append(vector)
        for lame in (_LAMBDA, _MU):
            self._add(vector, lame, sign=1.0)
        new = self._parts[known:]
        products = np.zeros((len(self._solutions), len(self._parts)))
        products[:-1, :known] = self._products
        products[:-1, known:] = np.reshape([part.dot(w) for w in self._solutions[:-1] for part in new], (-1, len(new)))
        products[-1] = [part.dot(vector) for part in self._parts]
        self._products = products

    def evaluate(self, t: float) -> Reduced:
        """Return force, energy and bound for t = λ/μ; no work to speak of.

        With loads b_q = -A_q·held and the solutions' w_i·A_q·w_j from the products of parts and solutions.
        """
        count = len(self._solutions)
        theta = np.array([t, 1.0])
        loads, columns = self._products[:, :2], self._products[:, 2:].reshape(count, count, 2)
        weights = np.linalg.solve(columns @ theta, loads @ theta)
        mixture = np.concatenate([theta, -np.outer(weights, theta).reshape(-1)])
        residual = float(mixture @ self._gram @ mixture)
        twice_energy = float(np.dot(self._held_energy, theta) - weights @ (loads @ theta))
        reactions = np.array(self._reactions)  # for each part, of the unmodified operator
        reaction = reactions.T @ np.concatenate([theta, np.outer(weights, theta).reshape(-1)])
        whole = np.full(3, self._body.multiplicity)
        whole[list(self._space.mirrored)] = 0.0
        reaction, twice_energy = -whole * reaction, self._body.multiplicity * twice_energy
        # Along the travel the energy tells the force: to the square of the error.
        reaction -= (reaction @ self._travel + twice_energy) * self._travel / (self._travel @ self._travel)
        bound = self._body.multiplicity * max(residual, 0.0) / self._least / twice_energy
        return Reduced(reaction, twice_energy, bound, weights)

    def displacement(self, reduced: Reduced) -> PETSc.Vec:
        """Return the displacement of an evaluation; the basis owns it, and the next one takes its place."""
        self._held.copy(self._result)
        for weight, solution in zip(reduced.weights, self._solutions, strict=True):
            self._result.axpy(float(weight), solution)
        return self._result

    def _add(self, vector: PETSc.Vec, lame: tuple[float, float], *, sign: float) -> float:
        """Take sign · A·``vector`` among the parts of the residual; return ``vector``·A·``vector``; collective."""
        space, part, under_p = self._space, self._vector(), self._vector()
        space.set_displacement(vector)
        space.apply(part, lame)
        energy = float(part.dot(vector))
        on_probe = part.array.reshape(-1, 3)[space.probe_owned].sum(axis=0)
        self._reactions.append(global_sum(space.comm, on_probe))
        part.scale(sign)
        part.array[space.prescribed_owned] = 0.0
        self._solver.precondition(part, under_p)
        self._parts.append(part)
        self._under_p.append(under_p)
        row = np.array([other.dot(part) for other in self._under_p])
        grown = np.zeros((len(row), len(row)))
        grown[:-1, :-1] = self._gram
        grown[-1, :], grown[:, -1] = row, row
        self._gram = grown
        return energy

    def _vector(self) -> PETSc.Vec:
        return self._stack.enter_context(self._space.vector())
