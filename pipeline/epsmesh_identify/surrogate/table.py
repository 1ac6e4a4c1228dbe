"""A surrogate of forces: an interpolation of their logarithm over parameters and depth, with its error."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.surrogate.depths import Depths
from epsmesh_identify.surrogate.derived import Output
from epsmesh_identify.surrogate.moduli import Reference
from epsmesh_identify.surrogate.ranges import Range, trend_of
from epsmesh_identify.surrogate.sparse import SparseGrid

Values = Mapping[str, float] | Mapping[str, FloatArray]
# Samples that are evaluated together: their basis takes tens of megabytes.
_AT_ONCE = 4096


@dataclass(frozen=True)
class Table:
    """The force of a scene, or another output, over ranges of its parameters.

    ``grid`` interpolates ln F (1 - ν²)/(E d^p), with d in units of the largest depth, at the nodes of the depth. Its
    error is ``interpolation``, relative to F; ``mesh`` is the largest of the error bars of its cases, and ``cases``
    their number.
    """

    output: Output
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

    @property
    def acting(self) -> tuple[str, ...]:
        """What the output depends on: not on the modulus that all others are divided by, unless proportional to it."""
        return tuple(name for name in self.names if name != self.reference.name or self._scales)

    @property
    def _scales(self) -> bool:
        """Whether the modulus of reference matters: as a factor, or by what moduli are divided by."""
        return self.output.is_proportional or any(one.is_ratio for one in self.ranges)

    def force(self, depth: FloatArray, values: Mapping[str, float]) -> FloatArray:
        """Return the force (N) at depths (m); 0 above the surface.

        Beyond the largest depth it goes on as a power of the depth; :meth:`error` is infinite there.

        Raises:
            ValueError: if a value is outside the range of its parameter.
        """
        below = np.maximum(depth, 0.0)
        logs = self.logs(self.positions(values), np.minimum(below, self.depths.deepest))[0]
        return np.asarray(self._factor(values) * np.exp(logs) * self.depths.power(below))

    def sampled(self, values: Mapping[str, FloatArray], depth: FloatArray) -> FloatArray:
        """Return the output (n,) at values (n,) of all parameters and depths (n,), in m: one of each for a sample.

        Raises:
            ValueError: if a value is outside the range of its parameter.
        """
        positions, found = self.positions(values), np.empty(len(depth))
        for start in range(0, len(depth), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            nodes = self.grid(positions[part]) + trend_of(self.ranges, positions[part])
            found[part] = np.einsum("ij,ij->i", nodes, self.depths.basis(depth[part]))
        return np.asarray(self._factor(values) * np.exp(found) * self.depths.power(depth))

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

    def positions(self, values: Values) -> FloatArray:
        """Return the positions (n, ranges) in [-1, 1] of values of the parameters, one or n of each.

        Raises:
            ValueError: if one is outside its range.
        """
        found = []
        for one, value in zip(self.ranges, self.reduced(values, values), strict=True):
            if not np.all(one.spans(value)):
                what = f"{one.name} over {self.reference.name}" if one.is_ratio else one.name
                wrong = value[~one.spans(value)][0]
                raise ValueError(f"{what} = {wrong:.6g} is not in its range, {one.low:.6g} to {one.high:.6g}")
            found.append(np.clip(one.position(value), -1, 1))
        return np.stack(found, axis=1) if found else np.zeros((np.size(self._young(values)), 0))

    def reduced(self, values: Values, reference: Values) -> list[FloatArray]:
        """Return values (n,) of the ranges: those of moduli are divided by the modulus of reference, another's."""
        young = self._young(reference)
        return [np.atleast_1d(values[one.name] / (young if one.is_ratio else 1.0)) for one in self.ranges]

    def _young(self, values: Values) -> float | FloatArray:
        """Return the modulus (Pa) that all others are divided by."""
        return self.reference.young if self.reference.is_known else values[self.reference.name]

    def _factor(self, values: Values) -> float | FloatArray:
        """Return what the interpolated output is multiplied by."""
        return self._young(values) if self.output.is_proportional else 1.0
