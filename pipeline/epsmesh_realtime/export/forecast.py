"""What an export costs, before anything is solved: for `epsmesh plan`, and for the export itself."""

from dataclasses import dataclass, field, replace
from math import exp, log

import numpy as np

from epsmesh.plan import estimate
from epsmesh.plan.cost import CostModel
from epsmesh.printable import counted
from epsmesh.run.remaining import format_seconds
from epsmesh.shapes.body import Layered
from epsmesh.study.problems import StudyError
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.export.kept import NONE, Kept
from epsmesh_realtime.export.region import MARGIN, Region, coarse_case, curved_region, surface_case
from epsmesh_realtime.export.scope import Scope
from epsmesh_realtime.export.setting import Setting, place_of
from epsmesh_realtime.export.tabulate import counts, ratios_of

# Largest contact, in units of the distance to the nearest side or the bottom; number of full solves; accuracy.
LARGEST, CHECKS, ACCURACY = 0.4, 24, 0.01
# Error of the full solves of a flat and of a curved body, as a share of the accuracy.
_PRECISE, _PRECISE_CURVED = 0.05, 0.5
# Half sizes of the checks' tools, in units of the largest allowed one at the place.
SIZES = (0.1, 0.99)
# Discs of a curved body's table: radii, in units of the study's, the larger one close to the model's largest contact;
# accuracy, as a share of the solver's: c depends most on the smaller disc. Intervals of the table; depth over radius.
RADII, FINER, LARGER, SIZES_CURVED, DEPTH = (0.6, 1.5), 2 / 3, 1.03, (2, 4), 0.02
# Half size of the region of a body without axes, in units of the disc's radius: the largest one with a face.
REACHES = (3.0, 2.25, 1.5)
# A law's half-spaces: number of ν; radius of the ball (m); radius and depth (m) of the linear disc that measures the
# cylinder's compliance; size of the cylinder, and depths, in radii of the ball, of which the last may have no
# equilibrium; accuracy of the solves.
RATIOS, BALL, DISC, SHALLOW, _SIZE, _ACCURACY_OF_LAW = 4, 1e-3, 4e-3, 1e-5, 100.0, 1e-3
DEPTHS = (0.05, 0.15, 0.3, 0.5, 0.75, 1.0)
# A typical check: its place in units of the reach, length over width of a blade, depth of a ball in its radii.
_PLACE, _SLENDER, _DEEP = (0.45, 0.3), 3.5, 0.5
# Seconds of Green's functions with 10,000 tetrahedra, and the exponent of their number: a factorisation, a force.
# Seconds of the tables of the deforming surface.
_FACTOR, _FORCE, _SURFACE = (2.1, 1.5), (0.022, 0.8), 4.5
# Forces at a place of a flat body's table; places along a direction of the surface's tables, less by symmetry.
_FORCES, _PLACES = 3, 13


@dataclass(frozen=True)
class Forecast:
    """The least and the largest number of solves of an export, and their seconds on one rank.

    ``warning`` says that its model refuses the study's own tool everywhere; "" if it does not.
    """

    least: int = 0
    most: int = 0
    least_seconds: float = 0.0
    most_seconds: float = 0.0
    warning: str = ""

    def and_also(self, least: int, most: int, least_seconds: float, most_seconds: float) -> "Forecast":
        """Return the forecast with further work."""
        return replace(
            self,
            least=self.least + least,
            most=self.most + most,
            least_seconds=self.least_seconds + least_seconds,
            most_seconds=self.most_seconds + most_seconds,
        )

    def text(self, ranks: int = 1) -> str:
        """Write it in words, with times on several ranks."""
        if not self.most:
            return "solves whose number is not known before"
        times = (format_seconds(seconds / ranks) for seconds in (self.least_seconds, self.most_seconds))
        least = f"{self.least} to " if self.least < self.most else ""
        return f"about {least}{counted(self.most, 'solve')}, {' to '.join(dict.fromkeys(times))}"


