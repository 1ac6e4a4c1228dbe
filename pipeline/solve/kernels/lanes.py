"""Cells side by side, one in each lane of the vectors that ``product.c`` and ``curved.c`` calculate with."""

import numpy as np

from pipeline.arrays import FloatArray, Int32Array
from pipeline.solve.physics import MaterialLaw

# Cells that are taken side by side, as product.c has it.
LANES = 16


class Lanes:
    """Some cells of a rank, ``LANES`` at a time; what fills up the last batch is nought.

    ``which`` numbers the cells, ``dofs`` (batches, points, lanes) has their points: fillers have the first.
    """

    def __init__(self, which: Int32Array, dofs: Int32Array):
        """``dofs`` (cells, points) are those of all cells of the rank."""
        self.which, self.batches = which, -(-len(which) // LANES)
        self.dofs = self.spread(dofs[which])

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return ``values`` (cells, n) of these cells as (batches, n, lanes)."""
        filled = np.zeros((self.batches * LANES, values.shape[1]), dtype=values.dtype)
        filled[: len(values)] = values
        return np.ascontiguousarray(filled.reshape(self.batches, LANES, -1).transpose(0, 2, 1))

    def lame(self, law: MaterialLaw, regions: Int32Array | None) -> FloatArray:
        """Return λ and μ (Pa), shape (batches, 2, lanes); ``regions`` number what all cells of the rank are made of."""
        # A law of one material holds for every region.
        region = np.zeros(len(self.which), dtype=np.int32)
        if regions is not None and len(law.lame_mu) > 1:
            region = regions[self.which]
        return self.spread(np.array([law.lame_lambda, law.lame_mu], dtype=np.float64).T[region])
