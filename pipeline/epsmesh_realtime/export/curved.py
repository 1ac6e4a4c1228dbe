"""Models of curved bodies: the values at each place come from full solves of three discs, one of them bonded."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.contact import mean_curvature, paraboloid
from epsmesh.shapes.frame import PlaceError
from epsmesh_realtime.evaluator import Evaluator
from epsmesh_realtime.export.forecast import DEPTH, LARGER, RADII, REACHES, SIZES_CURVED, discs_at
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.region import Region, curved_region, is_free
from epsmesh_realtime.export.scope import ExportError, Scope
from epsmesh_realtime.export.setting import Setting, place_of
from epsmesh_realtime.export.tabulate import Places, ratios_of, tabulate
from epsmesh_realtime.model import Model
from epsmesh_realtime.table import Face, Table

# Fixed-point steps for h, whose square has little weight.
_STEPS = 50
# Largest error of the table for c at new nodes, as a share of the accuracy.
_SHARE = 0.5
# The face: points along each direction, and the number of polynomials fitted to them (facets are smoothed).
_POINTS, _TERMS = 25, 9
# On facets, second derivatives of that fit are noise near its ends. Curvature therefore comes from paraboloids, fitted
# within _WINDOW radii of the study's disc; its error is the largest difference to the windows _OTHERS. The smallest is
# that of a ball's or cone's contact, which follows single facets. Heights are _APART radii apart.
_WINDOW, _OTHERS, _APART = 1.0, (0.35, 0.5, 1.4), 0.125
# Places are within a region up to this share of its size.
_SAME = 1e-9
# Tolerances of a query: distance from the face, in units of that fit's error or of the room; angle to the normal.
_OFF, _LEAST_OFF, _ALIGNED = 1.5, 1e-3, 0.1


def curved_model(
    scope: Scope,
    solver: Solver,
    accuracy: float,
    largest: float,
    bar: tuple[float, float, float, float],
    _: float,
    ranks: Ranks = ALONE,
) -> tuple[Model, float, int]:
    """Return a model, the error of its table, and the number of places solved; collective.

    Raises:
        ExportError: if the face does not extend over the whole region.
        RuntimeError: if a full solve failed.
    """
    radius = scope.case.probe.circumradius
    room = LARGER * RADII[1] * radius / largest
    setting = Setting.of(scope.case)
    region, face, off, bend_error = _region_and_face(scope, room, setting)
    ratios = ratios_of(scope.poissons).tolist()
    known: dict[tuple[float, float], FloatArray] = {}
    smooth = Table.none(region.reach, is_round=region.is_axial, even=region.even).with_arrays(face.numbers())

    def regular(place: tuple[float, float]) -> FloatArray:
        spot = smooth.spot(*place)
        at = place_of(setting.axes, setting.origin + np.array([*place, spot.height]) @ setting.axes)
        return _regular(solver, at, upright(spot.normal) @ setting.axes, radius, scope, ratios)

    def found(places: Places, poisson: float) -> FloatArray:
        unknown = [place for place in dict.fromkeys(places) if place not in known]
        known.update(zip(unknown, ranks.in_turn(unknown, regular, "places solved"), strict=True))
        return np.array([known[place][ratios.index(poisson)] for place in places])

    table, error = tabulate(region, scope.poissons, found, _SHARE * accuracy, SIZES_CURVED, sparse=not region.is_round)
    table = replace(table, leans=False)
    model = Model(
        table,
        setting.origin,
        setting.axes,
        region.sides,
        room,
        scope.young,
        scope.poisson,
        largest,
        bar,
        face,
        max(_OFF * off, _LEAST_OFF * room),
        _ALIGNED,
        bend_error,
        relaxation=scope.relaxation,
    )
    return model, error, len(known) * len(ratios)


def _region_and_face(scope: Scope, room: float, setting: Setting) -> tuple[Region, Face, float, float]:
    """Return the largest region that has a face, and what :func:`_face` tells of it.

    Raises:
        ExportError: if even the smallest has none, or if places of the study are outside.
    """
    share, *smaller = REACHES
    while True:
        region = curved_region(scope, room, share * scope.case.probe.circumradius)
        try:
            found = _face(scope, region, setting)
        except ExportError:
            if not smaller or not is_free(scope):
                raise
            share, *smaller = smaller
        else:
            _check_places(scope, region, setting)
            return region, *found


def _check_places(scope: Scope, region: Region, setting: Setting) -> None:
    """Check that all places of the study are within the region.

    Raises:
        ExportError: if not.
    """
    away = np.abs(setting.local(np.array(scope.places))[:, :2]).max(axis=0)
    if (away > np.array(region.reach) * (1 + _SAME)).any():
        raise ExportError(
            f"probe.path: its places are up to {1e3 * away.max():.3g} mm from the middle one, and the model's region "
            f"reaches {1e3 * min(region.reach):.3g} mm to each side of it: export parts of the path, or use a larger "
            "disc"
        )


def _regular(
    solver: Solver, at: tuple[float, ...], turn: FloatArray, radius: float, scope: Scope, ratios: Sequence[float]
) -> FloatArray:
    """Return the values to tabulate for each Poisson's ratio (ratios, 9); the rows of ``turn`` are the place's axes.

    c and h satisfy d/F = 1/(2aE*) + c + a²h/3 - 2E*h²a⁵/45 for both radii. A₁ and A_xy are 0: second derivatives of R
    do not exist at a force on a curved face. R is the compliance of a bonded disc beyond that on a half-space.
    """
    *discs, _ = discs_at(radius)
    radii, rests = [tool.radius for _, tool in discs], []
    planes = 1 / (1 - np.square(ratios))
    several = ratios if len(ratios) > 1 else None  # the study's own materials, or all ratios on one mesh
    for share, tool in discs:
        a = tool.radius
        fulls = replace(solver, accuracy=share * solver.accuracy).press_all(tool, at, [DEPTH * a], several)
        rests.append(scope.young * DEPTH * a / np.array([full.force for full in fulls]) - 0.5 / (planes * a))
    (a, b), h = radii, np.zeros(len(ratios))
    for _ in range(_STEPS):
        bent = [rest + 2 / 45 * planes * h**2 * r**5 for rest, r in zip(rests, radii, strict=True)]
        h = 3 * (bent[1] - bent[0]) / (b**2 - a**2)
    none = np.zeros(len(ratios))
    stuck = _bonded(solver, at, turn, radius, scope, ratios)
    return np.stack([bent[0] - a**2 * h / 3, h, none, none, *stuck.T], axis=-1)


def _bonded(
    solver: Solver, at: tuple[float, ...], turn: FloatArray, radius: float, scope: Scope, ratios: Sequence[float]
) -> FloatArray:
    """Return R_xz, R_yz, the mean of R_xx and R_yy, half their difference, and R_xy (ratios, 5), in 1/m.

    R is that of a bonded disc of the study's ``radius``: its dependence on the radius is small. The disc is normal to
    the model's smooth face: a tilt against facets would add a share of its own compliances to R.
    """
    x, y, z = (-turn[2]).tolist()
    tool, depth = Tool("disc", radius, contact="bonded", motion="all", axis=(x, y, z)), DEPTH * radius
    found = []
    for ratio, full in zip(
        ratios, solver.press_all(tool, at, [depth], ratios if len(ratios) > 1 else None), strict=True
    ):
        soft = np.linalg.inv(turn @ full.stiffness[:3, :3] @ turn.T / scope.young)
        # A half-space under a bonded disc pulled along its face (R. D. Mindlin, 1949).
        xx, yy = soft[0, 0] - _soft_aside(radius, ratio), soft[1, 1] - _soft_aside(radius, ratio)
        found.append([soft[0, 2], soft[1, 2], (xx + yy) / 2, (xx - yy) / 2, soft[0, 1]])
    return np.array(found)


def _soft_aside(radius: float, poisson: float) -> float:
    return (2 - poisson) * (1 + poisson) / (4 * radius)


def upright(normal: Sequence[float] | FloatArray) -> FloatArray:
    """Return the axes (rows) of a place: those of the model, turned by the least angle to the outward normal."""
    x, y, z = map(float, normal)
    aside = np.array([x, y])
    turn = np.eye(3)
    turn[:2, :2] -= np.outer(aside, aside) / (1 + z)
    turn[:2, 2], turn[2] = -aside, normal
    return turn


def _face(scope: Scope, region: Region, setting: Setting) -> tuple[Face, float, float]:
    """Return the face as polynomials, with their largest errors in height (m) and in curvature (1/m).

    Raises:
        ExportError: if the face does not extend over the whole region.
    """
    share = np.cos(np.pi * (np.arange(_POINTS) + 0.5) / _POINTS)
    count = 1 if region.is_axial else _TERMS
    xs = region.reach[0] * (np.sqrt((share + 1) / 2) if region.even[0] else share)
    ys = region.reach[1] * (np.sqrt((share + 1) / 2) if region.even[1] else share) if count > 1 else np.zeros(1)
    vander = np.polynomial.chebyshev.chebvander(share, _TERMS - 1)
    heights = _heights(setting, xs, ys, f"the model's region, {1e3 * region.reach[0]:.3g} mm to each side of it,")
    rows = vander if count > 1 else np.ones((1, 1))
    height = _fitted(rows, vander, heights)
    if scope.body.half_sides:  # a smooth body
        table = Table.none(region.reach, is_round=region.is_axial, even=region.even)
        plain = table.with_arrays(Face(height, np.zeros_like(height)).numbers())
        bends, doubt = np.array([[_bend(plain, x, y) for x in xs] for y in ys]), 0.0
    else:
        bends, doubt = _bends(scope, setting, xs, ys)
    bend = _fitted(rows, vander, bends)
    errors = [float(np.abs(rows @ fit @ vander.T - known).max()) for fit, known in ((height, heights), (bend, bends))]
    return Face(height, bend), errors[0], doubt + errors[1]


def _heights(setting: Setting, xs: FloatArray, ys: FloatArray, what: str) -> FloatArray:
    """Return the face's height (y, x), in m, at offsets from the middle of the region; ``what`` starts an error.

    Raises:
        ExportError: if the face does not extend to one of them.
    """
    try:
        return setting.heights(xs, ys)
    except PlaceError as problem:
        beside = ", or give `at` x, y and z, to which the region is then tangent" if setting.tangent is None else ""
        raise ExportError(
            f"probe.at: {what} does not fit on the face (a place {problem}): move it, or make the probe smaller{beside}"
        ) from None


def _bends(scope: Scope, setting: Setting, xs: FloatArray, ys: FloatArray) -> tuple[FloatArray, float]:
    """Return the mean curvature (y, x), in 1/m, from paraboloids, and the largest difference to other window sizes.

    Raises:
        ExportError: if the face ends too near to the region.
    """
    radius = scope.case.probe.circumradius
    wide = max(_WINDOW, *_OTHERS) * radius
    across, down = (
        np.arange(-most, most + 1e-9, _APART * radius) for most in (np.abs(xs).max() + wide, np.abs(ys).max() + wide)
    )
    z = _heights(setting, across, down, f"the model's region with {1e3 * wide:.3g} mm around it")
    x, y = np.meshgrid(across, down)
    places = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    found, *others = (
        np.array([[_paraboloid(places - (x, y, 0.0), share * radius) for x in xs] for y in ys])
        for share in (_WINDOW, *_OTHERS)
    )
    return found, max(float(np.abs(other - found).max()) for other in others)


def _paraboloid(away: FloatArray, reach: float) -> float:
    """Return the mean curvature (1/m) at the apex of a paraboloid fitted to points (n, 3), in m, within ``reach``."""
    return paraboloid(away[away[:, 0] ** 2 + away[:, 1] ** 2 <= reach**2])


def _bend(face: Evaluator, x: float, y: float) -> float:
    """Return the mean curvature (1/m), positive on a dome."""
    spot = face.spot(x, y)
    return mean_curvature(spot.slope, spot.second)


def _fitted(rows: FloatArray, columns: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.pinv(rows) @ values @ np.linalg.pinv(columns).T)
