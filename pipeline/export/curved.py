"""Models of bodies that are not flat: c and h at each place are what full solves of two discs tell."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.export.full import Solver, Tool
from pipeline.export.region import Region
from pipeline.export.scope import ExportError, Scope
from pipeline.export.tabulate import Places, ratios_of, tabulate
from pipeline.realtime.face import Face
from pipeline.realtime.model import Model
from pipeline.realtime.table import Table
from pipeline.shapes.frame import PlaceError

# Radii of the two discs, in units of the study's; the larger one is nearly the largest that the model answers for.
RADII, _LARGER = (0.6, 1.5), 1.03
# Half the region of a body without axes of its own, in units of the disc's radius, and of an ellipsoid's semi-axes.
_REACH, _OF_AXES = 3.0, 0.4
# Intervals of the tables; of the depths; steps for h, whose square counts little.
_SIZES, _DEPTH, _STEPS = (2, 4), 0.02, 50
# The smaller disc tells most of c, and is asked for so much of the larger one's accuracy.
_FINER = 2 / 3
# The table may miss c at the new nodes by this share of the asked accuracy.
_SHARE = 0.5
# The face: points along each direction, and polynomials fitted to them; a facetted one is smooth but for its facets.
_POINTS, _TERMS = 25, 9
# A query may be so much further off the face than that fit, and its axis so far off the normal.
_OFF, _LEAST_OFF, _ALIGNED = 1.5, 1e-3, 0.1


def curved_model(
    scope: Scope, solver: Solver, accuracy: float, largest: float, bar: tuple[float, float, float, float], _: float
) -> tuple[Model, float, int]:
    """Return a model, by how much its table missed, and how many places were solved for.

    Raises:
        ExportError: if the face is not all above the region.
        RuntimeError: if a full solve failed.
    """
    radius = scope.case.probe.circumradius
    room = _LARGER * RADII[1] * radius / largest
    middle = scope.case.probe.at[:2]
    region = curved_region(scope, room)
    ratios = ratios_of(scope.poissons).tolist()
    known: dict[tuple[float, float], FloatArray] = {}
    told: list[float] = []

    def found(places: Places, poisson: float) -> FloatArray:
        for x, y in places:
            if (x, y) not in known:
                known[x, y], bars = _regular(solver, (x + middle[0], y + middle[1]), radius, scope, ratios)
                told.extend(bars)
        return np.array([known[place][ratios.index(poisson)] for place in places])

    table, missed = tabulate(region, scope.poissons, found, _SHARE * accuracy, _SIZES, sparse=not region.is_round)
    table = replace(table, leans=False)
    face, off = _face(scope, table, middle)
    model = Model(
        table, np.array([*middle, 0.0]), np.eye(3), region.sides, room, scope.young, scope.poisson, largest,
        (*bar[:3], float(np.mean(told))), face, max(_OFF * off, _LEAST_OFF * room), _ALIGNED,
    )  # fmt: skip
    return model, missed, len(known) * len(ratios)


def curved_region(scope: Scope, room: float) -> Region:
    """Return the region of a body that is not flat, round the study's place; a model answers for ``room`` (m)."""
    body, radius = scope.body, scope.case.probe.circumradius
    is_round, reach, even = False, (_REACH * radius,) * 2, (False, False)
    if body.half_sides and not any(scope.case.probe.at[:2]) and not body.inclusion:
        is_round, even = body.is_round, (True, True)
        reach = (_OF_AXES * body.half_sides[0], _OF_AXES * body.half_sides[1])
    return Region(reach, (reach[0] + 2 * room, reach[1] + 2 * room), room, is_round, even)


def _regular(
    solver: Solver, at: tuple[float, float], radius: float, scope: Scope, ratios: Sequence[float]
) -> tuple[FloatArray, list[float]]:
    """Return c and h for each Poisson's ratio (ratios, 2): d/F = 1/(2aE*) + c + a²h/3 - 2E*h²a⁵/45 for both radii.

    With them come the relative bars of the full solves.
    """
    radii, rests = [share * radius for share in RADII], []
    told: list[float] = []
    planes = 1 / (1 - np.square(ratios))
    for a, share in zip(radii, (_FINER, 1.0), strict=True):
        # The study's own materials, or all ratios on one mesh.
        fulls = replace(solver, accuracy=share * solver.accuracy).press_all(
            Tool("disc", a), at, [_DEPTH * a], ratios if len(ratios) > 1 else None
        )
        told.extend(full.error for full in fulls)
        rests.append(scope.young * _DEPTH * a / np.array([full.force for full in fulls]) - 0.5 / (planes * a))
    (a, b), h = radii, np.zeros(len(ratios))
    for _ in range(_STEPS):
        bent = [rest + 2 / 45 * planes * h**2 * r**5 for rest, r in zip(rests, radii, strict=True)]
        h = 3 * (bent[1] - bent[0]) / (b**2 - a**2)
    return np.stack([bent[0] - a**2 * h / 3, h], axis=-1), told


def _face(scope: Scope, table: Table, middle: tuple[float, ...]) -> tuple[Face, float]:
    """Return the face as polynomials, and how far (m) it is from them at most.

    Raises:
        ExportError: if there is no face above the region.
    """
    share = np.cos(np.pi * (np.arange(_POINTS) + 0.5) / _POINTS)
    count = 1 if table.is_round else _TERMS
    xs = table.reach[0] * (np.sqrt((share + 1) / 2) if table.even[0] else share)
    ys = table.reach[1] * (np.sqrt((share + 1) / 2) if table.even[1] else share)
    vander = np.polynomial.chebyshev.chebvander(share, _TERMS - 1)
    grid = [[(float(x), float(y)) for x in xs] for y in (ys if count > 1 else [0.0])]
    try:
        heights = np.array([
            [scope.body.frame((x + middle[0], y + middle[1])).point[2] for x, y in line] for line in grid
        ])  # fmt: skip
    except PlaceError as problem:
        raise ExportError(
            f"probe.at: the region round it, {1e3 * table.reach[0]:.3g} mm to each side: a place {problem}"
        ) from None
    rows = vander if count > 1 else np.ones((1, 1))
    height = _fitted(rows, vander, heights)
    plain = Face(height, np.zeros_like(height) + 1e-300)
    bends = np.array([[_bend(plain, table, x, y) for x, y in line] for line in grid])
    return Face(height, _fitted(rows, vander, bends)), float(np.abs(rows @ height @ vander.T - heights).max())


def _bend(face: Face, table: Table, x: float, y: float) -> float:
    """Return the mean curvature (1/m), positive on a dome."""
    spot = face.at(table, x, y)
    metric = np.eye(2) + np.outer(spot.slope, spot.slope)
    return float(-0.5 * np.trace(np.linalg.solve(metric, spot.second)) * spot.outward[2])


def _fitted(rows: FloatArray, columns: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.pinv(rows) @ values @ np.linalg.pinv(columns).T)
