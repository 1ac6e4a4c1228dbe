"""Generalised conjugate residuals (GCR), with stored vectors in single precision.

The method is that of S. C. Eisenstat, H. C. Elman and M. H. Schultz, SIAM J. Numer. Anal. 20, 345, 1983. Each iteration
stores a preconditioned residual z and a direction s of the images A z, 8 bytes per unknown:

    z = P r,    A z = Σ_j β_j s_j + γ s,    |s| = 1,    r ← r − (s·r) s.

The image is that of z as stored. The solution Σ c_k z_k, with R c = (s_k·r) and R made of β and γ, then has the
residual r up to the rounding of the s_k. This rounding is no smooth field, so the energy of its error is far below that
of its norm.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.kernels.cells import summed
from epsmesh.solve.kernels.native import Single, call
from epsmesh.solve.krylov import keep


class Preconditioner(Protocol):
    """A linear map that may differ between iterations."""

    def apply(self, pc: Any, residual: PETSc.Vec, result: PETSc.Vec) -> None: ...  # noqa: D102


class Unknown(Protocol):
    """The solution that is improved. Methods are collective."""

    def residual(self, result: PETSc.Vec, work: PETSc.Vec) -> None:
        """Write the residual into ``result``; ``work`` is overwritten."""

    def add(self, correction: PETSc.Vec) -> None:
        """Add a correction."""


def conjugate_residuals(
    matrix: PETSc.Mat,
    preconditioner: Preconditioner,
    unknown: Unknown,
    has_converged: Callable[[int, float], bool],
    restart: int,
) -> int:
    """Improve ``unknown`` until ``has_converged``, from the iterations and the norm of the residual; collective.

    Return the iterations. After each ``restart`` of them the stored vectors are dropped.

    Raises:
        SolveError: if the preconditioned residual adds nothing to the space.
    """
    with ExitStack() as stack:
        residual, step, image = (keep(stack, matrix.createVecLeft()) for _ in range(3))
        unknown.residual(residual, step)
        space, iterations, norm = _Space(matrix.comm.tompi4py()), 0, residual.norm()
        while not has_converged(iterations, norm):
            if len(space) == restart:
                space.write_solution(step.array)
                unknown.add(step)
                unknown.residual(residual, step)
                space = _Space(matrix.comm.tompi4py())
            preconditioner.apply(None, residual, step)
            space.store(step.array)
            matrix.mult(step, image)
            space.reduce(residual.array, image.array)
            norm, iterations = residual.norm(), iterations + 1
        space.write_solution(step.array)
        unknown.add(step)
    return iterations


class _Space:
    """The preconditioned residuals, the orthonormal directions of their images, and the triangle R."""

    def __init__(self, comm: MPI.Comm):
        self._comm = comm
        self._steps, self._directions = _Stored(), _Stored()
        self._columns: list[FloatArray] = []
        self._shares: list[float] = []

    def __len__(self) -> int:
        return len(self._directions.vectors)

    def store(self, step: FloatArray) -> None:
        """Store a preconditioned residual, scaled to magnitude 1, and write into ``step`` what was stored; collective.

        Raises:
            SolveError: if it is zero or not finite.
        """
        count, stored = len(step), np.empty(len(step), dtype=np.float32)
        scale = summed(self._comm, call("largest", count, step), MPI.MAX)
        if not 0.0 < scale < float("inf"):
            raise SolveError("the linear solver did not converge: its preconditioner broke down")
        call("to_single", count, 1 / scale, step, stored)
        call("to_double", count, 1.0, stored, step)
        self._steps.add(stored)

    def reduce(self, residual: FloatArray, image: FloatArray) -> None:
        """Minimise the norm of ``residual`` along the ``image`` of the last step, which is overwritten; collective.

        Raises:
            SolveError: if the space already contains the image.
        """
        count, size = len(image), len(self)
        stored, products = self._directions.array, np.zeros(size)
        call("project", count, size, stored, image, products)
        products = global_sum(self._comm, products)
        call("combine", count, size, stored, -products, image)
        length = float(np.sqrt(summed(self._comm, float(image @ image))))
        if not 0.0 < length < float("inf"):
            raise SolveError("the linear solver did not converge: its Krylov space is exhausted")
        direction = np.empty(count, dtype=np.float32)
        call("to_single", count, 1 / length, image, direction)
        share = np.zeros(1)
        self._directions.add(direction)
        last = self._directions.array[-1:]
        call("project", count, 1, last, residual, share)
        share = global_sum(self._comm, share)
        call("combine", count, 1, last, -share, residual)
        self._columns.append(np.append(products, length))
        self._shares.append(float(share[0]))

    def write_solution(self, result: FloatArray) -> None:
        """Write into ``result`` the combination of steps that belongs to the reduction of the residual."""
        size = len(self)
        triangle = np.zeros((size, size))
        for number, column in enumerate(self._columns):
            triangle[: number + 1, number] = column
        weights = np.linalg.solve(triangle, np.array(self._shares))
        result[:] = 0.0
        call("combine", len(result), size, self._steps.array, weights, result)


class _Stored:
    """Vectors, and their addresses, for C."""

    def __init__(self) -> None:
        self.vectors: list[Single] = []
        self._addresses: list[int] = []

    def add(self, vector: Single) -> None:
        """Store a vector."""
        self.vectors.append(vector)
        self._addresses.append(vector.ctypes.data)

    @property
    def array(self) -> np.ndarray:
        """The addresses."""
        return np.array(self._addresses, dtype=np.uint64)
