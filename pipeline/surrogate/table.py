"""A surrogate of forces: an interpolation of their logarithm over parameters and depth, with its error."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.surrogate.depths import Depths
from pipeline.surrogate.moduli import Reference
from pipeline.surrogate.ranges import Range, trend_of
from pipeline.surrogate.sparse import SparseGrid


@dataclass(frozen=True)
class Table:
    """The force of a scene over ranges of its parameters.

    ``grid`` interpolates ln F (1 - ν²)/(E d^p), with d in units of the largest depth, at the nodes of the depth. Its
    error is ``interpolation``, relative to F; ``mesh`` is the largest of the error bars of its cases, and ``cases``
    their number.
    """

    ranges: tuple[Range, ...]
    reference: Reference
    depths: Depths
    grid: SparseGrid
    interpolation: float
    mesh: float
    cases: int

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        factor = () if self.reference.is_known else (self.reference.name,)
        return (*factor, *(one.name for one in self.ranges))

    def force(self, depth: FloatArray, values: Mapping[str, float]) -> FloatArray:
        """Return the force (N) at depths (m); 0 above the surface.

        Beyond the largest depth it goes on as a power of the depth; :meth:`error` is infinite there.

        Raises:
            ValueError: if a value is outside the range of its parameter.
        """
        below = np.maximum(depth, 0.0)
        logs = self.logs(self.positions(values), np.minimum(below, self.depths.deepest))[0]
        return np.asarray(self.young(values) * np.exp(logs) * self.depths.power(below))

    def error(self, depth: FloatArray, values: Mapping[str, float]) -> FloatArray:
        """Return the relative error of the force, of meshes and interpolation; infinite beyond the largest depth.

        Below the smallest node of the depth it includes what a power of the depth leaves out.
        """
        shallowest = np.sqrt(self.depths.shallowest)
        roots = shallowest * np.array([1.0, 1.2])
        first, second = self.logs(self.positions(values), self.depths.deepest * roots**2)[0]
        slope = abs(second - first) / (roots[1] - roots[0])
        missing = np.maximum(shallowest - np.sqrt(np.maximum(depth, 0.0) / self.depths.deepest), 0.0)
        found = self.interpolation + self.mesh + slope * missing
        return np.where(depth > (1 + 1e-9) * self.depths.deepest, np.inf, found)

    def logs(self, positions: FloatArray, depth: FloatArray) -> FloatArray:
        """Return ln F/(E d^p) (n, depths) at positions (n, ranges) in [-1, 1] and depths (m)."""
        found = self.grid(positions) + trend_of(self.ranges, positions)
        return np.asarray(found @ self.depths.basis(depth).T)

    def young(self, values: Mapping[str, float]) -> float:
        """Return the modulus (Pa) that the force is proportional to."""
        return self.reference.young if self.reference.is_known else values[self.reference.name]

    def positions(self, values: Mapping[str, float]) -> FloatArray:
        """Return the position (1, ranges) in [-1, 1] of values of the parameters.

        Raises:
            ValueError: if one is outside its range.
        """
        young, found = self.young(values), np.zeros((1, len(self.ranges)))
        for number, one in enumerate(self.ranges):
            value = values[one.name] / (young if one.is_ratio else 1.0)
            if not one.spans(value):
                what = f"{one.name} over {self.reference.name}" if one.is_ratio else one.name
                raise ValueError(f"{what} = {value:.6g} is not in its range, {one.low:.6g} to {one.high:.6g}")
            found[0, number] = np.clip(one.position(value), -1, 1)
        return found
