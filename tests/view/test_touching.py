"""What touches a body besides the tool is seen: second jaws, supports, and the pressure on each surface."""

import json
import re

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.solved import solve_alone
from epsmesh.scene.model import BELOW, FIXED, JAW, LOOSE, PROBE, TOOL
from epsmesh.study.read import parse
from epsmesh.view.compute import compute_fields
from epsmesh.view.numbers import FACES, mesh_arrays
from epsmesh.view.page import render
from epsmesh.view.tool import tool_of
from tests.cases import raw
from tests.solve.test_curved_support import SHAPES, on_a
from tests.solve.test_elastic_tool import SOFT
from tests.solve.test_grasp import BALL, grasp
from tests.solve.test_loose import WEIGHT, flap
from tests.solve.test_support import HEAVY, on

WORLD = MPI.COMM_WORLD
SIZES = {"rim": "0.4 mm", "growth": 0.5, "fine": "3 mm"}
PULLED = grasp(
    BALL | {"friction": 0.3, "pull": "0.1 mm"}, {"depth": "0.5 mm"}, body={"fixed": "sides"}, mesh={"rim": "1 mm"}
)


def fields(content, comm=MPI.COMM_SELF, **how):
    made = parse(content)
    (case,) = made.cases()
    return compute_fields(solve_alone(made, case), comm, **how)


@pytest.fixture(scope="module")
def jaws():
    """Two jaws of which the second goes farther, on a body that is no quarter of a symmetric one."""
    depths = BALL | {"at": ["4 mm", "0 mm"]}, {"depth": "0.5 mm"}
    return fields(grasp(*depths, body={"fixed": "sides"}, mesh=SIZES), bar=True)


@pytest.fixture(scope="module")
def rests():
    return fields(raw(body=on(0), probe=BALL, mesh=SIZES, **HEAVY), bar=True)


