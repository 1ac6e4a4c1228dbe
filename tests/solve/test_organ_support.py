"""Organs on a support that lets go: a slab is the box that it is, an egg between two contacts, weights, refusals."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from tests import organs
from tests.cases import raw, refusal, solve
from tests.solve.test_support import BALL, DENSITY, GRAVITY, HEAVY, LARGE, WEIGHT
from tests.solve.test_support import on as on_bottom

SIZES = {"rim": "0.6 mm", "growth": 0.6, "fine": "6 mm", "coarse": "6 mm"}
EGG_SIZES = {"rim": "0.8 mm", "growth": 0.6, "fine": "4 mm", "coarse": "4 mm"}
# Semi-axes (m) of an organ as flat as a kidney that lies on its side, and of a ball.
FLAT, ROUND = (20e-3, 20e-3, 12e-3), (15e-3, 15e-3, 15e-3)


@pytest.fixture(scope="module")
def surface(tmp_path_factory):
    """Return a function that gives the body of a surface, which rests on what is below a height."""
    folder = tmp_path_factory.mktemp("organs")

    def made(below: str, friction: float | str = "stick", axes: Any = None, **more: Any) -> dict[str, Any]:
        name, shape = ("slab", None) if axes is None else ("egg", axes)
        if shape is None:
            points, facets = organs.box(40e-3, 40e-3, 20e-3)
        else:
            points, facets = organs.sphere(16)
            points = points * np.array(shape)
        file = organs.write_stl(folder / f"{name}.stl", points, facets)
        support = {"on": {"below": below}, "friction": friction} | more
        return {"shape": "surface", "file": str(file), "unit": "mm", "size": None, "fixed": "none", "support": support}

    return made


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case that worked."""
    (record,) = solve(comm, **changes).values()
    assert record.status == "ok", record.message
    return record


@pytest.mark.parametrize("load", [{}, HEAVY], ids=["light", "heavy"])
def test_a_slab_of_triangles_that_sticks_to_a_table_is_a_box_that_does(surface, load):
    slab, box = (one(probe=BALL, body=b, mesh=SIZES, **load) for b in (surface("-18 mm"), on_bottom("stick")))
    assert abs(slab.force / box.force - 1) < slab.force_error + box.force_error
    assert slab.force == pytest.approx(box.force, rel=2e-2)
    assert slab.largest["support_force"] == pytest.approx(slab.force + bool(load) * WEIGHT, rel=1e-6)
    assert slab.largest["lift_off_area"] < 1e-6 * 40e-3**2
    assert slab.balance < 1e-6


def test_the_height_says_what_may_touch_and_not_where_the_table_is(surface):
    """Walls above the bottom do not touch the table: F is the same wherever they begin to be searched."""
    low, high = (one(probe=BALL, body=surface(below), mesh=SIZES) for below in ("-18 mm", "-12 mm"))
    assert abs(low.force / high.force - 1) < low.force_error + high.force_error
    assert low.force == pytest.approx(high.force, rel=2e-2)


@pytest.mark.parametrize(
    ("friction", "at", "material"),
    [
        pytest.param("stick", "0 mm", {}, id="stick"),
        pytest.param(0.3, "6 mm", {}, id="beside the middle"),
        pytest.param("stick", "0 mm", LARGE, id="large", marks=pytest.mark.nightly),
    ],
)
def test_an_organ_settles_under_its_weight_and_is_pressed(surface, friction, at, material):
    body = surface("-6 mm", friction, FLAT)
    ball = BALL | {"radius": "6 mm", "depth": "0.3 mm", "at": [at, "0 mm"]}
    found = one(probe=ball, body=body, material=material | HEAVY["material"], load=GRAVITY, mesh=EGG_SIZES)
    weight = DENSITY * 9.81 * 4 / 3 * np.pi * np.prod(FLAT)
    assert found.largest["support_force"] == pytest.approx(found.force + weight, rel=1e-2)  # facets are within the egg
    assert found.balance < 1e-6
    assert 0 < found.largest["lift_off_area"] < np.pi * FLAT[0] ** 2
    assert found.largest["support_force_error"] >= 0


