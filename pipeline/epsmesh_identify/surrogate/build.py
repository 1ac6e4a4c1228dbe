"""Building of surrogates: parameters as far as the tolerance asks, then the depth where it matters most."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.surrogate.cases import Cases, Difference, Domain, Solve
from epsmesh_identify.surrogate.depths import SHALLOWEST, Depths
from epsmesh_identify.surrogate.derived import FORCE, IN_SPACE, ON_MERIDIAN
from epsmesh_identify.surrogate.nodes import SIZES
from epsmesh_identify.surrogate.sparse import Block, Interpolation, SparseGrid, interpolate
from epsmesh_identify.surrogate.table import Table
from epsmesh_identify.surrogate.wide import wide_solve

# Where nodes of the depth begin in three dimensions: small contact takes the finest meshes, each depth its own.
_IN_SPACE = 0.1
# Most nodes of the depth: as many again, less one, are solved to know their error.
_MOST_DEPTHS = 9
# Share of the tolerance that the depth may take.
_OF_DEPTH = 0.3
# Tolerance of tables of so many parameters, or more, besides the modulus that is a factor.
_SEVERAL, _OF_SEVERAL = 2, 5e-3
# Share of the tolerance that a guess may take.
_OF_GUESS = 0.3
# Points, after which a surrogate has the error that it has: of solves, and of the integral equation, 20 ms each.
MOST, MANY = 300, 800


def surrogate(domain: Domain, solve: Solve) -> Table:
    """Return the surrogate of a domain to a relative error that few solves reach.

    On a body so wide that its sides change less than that, the integral equation of layered bodies replaces all but
    three solves. On a less wide one, it is a guess that solves correct.

    Raises:
        SurrogateError: if a case that it needs has no force.
    """
    tolerance = _tolerance(domain)
    found = wide_solve(domain, solve) if domain.output == FORCE else None
    if found is None:
        return build(domain, solve, tolerance)
    equation, differs = found
    if differs <= tolerance:
        return build(domain, equation, min(tolerance, ON_MERIDIAN), MANY)
    return build(domain, solve, tolerance, guess=equation)


def build(domain: Domain, solve: Solve, tolerance: float, most: int = MOST, guess: Solve | None = None) -> Table:
    """Return the surrogate of a domain to a relative ``tolerance``.

    With a ``guess`` of the forces, which costs nothing, what is solved is interpolated relative to that.

    Raises:
        SurrogateError: if a case that it needs has no force.
    """
    cases = Cases(domain, solve)
    if guess is None:
        found = over_all(cases, tolerance, most)
    else:
        guessed = Cases(domain, guess)
        found = over_all(guessed, _OF_GUESS * tolerance, MANY)
        found = found.plus(over_all(Difference(cases, guessed), (1 - _OF_GUESS) * tolerance, most))
    mesh = max(cases.bars, default=0.0)
    own = domain.output, domain.ranges, domain.reference
    return Table(*own, found.depths, found.grid, found.error, mesh, len(cases.bars))


def _tolerance(domain: Domain) -> float:
    """Return what solves are asked for: tables of several parameters take minutes, and forces are measured to 1 %."""
    if not domain.is_on_meridian:
        return IN_SPACE
    return ON_MERIDIAN if len(domain.ranges) < _SEVERAL else _OF_SEVERAL


def is_corrected(domain: Domain) -> bool:
    """Return whether tables of a domain are made to more than :data:`ON_MERIDIAN`, and so corrected near a fit."""
    return domain.is_on_meridian and _tolerance(domain) > ON_MERIDIAN


@dataclass(frozen=True)
class Interpolated:
    """An interpolation over parameters, at nodes of the depth, with its error."""

    depths: Depths
    grid: SparseGrid
    error: float

    def plus(self, other: "Interpolated") -> "Interpolated":
        """Return the sum of two interpolations, at the nodes of the one that has more."""
        finest = max(self.depths, other.depths, key=lambda depths: depths.count)
        grids = [one.grid.at_nodes(one.depths.basis(finest.values)) for one in (self, other)]
        return Interpolated(finest, grids[0].plus(grids[1]), self.error + other.error)


def over_all(cases: Cases | Difference, tolerance: float, most: int) -> Interpolated:
    """Return the interpolation over parameters and depth to a tolerance."""
    depths, place = first_depths(cases.domain), cases.domain.middle
    while True:
        depths, _ = _finer(cases, depths, place, _OF_DEPTH * tolerance)
        found = _over_parameters(cases, depths, (1 - _OF_DEPTH) * tolerance, most)
        place = _where_depth_matters(found, depths)
        enough, of_depth = _finer(cases, depths, place, _OF_DEPTH * tolerance)
        if enough == depths:
            return Interpolated(depths, found.grid, found.error + of_depth)
        depths = enough


def first_depths(domain: Domain) -> Depths:
    """Return the nodes of the depth to begin with."""
    if domain.is_proportional or domain.shallowest == domain.deepest:
        return Depths(domain.deepest, domain.exponent, 1)
    least = SHALLOWEST if domain.is_on_meridian else _IN_SPACE
    share = least if domain.shallowest is None else domain.shallowest / domain.deepest
    return Depths(domain.deepest, domain.exponent, 3, share)


def _over_parameters(cases: Cases | Difference, depths: Depths, tolerance: float, most: int) -> Interpolation:
    def sample(blocks: Sequence[Block]) -> list[FloatArray]:
        return [cases.logs(block, depths) for block in blocks]

    return interpolate(sample, len(cases.domain.ranges), tolerance, most)


def _finer(cases: Cases | Difference, depths: Depths, place: Block, tolerance: float) -> tuple[Depths, float]:
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
