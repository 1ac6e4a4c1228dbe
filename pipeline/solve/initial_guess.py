"""What one solve leaves to the next on the same mesh: solutions to begin with."""

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.krylov import LinearSolver
from pipeline.solve.loads import Motion
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.vectors import global_sum

# So many solutions are kept, and no more than fit into so many bytes of a process.
_MOST, _BYTES = 24, 100_000_000
# What is left of a solution beside the earlier ones is dropped below this share of its energy.
_SAME = 1e-12


class Earlier:
    """Solutions of one operator K, whose best sum, in the energy norm, begins the next solve; owned dofs.

    They are orthonormal in energy, by K's products with what was found: the loads that were solved for differ from
    these by the solver's error, which neighbours are hardly farther apart than.
    """

    def __init__(self, comm: MPI.Comm, owned: int, law: MaterialLaw):
        """Keep none, of ``owned`` dofs on this rank, and of the K of a ``law``; collective."""
        self.law = law
        # Of motions that come again as they are.
        self.known: dict[Motion, FloatArray] = {}
        self._comm = comm
        self._most = max(2, min(_MOST, _BYTES // (16 * max(1, comm.allreduce(owned, op=MPI.MAX)))))
        self._products: list[FloatArray] = []
        self._solutions: list[FloatArray] = []

    def guess(self, load: FloatArray) -> FloatArray:
        """Return the sum of earlier solutions that is nearest to that for a ``load``, nought if there are none."""
        amounts = self._amounts(load)
        return sum((c * x for c, x in zip(amounts, self._solutions, strict=True)), np.zeros_like(load))

    def add(self, product: FloatArray, solution: FloatArray) -> None:
        """Keep a ``solution`` and K's ``product`` with it; of many, the one before goes, which added least."""
        whole = self._dot(solution, product)
        product, solution = product.copy(), solution.copy()
        for c, b, x in zip(self._amounts(product), self._products, self._solutions, strict=True):
            product -= c * b
            solution -= c * x
        energy = self._dot(solution, product)
        if not energy > _SAME * whole > 0:
            return
        self._products.append(product / energy**0.5)
        self._solutions.append(solution / energy**0.5)
        if len(self._products) > self._most:
            del self._products[-2], self._solutions[-2]

    def remember(
        self, motions: Sequence[Motion], solver: LinearSolver, products: list[PETSc.Vec], solutions: list[PETSc.Vec]
    ) -> None:
        """Keep ``solutions`` for other places, of which the tool's own motion, the first, is one; collective.

        ``products`` are overwritten.
        """
        for motion, product, solution in zip(motions, products, solutions, strict=True):
            if motion not in self.known:
                solver.multiply(solution, product)
                self.add(product.array, solution.array)
        self.known = {motions[0]: solutions[0].array.copy()}

    def _amounts(self, load: FloatArray) -> FloatArray:
        return global_sum(self._comm, np.array([x @ load for x in self._solutions]))

    def _dot(self, first: FloatArray, second: FloatArray) -> float:
        return float(global_sum(self._comm, np.array([first @ second]))[0])
