"""A probe anywhere on a body: results of the probe's own frame are returned in the body's coordinates."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays, upright
from epsmesh.plan.steps import Solve
from epsmesh.run.measure import record_of
from epsmesh.run.problem import problem_of, solve_problem
from epsmesh.solve.spaces import Spaces
from tests.cases import BLADE, solve, study

DISC = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"}
MESH = {"epsilon": "full", "fine": "6 mm", "coarse": "8 mm", "rim": "1 mm", "growth": 0.8, "model": "3d"}
TOP = {"shape": "box", "size": ["40 mm", "30 mm", "20 mm"], "fixed": "bottom"}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["20 mm", "20 mm", "20 mm"], "fixed": {"below": "-10 mm"}}
# x, y, z of the box pressed on its top become z, x, y of the box pressed on its side.
TO_SIDE = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def case_of(**changes):
    (case,) = study(mesh=MESH, **changes).cases()
    return case


def record_on(arrays, case):
    """Return the record of a case, solved on a mesh of its body."""
    mesh = distribute(MPI.COMM_SELF, upright(case, arrays))
    with Spaces(mesh) as spaces, problem_of(spaces, case) as problem:
        solution = solve_problem(case, problem, estimate=True)
    return record_of(Solve("key", case), solution)


def at(*millimetres):
    return [f"{x} mm" for x in millimetres]


@pytest.mark.parametrize(
    "probe",
    [
        DISC,
        DISC | {"contact": "frictionless"},
        DISC | {"motion": "all"},
        BLADE | {"slice": "0.2 mm"},
    ],
    ids=["bonded", "frictionless", "all", "slicing"],
)
def test_a_box_pressed_on_its_side_is_the_one_pressed_on_its_top(probe):
    """On the same mesh, rotated: forces, stiffness and bars rotate with it, to rounding."""
    top = case_of(body=TOP, probe=probe | {"at": at(4, -3)})
    turned = {"direction": list(TO_SIDE @ [1.0, 0.0, 0.0])} if "width" in probe else {}
    side = case_of(
        body={"shape": "box", "size": at(20, 40, 30), "fixed": "bottom"},
        probe=probe | turned | {"at": at(10, 4, -18)},
    )
    arrays = mesh_arrays(top, ())
    # The origin of the box pressed on its side is the centre of its top.
    points = arrays.points @ TO_SIDE.T + [10e-3, 0.0, -15e-3]
    here, there = record_on(arrays, top), record_on(replace(arrays, points=points), side)
    assert there.force == pytest.approx(here.force, rel=1e-6)
    assert there.force_error == pytest.approx(here.force_error, rel=1e-3)
    np.testing.assert_allclose(there.force_vector, TO_SIDE @ here.force_vector, atol=1e-6 * here.force)
    if probe.get("motion"):
        both = np.kron(np.eye(2), TO_SIDE)
        stiffness = np.array(here.stiffness)
        np.testing.assert_allclose(there.stiffness, both @ stiffness @ both.T, atol=1e-5 * np.abs(stiffness).max())
        bars = np.array(here.stiffness_error)
        np.testing.assert_allclose(there.stiffness_error, both @ bars @ both.T, atol=0.02 * bars.max())


def test_the_force_along_an_inclined_axis_follows_from_the_stiffness():
    """For the same footprint, on the same mesh: F = K d."""
    level = case_of(body=TOP, probe=DISC | {"motion": "all", "at": at(4, -3)})
    inclined = case_of(body=TOP, probe=DISC | {"axis": [0.4, -0.2, -1.0], "at": at(4, -3)})
    arrays = mesh_arrays(level, ())
    stiffness, found = np.array(record_on(arrays, level).stiffness), record_on(arrays, inclined)
    force = -stiffness[:3, :3] @ inclined.travel
    np.testing.assert_allclose(found.force_vector, force, atol=1e-6 * found.force)
    assert found.force == pytest.approx(-force @ inclined.frame.axis, rel=1e-6)
    assert found.energy == pytest.approx(found.force * inclined.probe.depth / 2, rel=1e-6)


def test_an_inclined_needle_presses_on_what_projects_into_it():
    """Its footprint on a flat top is an ellipse, longer by 1 / cos of the inclination."""
    tilt = np.radians(40)
    axis = [float(np.sin(tilt)), 0.0, -float(np.cos(tilt))]
    case = case_of(body=TOP, probe=DISC | {"axis": axis})
    mesh = mesh_arrays(case, ())
    edge = mesh.points[mesh.rim]
    np.testing.assert_allclose(edge[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose((edge[:, 0] * np.cos(tilt)) ** 2 + edge[:, 1] ** 2, 9e-6, rtol=1e-9)


def test_round_bodies_take_the_same_force_all_round():
    """A cylinder on its side, a ball touched anywhere, at equal distances from the support."""
    cylinder = {"shape": "cylinder", "radius": "20 mm", "height": "40 mm", "fixed": "bottom"}
    places = [at(20, 0, -15), at(0, 20, -15), at(12, -16, -15)]
    found = [*solve(body=cylinder, mesh=MESH, probe=DISC | {"at": places}).values()]
    assert all(record.is_ok for record in found), [record.message for record in found]
    for record in found[1:]:
        assert abs(record.force / found[0].force - 1) < record.force_error + found[0].force_error
    ball = [*solve(body=ELLIPSOID, mesh=MESH, probe=DISC | {"at": [at(12, 0, 16), at(0, 12, 16)]}).values()]
    assert all(record.is_ok for record in ball), [record.message for record in ball]
    assert abs(ball[1].force / ball[0].force - 1) < ball[0].force_error + ball[1].force_error
    forward, aside = (np.array(record.force_vector) for record in ball)
    assert forward[[1, 0, 2]] == pytest.approx(aside, rel=0.1, abs=1e-4)


@pytest.mark.parametrize("shape", [DISC, {"shape": "blade", "length": "6 mm", "width": "2 mm", "depth": "0.1 mm"}])
def test_a_footprint_on_a_ball_is_what_projects_into_it_and_no_more(shape):
    """Its edge is on the ball, mid nodes included, and the far side is not touched."""
    case = case_of(body=ELLIPSOID, probe=shape | {"at": at(8, 6, 17.3)})
    mesh = mesh_arrays(case, ())
    touched = np.unique(mesh.facets["probe"])
    distance = np.linalg.norm(mesh.points[touched], axis=1)
    np.testing.assert_allclose(distance, 20e-3, rtol=1e-7)
    local = case.frame.local(mesh.points)
    assert local[touched, 2].min() > -2e-3
    edge = local[mesh.rim, :2]
    np.testing.assert_allclose(case.probe.to_edge(edge), edge, atol=1e-9)
    # The area of the cap is π (a² + h²); the footprint's corners give that of the inscribed polygon.
    corners = mesh.points[mesh.facets["probe"]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    if shape is DISC:
        height = 20e-3 - np.sqrt(20e-3**2 - 3e-3**2)
        assert area == pytest.approx(np.pi * (9e-6 + height**2), rel=0.03)
