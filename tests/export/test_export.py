"""Tables that know a smooth body, studies that no model is made of, and one body by full solves."""

from collections.abc import Sequence
from math import pi

import numpy as np
import pytest
from mpi4py import MPI

from pipeline.export.checks import Check, needed
from pipeline.export.compliance import Region, coarse_mesh, compliances
from pipeline.export.scope import ExportError, scope_of
from pipeline.export.tabulate import tabulate
from pipeline.realtime import Model
from pipeline.study.load import parse
from pipeline.verify.compare import solve

DISC = {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "frictionless"}
BALL = {"shape": "sphere", "radius": "6 mm", "depth": "0.1 mm", "contact": "unilateral"}
CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
BOX = {"shape": "box", "size": ["40 mm", "60 mm", "20 mm"]}
BELOW = {"below": "-5 mm"}
SOFT = {"young": "10 kPa", "poisson": 0.45}


def study(**sections):
    mesh = {"mesh": {"accuracy": "1 %"}, "solve": {"exact": False}}
    return parse({"body": CYLINDER, "material": SOFT, "probe": DISC} | mesh | sections)


def images(region: Region) -> "tuple[object, list[int]]":
    """Return c and h of images beyond the sides, about as a body has them, and how many were asked for."""
    asked: list[int] = []

    def found(places: Sequence[tuple[float, float]], poisson: float) -> np.ndarray:
        asked.append(len(places))
        x, y = np.array(places).T
        if region.is_round:
            to = [region.sides[0] - np.hypot(x, y), region.sides[0] + np.hypot(x, y)]
        else:
            to = [region.sides[0] - x, region.sides[0] + x, region.sides[1] - y, region.sides[1] + y]
        c = sum(0.3 * (1 - poisson**2) / d for d in to) - 0.8 / region.thickness
        return np.stack([c, sum(0.05 / d**3 for d in to)], axis=-1)

    return found, asked


@pytest.mark.parametrize(("shape", "most"), [("box", 300), ("square", 165), ("round", 30)])
def test_a_table_knows_what_is_between_its_nodes(shape, most):
    sides = {"box": (0.02, 0.03), "square": (0.03, 0.03), "round": (0.03, 0.03)}[shape]
    region = Region(tuple(0.85 * side for side in sides), sides, 0.02, shape == "round")
    body, asked = images(region)
    table, missed = tabulate(region, (0.3, 0.49), body, 2e-3)
    assert missed <= 2e-3
    assert sum(asked) <= 3 * most
    rng = np.random.default_rng(3)
    for _ in range(50):
        x, y = rng.uniform(-0.7, 0.7, 2) * region.reach
        poisson = rng.uniform(0.3, 0.49)
        ((c, h),) = body([(abs(x), abs(y))], poisson)
        place, room = table.at(x, y, poisson), region.room(x, y)
        assert abs(place.c - c) * room < 2e-3
        assert abs(place.h - h) * room**3 < 0.02
    step = 1e-6
    slope = (table.at(x + step, y, poisson).c - table.at(x - step, y, poisson).c) / (2 * step)
    assert place.slope_c[0] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize(
    ("sections", "word"),
    [
        ({"probe": DISC | {"contact": "bonded"}}, "bonded"),
        ({"body": {"shape": "ellipsoid", "axes": ["30 mm", "30 mm", "15 mm"], "fixed": BELOW}}, "ellipsoid"),
        ({"body": CYLINDER | {"fixed": "bottom+sides"}}, "support"),
        ({"material": SOFT | {"poisson": 0.5}}, "0.5"),
        ({"body": [CYLINDER | {"name": "a"}, BOX | {"name": "b"}]}, "several"),
        ({"probe": {"shape": "blade", "length": "6 mm", "width": "1 mm", "depth": "0.1 mm"}}, "blade"),
    ],
)
def test_what_has_no_model_yet_is_refused_by_name(sections, word):
    with pytest.raises(ExportError, match=word):
        scope_of(study(**sections))


def test_the_range_of_poissons_ratio_holds_that_of_the_study():
    assert scope_of(study(material=SOFT | {"poisson": [0.2, 0.4]})).poissons == (0.2, 0.49)


@pytest.fixture(scope="module")
def middle() -> Model:
    """A model of the middle of a cylinder, at one Poisson's ratio, as a table of one number."""
    from pipeline.realtime.table import Table

    scope = scope_of(study())
    region = Region.of(scope.body, 0.5)
    ((c, h),) = compliances(coarse_mesh(scope.case, region), region, [(0.0, 0.0)], 0.45)
    t = 1 / (c + 100)
    numbers = (np.full((1, 1, 1), t), np.full((1, 1, 1), h * t**3))
    table = Table(*numbers, 100.0, region.reach, True, (0.45, 0.45))
    return Model(table, np.zeros(3), np.eye(3), region.sides, 0.02, 10e3, 0.45, 0.5, (0.0, 0.0, 0.0, 0.0), off=1e-8)


@pytest.mark.parametrize(
    ("probe", "asked", "most"),
    [
        (DISC, {"tool": "disc", "radius": 2e-3}, 1e-3),
        (DISC | {"radius": "6 mm"}, {"tool": "disc", "radius": 6e-3}, 6e-3),
        (BALL, {"tool": "sphere", "radius": 6e-3}, 1e-3),
        (BALL | {"radius": "15 mm", "depth": "1 mm"}, {"tool": "sphere", "radius": 15e-3}, 3e-3),
        (
            BALL | {"shape": "cone", "angle": "70 deg", "radius": "8 mm", "depth": "1 mm"},
            {"tool": "cone", "radius": 8e-3, "angle": 70 * pi / 180}, 1e-3,
        ),
    ],
)  # fmt: skip
def test_forces_are_those_of_full_solves(middle, probe, asked, most):
    force, bar, message = solve(MPI.COMM_SELF, "2D", {"body": CYLINDER, "material": SOFT, "probe": probe})
    assert not message
    depth = 1e-3 * float(probe["depth"].split()[0])
    touch = middle.query(asked.pop("tool"), at=(0.0, 0.0, 0.0), depth=depth, **asked)
    assert touch.status == "ok"
    assert touch.force[2] == pytest.approx(force, rel=most + bar)


def test_bars_grow_until_they_hold_what_they_were_fitted_to():
    touches = [Check(0, 0, 1e-3, 1e-5, 0.4, 1.0, 1e-3, 1 + error, 0.006) for error in (0.001, -0.011)]
    assert needed(touches[:1], 0.002) == 1.0
    factor = needed(touches, 0.002)
    assert 0.011 < 0.002 + factor * (0.006 - 0.002) < 0.015
    assert [touch.is_held for touch in touches] == [True, False]