@pytest.mark.nightly
def test_facets_that_weight_flattens_below_the_plane_are_not_tissue_inside_the_tool(surface):
    """Corners of coarse elements of degree 2 come below the plane by more than a share of a small depth."""
    ball = BALL | {"radius": "6 mm", "depth": "0.1 mm", "at": ["0 mm", "0 mm"]}
    sizes = EGG_SIZES | {"rim": "0.4 mm", "fine": "7 mm", "coarse": "7 mm"}
    rests = surface("-6 mm", 0.3, FLAT)
    fixed = {key: value for key, value in rests.items() if key != "support"} | {"fixed": {"below": "-11 mm"}}
    found, held = (one(probe=ball, body=body, mesh=sizes, **HEAVY) for body in (rests, fixed))
    assert found.force < held.force * (1 + found.force_error + held.force_error)
    assert found.force > 0.8 * held.force
    assert found.balance < 1e-6


def hertz(depth: float, *radii: float) -> float:
    """Return the force (N) at which contacts in series, of these reduced radii (m), close by a depth (m)."""
    modulus = 10e3 / (1 - 0.3**2)
    return brentq(lambda f: sum((3 * f / (4 * modulus * r**0.5)) ** (2 / 3) for r in radii) - depth, 0, 10)


@pytest.mark.nightly
def test_a_ball_between_a_ball_and_a_table_has_the_force_of_hertz_twice(surface):
    """The ball is 8 contact radii wide, and sticks to the table: F is some per cent above that of two half-spaces."""
    depths, forces = (0.3e-3, 0.6e-3), []
    for depth in depths:
        tool = BALL | {"radius": "15 mm", "depth": f"{depth} m", "at": ["0 mm", "0 mm", "15 mm"], "axis": [0, 0, -1]}
        found = one(probe=tool, body=surface("-12 mm", axes=ROUND), mesh=EGG_SIZES | {"fine": "3 mm"})
        expected = hertz(depth, 7.5e-3, 15e-3)
        assert abs(found.force / expected - 1) < found.force_error + 0.05
        assert found.largest["support_force"] == pytest.approx(found.force, rel=1e-6)
        forces.append(found.force)
    assert forces[1] / forces[0] == pytest.approx(2**1.5, rel=0.05)


@pytest.mark.parametrize("friction", [0, 0.3])
def test_an_organ_that_nothing_holds_along_its_support_floats(surface, friction):
    (record,) = solve(MPI.COMM_SELF, probe=BALL, body=surface("-18 mm", friction), mesh=SIZES).values()
    assert record.status == "failed"
    assert "floats" in record.message


@pytest.mark.parametrize(
    ("below", "changes", "said"),
    [
        ("-18 mm", {"support": {"on": "bottom"}}, 'must be a height, {below = "-40 mm"}'),
        ("-18 mm", {"support": {"on": "table.stl"}}, "body.support.on"),
        ("-18 mm", {"support": {"on": {"below": "-18 mm"}, "shape": "sphere", "radius": "60 mm"}}, "a plane alone"),
        ("-30 mm", {}, "body.support.on"),
        ("-18 mm", {"fixed": {"below": "-18 mm"}}, 'must be "none" with [body.support]'),
        ("-18 mm", {"support": None}, '"none" with [body.support]'),
    ],
)
def test_what_is_not_computed_is_refused(surface, below, changes, said):
    assert said in refusal(raw(probe=BALL, body=surface(below) | changes, mesh=SIZES))


def test_boxes_rest_on_their_bottom_and_meshes_of_an_accuracy_do_not_refine_the_lowest_points(surface):
    of_box = on_bottom() | {"support": {"on": {"below": "-18 mm"}}}
    assert "`on` must be 'bottom'" in refusal(raw(probe=BALL, body=of_box))
    chosen = {"accuracy": "5 %", "epsilon": None, "fine": None, "coarse": None, "rim": None, "growth": None}
    assert "body.support.on" in refusal(raw(probe=BALL, body=surface("-18 mm"), mesh=chosen))


@pytest.mark.mpi
def test_ranks_agree(surface):
    changes = {"probe": BALL, "body": surface("-18 mm"), "mesh": SIZES | {"rim": "1 mm"}}
    alone, both = (one(comm, **changes) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-6)
    assert both.largest["support_force"] == pytest.approx(alone.largest["support_force"], rel=1e-6)
