"""Corrections of a surrogate near a point: over smaller ranges, the same function to a smaller error.

A surrogate over wide ranges is a guess of the forces. What is left of them near a point is small and smooth, so that a
few cases correct it. Smaller ranges are nested, so that points that are near each other have the same cases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.surrogate.build import MANY, MOST, Interpolated, over_all
from epsmesh_identify.surrogate.cases import Cases, Difference, Domain, Solve
from epsmesh_identify.surrogate.depths import Depths
from epsmesh_identify.surrogate.derived import FORCE, ON_MERIDIAN
from epsmesh_identify.surrogate.ranges import Range, trend_of
from epsmesh_identify.surrogate.sparse import Block, points_of
from epsmesh_identify.surrogate.table import Table, Values
from epsmesh_identify.surrogate.wide import wide_solve

# The smallest of the nested ranges, as a share of the whole one; a bar covers at most half of a range.
_SMALLEST, _COVERED = 1 / 16, 0.5
# Places of nested ranges are this share of their size apart.
_APART = 0.25


@dataclass(frozen=True)
class Correction:
    """The factor of a table's force over ``ranges`` within its own; beyond them it is that of their nearest end.

    ``interpolation`` is the relative error of the corrected force in these ranges, ``mesh`` the largest error bar of
    its cases.
    """

    ranges: tuple[Range, ...]
    found: Interpolated
    mesh: float
    cases: int

    @property
    def interpolation(self) -> float:
        """Relative error of the interpolation."""
        return self.found.error

    def factor(self, depth: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """Return the factor (depths,) at depths (m) and values (1,) of the ranges, ratios among them."""
        positions = np.array([np.clip(one.position(x), -1, 1) for one, x in zip(self.ranges, values, strict=True)])
        below = np.clip(depth, 0.0, self.found.depths.deepest)
        return np.asarray(np.exp(self.found.grid(positions.T) @ self.found.depths.basis(below).T)[0])

    def spans(self, values: Sequence[FloatArray]) -> bool:
        """Return whether values (1,) are within the ranges."""
        return all(bool(np.all(one.spans(x))) for one, x in zip(self.ranges, values, strict=True))


@dataclass(frozen=True)
class _Tabled:
    """Values of a table in the place of solved ones, see :class:`Cases`."""

    table: Table
    ranges: tuple[Range, ...]

    def logs(self, block: Block, depths: Depths) -> FloatArray:
        """Return ln F (1 - ν²)/(E d^p) at the points of a block of the smaller ranges (points, depths)."""
        rows = zip(self.table.ranges, self.ranges, points_of(block).T, strict=True)
        positions = np.stack([np.clip(whole.position(own.value(x)), -1, 1) for whole, own, x in rows], axis=1)
        return self.table.logs(positions, depths.values) - trend_of(self.ranges, points_of(block))


def smaller(table: Table, low: Values, high: Values) -> tuple[Range, ...]:
    """Return nested ranges about bars from ``low`` to ``high`` of all parameters (SI units)."""
    ends = zip(table.ranges, table.reduced(low, high), table.reduced(high, low), strict=True)
    return tuple(_smaller(one, float(least[0]), float(most[0])) for one, least, most in ends)


def _smaller(one: Range, low: float, high: float) -> Range:
    """Return the smallest nested range of which a bar covers at most a half, or the whole range."""
    ends = np.clip(one.position(np.clip([low, high], one.low, one.high)), -1, 1)
    middle, span, size = float(ends.mean()), float(np.ptp(ends)), 2.0
    while size / 2 >= 2 * _SMALLEST and span <= _COVERED * size / 2:
        size /= 2
    step = _APART * size
    start = -1 + step * np.clip(np.round((middle - size / 2 + 1) / step), 0, (2 - size) / step)
    least, most = one.value(np.array([start, start + size]))
    return replace(one, low=max(float(least), one.low), high=min(float(most), one.high))


def needs_correction(domain: Domain, table: Table) -> bool:
    """Return whether the error of a table of a domain is larger than that of a correction."""
    return domain.is_on_meridian and table.interpolation + table.mesh > ON_MERIDIAN


def correction(domain: Domain, solve: Solve, table: Table, ranges: tuple[Range, ...]) -> Correction:
    """Return what corrects a ``table`` of a domain over smaller ranges.

    Raises:
        SurrogateError: if a case that it needs has no force.
    """
    near = replace(domain, ranges=ranges)
    equation = wide_solve(near, solve) if domain.output == FORCE else None
    is_wide = equation is not None and equation[1] <= ON_MERIDIAN
    cases = Cases(near, equation[0] if equation and is_wide else solve)
    found = over_all(Difference(cases, _Tabled(table, ranges)), ON_MERIDIAN, MANY if is_wide else MOST)
    return Correction(ranges, found, max(cases.bars, default=0.0), len(cases.bars))