def resultant(found, group):
    """Return the integral (N) of the pressure on a group of facets, along z."""
    corners = found.points[found.facets[group]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    return float((found.pressure[group] * np.abs(across)).sum())


def told(found):
    text = render(found, "scene")
    return text, json.loads(re.search(r'id="inputs">(.*?)</script>', text, re.DOTALL)[1])


def test_pressure_on_each_jaw_has_its_force(jaws):
    forces = {PROBE: jaws.force, JAW: jaws.besides["jaw_force"][0]}
    assert forces[JAW] > 1.5 * forces[PROBE]
    for group, force in forces.items():
        assert resultant(jaws, group) == pytest.approx(force, rel=0.1)
        middle = jaws.points[jaws.facets[group]].mean(axis=1) - jaws.contact
        is_far = np.hypot(*middle[:, :2].T) > (1.7e-3 if group == PROBE else 2.1e-3)
        assert is_far.any()
        assert jaws.pressure[group][is_far].max() < 0.05 * jaws.pressure[group].max()


def test_pressure_on_a_support_has_the_force_of_tool_and_weight(rests):
    force, bar = rests.besides["support_force"]
    assert force > 2 * rests.force
    assert 0 < bar < force
    assert resultant(rests, FIXED) == pytest.approx(force, rel=0.03)
    assert resultant(rests, PROBE) == pytest.approx(rests.force, rel=0.1)


def test_faces_of_the_page_have_the_pressure(jaws):
    arrays, (text, inputs) = mesh_arrays(jaws), told(jaws)
    (colour,) = (one for one in inputs["colours"] if one["name"] == "contact pressure")
    assert colour["faces"]
    assert colour["linear"]
    points = arrays["points"].reshape(3, -1).T
    cell, opposite = np.divmod(np.cumsum(arrays["faces"]), 4)
    cells = arrays["cells"].astype(int)
    cells[0] = np.cumsum(cells[0])
    middle = points[np.take_along_axis(np.cumsum(cells, axis=0).T[cell], FACES[opposite], axis=1)].mean(axis=1)
    highest = np.argmax(arrays["pressures"])
    # That of the jaw that goes farther, at the bottom of the body and on the axis.
    assert middle[highest] == pytest.approx([0, 0, -20], abs=1.0)
    most = max(own.max() for own in jaws.pressure.values())
    assert colour["limits"] == pytest.approx([0, most / 1e3])
    assert not arrays["pressures"][arrays["groups"] == 0].any()
    assert (inputs["touching"], inputs["held"]) == ("jaws", "fixed")
    assert re.search(r"<p>F = .* mN</p>\s*<p>F_jaw = .* mN</p>", text)


def test_both_jaws_are_where_they_are_and_within_what_is_seen(jaws):
    tool = tool_of(jaws)
    moved = tool.points + tool.moved
    upper, lower = tool.moved[:, 2] < 0, tool.moved[:, 2] > 0
    assert moved[upper, 2].min() == pytest.approx(-0.3e-3)
    assert moved[lower, 2].max() == pytest.approx(-20e-3 + 0.5e-3)
    for own in (upper, lower):
        assert moved[own, 0].mean() == pytest.approx(4e-3, abs=1e-4)
    assert told(jaws)[1]["low"][2] < -25


def test_jaws_are_drawn_where_they_are_pulled_to():
    moved = tool_of(fields(PULLED, mesh_only=True)).moved
    np.testing.assert_allclose(moved[:, 0], 0.1e-3, rtol=1e-12)
    assert {*np.round(moved[:, 2], 9)} == {-0.3e-3, 0.5e-3}


def test_the_plane_of_a_support_reaches_beyond_the_body_and_does_not_move(rests):
    tool = tool_of(rests)
    plane = tool.points[tool.moved[:, 2] == 0]
    assert plane[:, 2] == pytest.approx(-20e-3, abs=1e-5)
    assert plane[:, :2].min(axis=0) == pytest.approx(-plane[:, :2].max(axis=0))
    assert (plane[:, :2].max(axis=0) > 22e-3).all()
    inputs = told(rests)[1]
    assert (inputs["touching"], inputs["held"]) == ("tool and support", "on the support")


def test_tissue_and_a_tool_that_deforms_have_the_same_pressure_and_no_rigid_tool_is_drawn():
    found = fields(raw(probe=SOFT, mesh={"fine": "4 mm", "coarse": "12 mm", "rim": "0.3 mm"}))
    for group in (PROBE, TOOL):
        assert resultant(found, group) == pytest.approx(found.force, rel=0.1)
    assert found.pressure[TOOL].max() == pytest.approx(found.pressure[PROBE].max(), rel=0.1)
    assert not len(tool_of(found).points)
    inputs = told(found)[1]
    assert (inputs["touching"], inputs["held"]) == ("", "fixed")
    assert inputs["high"][2] > 1  # the tool is seen


@pytest.mark.parametrize(("shape", "hollow"), SHAPES)
@pytest.mark.parametrize("radius", ["12 mm", "100 mm"])
def test_a_round_support_is_drawn_below_the_body_as_far_as_it_goes(shape, hollow, radius):
    if hollow and radius == "12 mm":
        pytest.skip("the body is larger")
    found = fields(raw(body=on_a(shape, radius, hollow=hollow), probe=BALL), mesh_only=True)
    tool, ground = tool_of(found), found.case.body.ground
    own = tool.points[tool.moved[:, 2] == 0]
    assert ground.distance(own).gap == pytest.approx(0.0, abs=1e-5)
    body = found.points[found.facets[FIXED]].reshape(-1, 3)
    assert ground.distance(body).gap.min() == pytest.approx(0.0, abs=1e-9)
    across = np.hypot(*own[:, :2].T).max() if shape == "sphere" else own[:, 1].max()
    assert across == pytest.approx(min(ground.radius, 22e-3 if shape == "cylinder" else 30e-3), rel=0.2)


def test_what_nothing_but_jaws_holds_has_no_fixed_part():
    found = fields(grasp(BALL), mesh_only=True)
    assert told(found)[1]["held"] == ""
    assert found.pressure == {}


@pytest.mark.mpi
def test_ranks_agree():
    content = grasp(BALL, {"depth": "0.5 mm"}, body={"fixed": "sides"})
    together = fields(content, WORLD)
    if WORLD.rank:
        return
    alone = fields(content)
    for group, pressure in alone.pressure.items():
        np.testing.assert_allclose(together.pressure[group], pressure, rtol=1e-5, atol=1e-5 * pressure.max())


def test_a_loose_layer_has_the_pressure_on_both_of_its_sides():
    found = fields(raw(body=flap(0), probe=BALL, **HEAVY), bar=True)
    for group in (LOOSE, BELOW):
        assert resultant(found, group) == pytest.approx(WEIGHT + found.force, rel=0.05)
    assert (mesh_arrays(found)["groups"] < 4).all()
