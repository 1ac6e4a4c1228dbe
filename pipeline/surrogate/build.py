"""Building of surrogates: parameters as far as the tolerance asks, then the depth where it matters most."""

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.surrogate.cases import Cases, Domain, Solve
from pipeline.surrogate.depths import SHALLOWEST, Depths
from pipeline.surrogate.derived import IN_SPACE, ON_MERIDIAN
from pipeline.surrogate.nodes import SIZES
from pipeline.surrogate.sparse import Block, Interpolation, interpolate
from pipeline.surrogate.table import Table

# Where nodes of the depth begin in three dimensions: small contact takes the finest meshes, each depth its own.
_IN_SPACE = 0.1
# Most nodes of the depth: as many again, less one, are solved to know their error.
_MOST_DEPTHS = 9
# Share of the tolerance that the depth may take.
_OF_DEPTH = 0.3
# Points, after which a surrogate has the error that it has.
MOST = 300


def build(domain: Domain, solve: Solve, tolerance: float | None = None, most: int = MOST) -> Table:
    """Return the surrogate of a domain to a relative ``tolerance``; that of its meshes if it is None.

    Raises:
        SurrogateError: if a case that it needs has no force.
    """
    tolerance = tolerance or (ON_MERIDIAN if domain.is_on_meridian else IN_SPACE)
    cases = Cases(domain, solve)
    depths = _first(domain)
    place = domain.middle
    while True:
        depths, _ = _finer(cases, depths, place, _OF_DEPTH * tolerance)
        found = _over_parameters(cases, depths, (1 - _OF_DEPTH) * tolerance, most)
        place = _where_depth_matters(found, depths)
        enough, of_depth = _finer(cases, depths, place, _OF_DEPTH * tolerance)
        if enough == depths:
            break
        depths = enough
    error, mesh = found.error + of_depth, max(cases.bars, default=0.0)
    return Table(domain.output, domain.ranges, domain.reference, depths, found.grid, error, mesh, len(cases.bars))


def _first(domain: Domain) -> Depths:
    """Return the nodes of the depth to begin with."""
    if domain.is_proportional or domain.shallowest == domain.deepest:
        return Depths(domain.deepest, domain.exponent, 1)
    least = SHALLOWEST if domain.is_on_meridian else _IN_SPACE
    share = least if domain.shallowest is None else domain.shallowest / domain.deepest
    return Depths(domain.deepest, domain.exponent, 3, share)


def _over_parameters(cases: Cases, depths: Depths, tolerance: float, most: int) -> Interpolation:
    def sample(blocks: Sequence[Block]) -> list[FloatArray]:
        return [cases.logs(block, depths) for block in blocks]

    return interpolate(sample, len(cases.domain.ranges), tolerance, most)


def _finer(cases: Cases, depths: Depths, place: Block, tolerance: float) -> tuple[Depths, float]:
    """Return at least the given nodes of the depth, and as many as are needed at a place, with their error."""
    if depths.count == 1:
        return depths, 0.0
    while True:
        finer = depths.with_count(SIZES[SIZES.index(depths.count) + 1])
        logs = cases.logs(place, finer)[0]
        missed = float(np.abs(depths.basis(finer.values) @ logs[: depths.count] - logs).max())
        if missed <= tolerance or depths.count >= _MOST_DEPTHS:
            return depths, missed
        depths = finer


def _where_depth_matters(found: Interpolation, depths: Depths) -> Block:
    """Return the point, of all that were solved, at which the last nodes of the depth add most."""
    points, logs = found.points, found.grid(found.points)
    if depths.count == 1:
        return tuple(points[:1].T)
    coarser = depths.with_count(SIZES[SIZES.index(depths.count) - 1])
    missed = np.abs(logs[:, : coarser.count] @ coarser.basis(depths.values).T - logs).max(axis=1)
    return tuple(points[[int(missed.argmax())]].T)
