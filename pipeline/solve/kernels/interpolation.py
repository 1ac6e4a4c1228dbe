"""Interpolation between the spaces of two degrees, and back, in single precision."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Int32Array
from pipeline.solve.kernels.native import Single, call
from pipeline.solve.parcels import Shared, ghosts_of
from pipeline.solve.transfer import Side, free, point_weights


@dataclass(frozen=True)
class Interpolation:
    """From the points of a coarse space to those of a fine one: sparse rows with the same weight for all components.

    ``coarse_free`` and ``fine_free`` are 0 for numbers that are prescribed, else 1. Rows are of the points that this
    rank owns; those of the coarse space that others own are ``shared``, None on one process. Both maps are collective.
    """

    offsets: Int32Array
    points: Int32Array
    weights: Single
    coarse_free: Single
    fine_free: Single
    shared: Shared | None = None

    def prolong(self, coarse: Single, fine: Single) -> None:
        """Add the interpolation of ``coarse`` to ``fine``."""
        if self.shared is not None:
            coarse = self.shared.extend(coarse)
        call("prolong", len(self.offsets) - 1, self.offsets, self.points, self.weights, self.coarse_free,
                  self.fine_free, coarse, fine)  # fmt: skip

    def restrict(self, fine: Single, coarse: Single) -> None:
        """Write the transposed interpolation of ``fine`` into ``coarse``."""
        found = coarse if self.shared is None else np.empty(len(self.coarse_free), dtype=np.float32)
        call("restrict_to", len(self.offsets) - 1, self.offsets, self.points, self.weights, len(found),
                  self.coarse_free, self.fine_free, fine, found)  # fmt: skip
        if self.shared is not None:
            coarse[:] = 0.0
            self.shared.fold(found, coarse)


def interpolation(coarse: Side, fine: Side) -> Interpolation:
    """Return the interpolation between two spaces; collective."""
    offsets, points, weights = point_weights(coarse.space, fine.space)
    return Interpolation(
        offsets.astype(np.int32), points, weights.astype(np.float32), *masks(coarse, fine), ghosts_of(coarse.space)
    )


def masks(coarse: Side, fine: Side) -> tuple[Single, Single]:
    """Return 0 for each number of the two spaces that is prescribed, else 1."""
    return free(coarse).astype(np.float32), free(fine).astype(np.float32)
