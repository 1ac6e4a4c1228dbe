"""How far the force of a displacement element is from the truth: solve on in the space of one degree more.

For conforming displacement elements F_p·d - F·d is the energy of the error: F_p is too high, never too low. The part of
it that degree p + 1 can see,

    s = F_p - F_{p+1},    s·d = a(u_p - u_{p+1}, u_p - u_{p+1}),

is summed by conjugate gradients that start from u_p: each iteration adds α (r, z) to the energy found, so that a few
of them give s to a few per cent, always from below.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.linear import LinearSolver, SolveError
from pipeline.solve.vectors import global_sum

# Iterations end when one adds less than this share of the sum; the first few may be short by chance.
_SMALL = 0.02
_FEWEST, _MOST = 3, 60
# What is below zero by less than this share of the sum is nought.
_ROUNDING = 1e-6


def energy_decrements(
    solver: LinearSolver, residuals: Sequence[PETSc.Vec], *, keep: bool = False
) -> tuple[FloatArray, list[FloatArray], int]:
    """Return r_i·A⁻¹·r_j (J) of n ``residuals``, (n, n), each A⁻¹·r_i (owned dofs), and the iterations; collective.

    On the diagonal it is from below; the error of any entry is at most the root of the two on the diagonal. The
    residuals are overwritten. A single solution is empty unless it is to be kept.

    Raises:
        SolveError: if the increments do not get small.
    """
    first = [np.array(residual.array) for residual in residuals]
    corrections, totals, iterations = [], [], 0
    for residual in residuals:
        total, correction, count = _correct(solver, residual, keep=keep or len(residuals) > 1)
        totals.append(total)
        corrections.append(correction)
        iterations += count
    if len(totals) == 1:
        return np.array([totals]), corrections, iterations
    # With x_i for A⁻¹ r_i and ρ_i for what is left of r_i: x_i·r_j + x_j·r_i - x_i·A·x_j, and A x_j = r_j - ρ_j.
    left = [np.array(residual.array) for residual in residuals]
    local = np.array([[x @ rho + y @ r for y, rho in zip(corrections, left, strict=True)]
                      for x, r in zip(corrections, first, strict=True)])  # fmt: skip
    found = global_sum(residuals[0].comm.tompi4py(), local)
    found = (found + found.T) / 2
    np.fill_diagonal(found, totals)
    return found, corrections, iterations


def _correct(solver: LinearSolver, residual: PETSc.Vec, *, keep: bool) -> tuple[float, FloatArray, int]:
    """Return ``residual``·A⁻¹·``residual``, the solution if it is to be kept (owned dofs), and the iterations."""
    total, previous = 0.0, 0.0
    solution = np.zeros(residual.getLocalSize() if keep else 0)
    with ExitStack() as stack:
        direction, preconditioned, product = (stack.enter_context(_like(residual)) for _ in range(3))
        for iteration in range(1, _MOST + 1):
            solver.precondition(residual, preconditioned)
            rz = residual.dot(preconditioned)
            if rz < -_ROUNDING * total:
                if not solver.look_closer():
                    raise SolveError("the error estimate has no positive preconditioner")
                previous = 0.0  # begin again, from what is left
                continue
            if rz <= 0.0:  # nothing is left to gain
                return total, solution, iteration
            direction.aypx(rz / previous if previous else 0.0, preconditioned)
            solver.multiply(direction, product)
            step = rz / direction.dot(product)
            residual.axpy(-step, product)
            if keep:
                solution += step * direction.array
            total, previous = total + step * rz, rz
            if iteration >= _FEWEST and step * rz <= _SMALL * total:
                return total, solution, iteration
    raise SolveError(f"the error estimate did not settle in {_MOST} iterations")


def smallest_eigenvalue(solver: LinearSolver, start: PETSc.Vec, steps: int = 30) -> float:
    """Return the smallest eigenvalue of preconditioner times operator, from above, by Lanczos' method; collective.

    The coefficients are those of conjugate gradients for the right-hand side ``start``, which is overwritten.
    """
    diagonal, beside = [], []
    with ExitStack() as stack:
        direction, preconditioned, product = (stack.enter_context(_like(start)) for _ in range(3))
        previous = step = first = 0.0
        for _ in range(steps):
            solver.precondition(start, preconditioned)
            rz = start.dot(preconditioned)
            first = first or rz
            if rz <= 1e-24 * first:
                break
            ratio = rz / previous if previous else 0.0
            direction.aypx(ratio, preconditioned)
            solver.multiply(direction, product)
            before, step = step, rz / direction.dot(product)
            diagonal.append(1 / step + (ratio / before if before else 0.0))
            beside.append(ratio**0.5 / before if before else 0.0)
            start.axpy(-step, product)
            previous = rz
    lanczos = np.diag(diagonal) + np.diag(beside[1:], 1) + np.diag(beside[1:], -1)
    return float(np.linalg.eigvalsh(lanczos)[0])


@contextmanager
def _like(vector: PETSc.Vec) -> Iterator[PETSc.Vec]:
    copy = vector.duplicate()
    copy.set(0.0)
    try:
        yield copy
    finally:
        copy.destroy()
