"""Images of a quantity, such as a stiffness map: values between voxels, and where there are none."""

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.files.label_map import LabelMap
from epsmesh.shapes.files.labels import files_of, read_values
from epsmesh.shapes.files.read import state_of
from epsmesh.shapes.triangles import SurfaceError

# Rounding of a place at the side of the image, in voxels.
_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class ValueMap:
    """``values`` (nx, ny, nz) of voxels, NaN where there are none, and the ``affine`` (3, 4) to positions (m).

    Between the centres of voxels, values are interpolated linearly. Beside a voxel without a value, a place has the
    value of its own voxel.
    """

    values: FloatArray
    affine: FloatArray
    notices: tuple[str, ...] = ()

    @cached_property
    def spacing(self) -> FloatArray:
        """Sizes (3,) of a voxel (m)."""
        return np.asarray(np.linalg.norm(self.affine[:, :3], axis=0))

    @cached_property
    def mean(self) -> float:
        """The mean over the voxels with a value."""
        return float(np.mean(self.values[np.isfinite(self.values)]))

    @cached_property
    def content(self) -> str:
        """A hash of the values and their places."""
        found = hashlib.sha256(str(self.values.shape).encode())
        for part in (self.values, self.affine):
            found.update(np.ascontiguousarray(part, dtype="<f8").tobytes())
        return found.hexdigest()[:24]

    def indices(self, points: FloatArray) -> FloatArray:
        """Return the places of ``points`` (n, 3), m, in voxels, (n, 3)."""
        return np.asarray(np.linalg.solve(self.affine[:, :3], (points - self.affine[:, 3]).T).T)

    def is_inside(self, indices: FloatArray) -> BoolArray:
        """Return a mask of the places, in voxels, that are in the image."""
        most = np.array(self.values.shape) - 0.5
        return np.asarray(((indices >= -0.5 - _ROUNDING) & (indices <= most + _ROUNDING)).all(axis=1))

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values at ``points`` (n, 3), m; NaN where there is none."""
        found, indices = np.full(len(points), np.nan), self.indices(points)
        inside = np.flatnonzero(self.is_inside(indices))
        most = np.array(self.values.shape) - 1
        at = np.clip(indices[inside], 0, most)
        low = np.minimum(np.floor(at).astype(np.int64), np.maximum(most - 1, 0))
        share = at - low
        total = np.zeros(len(at))
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, share, 1 - share), axis=1)
            total += np.where(weight > 0, self._of(np.minimum(low + corner, most)), 0.0) * weight
        lacks = np.isnan(total)
        total[lacks] = self._of(np.rint(at[lacks]).astype(np.int64))
        found[inside] = total
        return found

    def _of(self, voxels: IntArray) -> FloatArray:
        return np.asarray(self.values[tuple(voxels.T)])

    def coarsened(self) -> "ValueMap":
        """Return the map of voxels twice as wide: the means over two in each direction, of those with a value."""
        sides = [(0, size % 2) for size in self.values.shape]
        values = np.pad(self.values, sides, constant_values=np.nan)
        x, y, z = (size // 2 for size in values.shape)
        blocks = np.moveaxis(values.reshape(x, 2, y, 2, z, 2), (1, 3, 5), (0, 1, 2)).reshape(8, x, y, z)
        known = np.isfinite(blocks)
        with np.errstate(invalid="ignore"):
            means = np.where(known, blocks, 0.0).sum(axis=0) / known.sum(axis=0)
        axes = self.affine[:, :3]
        return ValueMap(means, np.column_stack([2 * axes, self.affine[:, 3] + axes.sum(axis=1) / 2]))

    def filled(self, reach: float) -> "ValueMap":
        """Return the map in which voxels without a value have that of the nearest voxel with one, up to a ``reach``."""
        from scipy import ndimage  # noqa: PLC0415

        lacks = np.isnan(self.values)
        if not reach or not lacks.any():
            return self
        away, nearest = ndimage.distance_transform_edt(lacks, sampling=self.spacing, return_indices=True)
        near = lacks & (away <= reach)
        values = self.values.copy()
        values[near] = self.values[tuple(nearest[:, near])]
        return ValueMap(values, self.affine, self.notices)


def read_value_map(path: Path, length: float | None, factor: float, reach: float) -> ValueMap:
    """Return the image of values in a file, in SI units: voxels times a ``factor``; values that are not positive lack.

    ``length`` (m) is the unit of length if the header names none; for ``reach`` (m) see :meth:`ValueMap.filled`. A file
    is read again only when it has changed.

    Raises:
        SurfaceError: if it is no such image.
    """
    return _read(path, length, factor, reach, tuple(state_of(file) for file in files_of(path)))


@lru_cache(maxsize=8)
def _read(
    path: Path, length: float | None, factor: float, reach: float, _states: tuple[tuple[int, int], ...]
) -> ValueMap:
    found: LabelMap = read_values(path, length)
    values = np.where(np.isfinite(found.values) & (found.values > 0), found.values, np.nan) * factor
    if not np.isfinite(values).any():
        raise SurfaceError("has no value above 0")
    return ValueMap(values, found.affine, found.notices).filled(reach)