@dataclass(frozen=True)
class Export:
    """A model to make of ``scope``: to a relative ``accuracy``, with a number of ``checks``.

    ``margin`` is that beside the sides, and ``largest`` the largest contact: see :mod:`epsmesh_realtime.export.export`.
    """

    scope: Scope
    accuracy: float = ACCURACY
    checks: int = CHECKS
    margin: float = MARGIN
    largest: float = LARGEST
    kept: Kept = field(default=NONE, repr=False)
    cost: CostModel = field(default_factory=CostModel, repr=False)

    @property
    def solver(self) -> Solver:
        """The full solves of the checks."""
        scope = self.scope
        precise = (_PRECISE if scope.is_flat else _PRECISE_CURVED) * self.accuracy
        return Solver(scope.sections, scope.file, scope.young, precise, kept=self.kept, cost=self.cost)

    @property
    def solver_of_law(self) -> Solver:
        """Those of the balls at large displacements."""
        return replace(self.solver, accuracy=self.accuracy, law=self.scope.law)

    @property
    def solver_of_table(self) -> Solver:
        """Those of the table of a curved body."""
        return replace(self.solver, accuracy=self.accuracy)

    @property
    def room(self) -> float:
        """The distance (m) to the boundary of a curved body."""
        return LARGER * RADII[1] * self.scope.case.probe.circumradius / self.largest

    @property
    def region(self) -> Region:
        """The region of the model; of a curved body, the largest one that is tried."""
        body, radius = self.scope.body, self.scope.case.probe.circumradius
        if isinstance(body, Layered):
            return Region.of(body, self.margin)
        return curved_region(self.scope, self.room, REACHES[0] * radius)

    def forecast(self) -> Forecast:
        """Return about what it costs; nothing if a typical touch cannot be planned, as where a face ends."""
        try:
            return self._forecast()
        except StudyError:
            return Forecast()

    def _forecast(self) -> Forecast:
        region, scope = self.region, self.scope
        ratios = len(ratios_of(scope.poissons))
        if scope.is_flat:
            cells = estimate.cells(coarse_case(scope.case, region))
            found = self._flat_table(region, cells, ratios)
        else:
            cells = estimate.cells(surface_case(scope.case, region))
            found = self._curved_table(region)
        found = found.and_also(*2 * (self.checks,), *2 * (self._check_seconds(region),))
        if scope.law:
            solves, seconds = self._of_law(region)
            return found.and_also(solves, solves, seconds, seconds)
        places = _places(region)
        seconds = ratios * _green(cells, places) + _SURFACE
        return found.and_also(places * ratios, places * ratios, seconds, seconds)

    def _flat_table(self, region: Region, cells: float, ratios: int) -> Forecast:
        least, most = (ratios * count for count in counts(region))
        first, last = (ratios * _green(cells, _FORCES * count // ratios) for count in (least, most))
        again = ratios * _green(cells, 0)  # a table with more nodes needs another factorisation
        return Forecast(least, most, first, last + again, too_large(self.scope, self.largest * region.room(0.0, 0.0)))

    def _curved_table(self, region: Region) -> Forecast:
        least, most = counts(region, SIZES_CURVED, sparse=not region.is_round)
        scope, ratios = self.scope, ratios_of(self.scope.poissons).tolist()
        solves, seconds = 0, 0.0
        for share, tool in discs_at(scope.case.probe.circumradius):
            some = replace(self.solver_of_table, accuracy=share * self.accuracy)
            count, time = some.cost_of(tool, self._at(region), [DEPTH * tool.radius], ratios if ratios[1:] else None)
            solves, seconds = solves + count, seconds + time
        return Forecast(solves * least, solves * most, seconds * least, seconds * most)

    def _at(self, region: Region) -> tuple[float, ...]:
        """Return a typical place."""
        x, y = _PLACE[0] * region.reach[0], _PLACE[1] * region.reach[1]
        if self.scope.is_flat:
            return x, y
        setting = Setting.of(self.scope.case)
        return place_of(setting.axes, setting.origin + np.array([x, y, 0.0]) @ setting.axes)

    def _size(self, region: Region) -> float:
        """Return the half size (m) of a typical tool."""
        room = region.room(_PLACE[0] * region.reach[0], _PLACE[1] * region.reach[1])
        return self.largest * room * exp(sum(map(log, SIZES)) / len(SIZES))

    def _check_seconds(self, region: Region) -> float:
        size, scope = self._size(region), self.scope
        width = 2 * size / (1 + _SLENDER**2) ** 0.5
        x, y, z = (1.0, 0.0, 0.0) if scope.is_flat else Setting.of(scope.case).axes[0].tolist()
        tools = [Tool("disc", size), Tool("blade", length=_SLENDER * width, width=width, along=(x, y, z))]
        tools += [Tool("disc", size, contact="bonded")]
        several = scope.poissons[0] < scope.poissons[1]
        seconds = [
            self.solver.cost_of(tool, self._at(region), [DEPTH * size], [scope.poisson] if several else None)[1]
            for tool in (tools[:1] if scope.law else tools)
        ]
        # Of a law, discs only calibrate its linear part.
        return (self.checks / 2 if scope.law else self.checks) * sum(seconds) / len(seconds)

    def _of_law(self, region: Region) -> tuple[int, float]:
        """Return the solves of half-spaces and of balls beside those of discs, and all their seconds."""
        ratios = ratios_of(self.scope.poissons, RATIOS).tolist()
        radius = self._size(region) / _DEEP**0.5
        depths = [share * BALL for share in DEPTHS]
        spaces, seconds = half_space(self.solver_of_law).cost_of(
            Tool("sphere", BALL, contact="unilateral"), (0.0, 0.0), depths, ratios
        )
        ball = Tool("sphere", radius, contact="unilateral")
        _, one = self.solver_of_law.cost_of(ball, self._at(region), [_DEEP * radius], [self.scope.poisson])
        return spaces + len(ratios) + self.checks // 2, seconds + self.checks * one


def discs_at(radius: float) -> list[tuple[float, Tool]]:
    """Return the discs of a place by the study's ``radius``, each with its accuracy as a share of the solver's."""
    bonded = Tool("disc", radius, contact="bonded", motion="all")
    return [
        *((share, Tool("disc", size * radius)) for size, share in zip(RADII, (FINER, 1.0), strict=True)),
        (1.0, bonded),
    ]


def half_space(solver: Solver) -> Solver:
    """Return the solver for a ball on a large cylinder of the same material."""
    size = f"{1e3 * _SIZE * BALL:g} mm"
    body = {"shape": "cylinder", "radius": size, "height": size, "fixed": "bottom"}
    return replace(solver, sections={"body": body}, accuracy=_ACCURACY_OF_LAW)


def too_large(scope: Scope, most: float) -> str:
    """Return why a model with contact radii up to ``most`` (m) refuses the study's own tool everywhere, "" if not."""
    size = scope.case.expected.circumradius
    if size <= most:
        return ""
    return (
        f"the model will refuse the study's own tool: its contact radius is {1e3 * size:.3g} mm, and a model of this "
        f"body answers up to {1e3 * most:.3g} mm: give a wider and thicker body, or a smaller tool"
    )


def _green(cells: float, forces: int) -> float:
    """Return the seconds of Green's functions on a mesh."""
    (factor, power), (one, each) = _FACTOR, _FORCE
    return factor * (cells / 1e4) ** power + forces * one * (cells / 1e4) ** each


def _places(region: Region) -> int:
    """Return about the number of places of the deforming surface's tables."""
    half = _PLACES // 2 + 1
    if region.is_axial:
        return half
    first, second = (half if even else _PLACES for even in region.even)
    return first * second // (2 if region.is_square else 1)
