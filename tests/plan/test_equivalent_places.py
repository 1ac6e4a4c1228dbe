"""Of places that a symmetry of the body maps onto each other one is solved, and it maps the forces, too."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from tests.cases import BLADE, study

ROUND = {"shape": "cylinder", "radius": "20 mm", "height": "15 mm"}
OVAL = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
CORNERS = {"raster": {"x": ["-9 mm", "0 mm", "9 mm"], "y": ["-6 mm", "6 mm"]}}
RING = {"circle": {"centre": ["0 mm", "0 mm"], "radius": "9 mm", "steps": 8}}
LUMP = {"name": "lump", "radius": "3 mm", "young": "50 kPa", "poisson": 0.3}


def solves(path, probe=None, **changes):
    return len(make_plan(study(probe=(probe or {}) | {"path": path}, **changes)).solves)


@pytest.mark.parametrize(
    ("expected", "path", "changes"),
    [
        (2, CORNERS, {}),
        (2, CORNERS, {"body": OVAL}),
        (4, CORNERS, {"body": {"inclusion": [LUMP | {"at": ["0 mm", "3 mm", "-8 mm"]}]}}),
        (6, CORNERS, {"body": {"inclusion": [LUMP | {"at": ["2 mm", "3 mm", "-8 mm"]}]}}),
        (6, CORNERS, {"probe": {"motion": "all"}}),
        (6, CORNERS, {"plan": {"without": ["mirrored"]}}),
        (4, CORNERS, {"material": {"poisson": [0.3, 0.4]}}),
        (3, RING, {}),
        (1, RING, {"body": ROUND}),
        (3, RING, {"body": ROUND, "probe": BLADE}),  # along x: along the radius, across it, between
        # A tilt along x is another one at each place, but for those mirrored in y = 0.
        (5, RING, {"body": ROUND, "probe": {"axis": [0.2, 0.0, -1.0]}, "mesh": {"degree": 2}}),
    ],
)
def test_images_are_found_where_body_and_tool_have_them(expected, path, changes):
    assert solves(path, **changes) == expected


ACROSS = {"line": {"from": ["-5 mm", "1 mm"], "to": ["11 mm", "3 mm"], "steps": 5}}
COLUMN = {"outside": "free", "epsilon": "8 mm"}


@pytest.mark.parametrize(
    ("expected", "mesh", "changes"),
    [
        (1, COLUMN, {}),
        (1, COLUMN, {"body": {"layer": [{"name": "skin", "thickness": "3 mm", "young": "50 kPa", "poisson": 0.4}]}}),
        (1, COLUMN, {"body": {"fixed": "bottom+sides"}, "probe": BLADE}),
        (1, {"outside": "halfspace", "epsilon": "8 mm"}, {}),
        (2, {"outside": "free", "epsilon": "10 mm"}, {}),  # the last one is 9 mm from a side
        (5, {"outside": "coarse", "epsilon": "8 mm"}, {}),
        (5, {"outside": "green", "epsilon": "8 mm"}, {}),
        (5, COLUMN, {"body": {"inclusion": [LUMP | {"at": ["2 mm", "3 mm", "-8 mm"]}]}}),
        (5, COLUMN, {"plan": {"without": ["translated"]}}),
    ],
)
def test_what_is_cut_out_of_flat_tissue_is_the_same_anywhere(expected, mesh, changes):
    assert solves(ACROSS, changes.pop("probe", None), mesh={"degree": 2} | mesh, **changes) == expected


def test_f_exact_is_the_bodys_where_the_column_is_the_same_anywhere():
    plan = make_plan(study(probe={"path": ACROSS}, mesh=COLUMN, solve={"exact": True}))
    assert len({*plan.keys}) == 1 and len({*plan.reference_keys}) == 5


def test_a_blade_that_slices_keeps_its_sense():
    """Drawn along x, towards the wall or away from it: no images but those in y = 0."""
    line = {"points": [["9 mm", "5 mm"], ["-9 mm", "5 mm"], ["9 mm", "-5 mm"]]}
    assert solves(line, BLADE) == 1
    assert solves(line, BLADE | {"slice": "0.1 mm"}) == 2


def test_forces_on_images_are_images():
    """Held to solutions of their own, on meshes that differ: within the error bars."""
    path = {"points": [["12 mm", "0 mm"], ["0 mm", "-12 mm"]]}
    changes = {"body": ROUND | {"fixed": "sides"}, "mesh": {"rim": "0.7 mm"}, "probe": {"path": path}}
    plans = [make_plan(study(**changes), without=without) for without in ((), ("mirrored",))]
    once, each = (build(plan, compute(plan, MPI.COMM_SELF)) for plan in plans)
    assert [len(plan.solves) for plan in plans] == [1, 2]
    assert once["origin"].values.tolist()[1] == "mirrored"
    np.testing.assert_allclose(once["force"], each["force"], atol=2 * float(each["force_error"].max()))
    vectors = once["force_vector"].values
    np.testing.assert_allclose(vectors[1], [vectors[0][1], -vectors[0][0], vectors[0][2]], atol=1e-15)
    off = np.abs(vectors - each["force_vector"].values)
    assert abs(vectors[0][0]) > 0.01 * vectors[0][2]  # the nearer wall pulls
    assert np.all(off <= 2 * each["force_error"].values[:, None])


def test_f_exact_of_images_is_one():
    plan = make_plan(study(probe={"path": CORNERS}, solve={"exact": True}))
    assert len({*plan.reference_keys}) == 2
    assert len(plan.solves) == 4
