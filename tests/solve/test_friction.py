"""Friction of found contact: limits in the coefficient, closed forms for tissue that sticks, Coulomb's law at nodes."""

from math import inf, log

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.tools import tool_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.contact.facets import facet_nodes
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.problems import StudyError
from tests.cases import NO_SIZES, solve, solved, study
from tests.verification import known

BODY = {"shape": "cylinder", "radius": "60 mm", "height": "60 mm"}
SPHERE = {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"}
DISC = {"shape": "disc", "radius": "1 mm", "depth": "0.1 mm", "contact": "unilateral"}
MESH = {"fine": "20 mm", "coarse": "20 mm", "rim": "0.3 mm", "growth": 0.5}


def record(friction=0.0, probe=SPHERE, mesh=None, poisson=0.3, comm=MPI.COMM_SELF, **changes):
    scene = {"body": BODY, "mesh": MESH | (mesh or {}), "probe": probe | {"friction": friction}} | changes
    scene["material"] = {"poisson": poisson}
    return solved(comm, **scene)


def test_without_friction_it_is_the_frictionless_contact():
    slippery, smooth = record(1e-9), record()
    assert slippery.force == pytest.approx(smooth.force, rel=1e-6)
    assert slippery.slip_area == pytest.approx(slippery.contact_area)
    assert np.isnan(smooth.slip_area)


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_a_ball_to_which_tissue_sticks_needs_the_force_of_the_closed_form(poisson):
    """The ratio to the frictionless force, in which mesh errors cancel; load steps err by the bar's first part."""
    ratio = record("stick", poisson=poisson).force / record(poisson=poisson).force
    assert ratio == pytest.approx(known.stick_ratio(poisson, 2), abs=0.003)


def test_friction_adds_nothing_to_incompressible_tissue():
    assert record("stick", poisson=0.499).force == pytest.approx(record(poisson=0.499).force, rel=5e-4)


def test_more_friction_needs_more_force_and_slides_less():
    found = [record(friction) for friction in (0.0, 0.05, 0.2, 0.8, "stick")]
    forces, slips = [r.force for r in found], [r.slip_area for r in found[1:]]
    assert (np.diff(forces) > -1e-4 * forces[0]).all()
    assert forces[2] > 1.005 * forces[0]
    assert slips[0] > slips[1] > max(slips[2:])
    assert slips[-1] == 0.0
    assert found[2].energy < found[2].force * 0.1e-3 / 2


@pytest.mark.parametrize("of_law", ["linear", pytest.param("large", marks=pytest.mark.nightly)])
def test_the_area_that_slides_and_the_friction_have_bars_that_hold_another_mesh(of_law):
    solved, friction, rim = (record, 0.2, "0.45 mm") if of_law == "linear" else (large, 0.3, "0.42 mm")
    found, coarse = solved(friction), solved(friction, mesh={"rim": rim})
    for name in ("slip_area", "friction_force"):
        (value, bar), (other, its_bar) = ((getattr(r, name), getattr(r, f"{name}_error")) for r in (found, coarse))
        assert 0 < bar < 0.6 * (found.contact_area if name == "slip_area" else value)
        assert abs(value - other) < bar + its_bar
    sticks = solved("stick")
    assert sticks.slip_area == sticks.slip_area_error == 0 < sticks.friction_force_error < 0.5 * sticks.friction_force


def test_a_flat_punch_that_sticks_is_the_bonded_one():
    bonded, smooth = (record(probe=DISC | {"contact": contact}) for contact in ("bonded", "frictionless"))
    sticks, rubs = record("stick", DISC), record(0.3, DISC)
    assert sticks.force == pytest.approx(bonded.force, rel=1e-6)
    assert smooth.force < rubs.force < sticks.force
    assert 0 < rubs.slip_area < rubs.contact_area


@pytest.mark.parametrize(
    ("tool", "mesh", "poisson"),
    [
        # Directions of slip contract by half in an iteration: halving steps nevertheless ended short of the law.
        ({"radius": "4 mm"}, {"epsilon": "10 mm", "fine": "3.8 mm"}, 0.49),
        # Two nodes next to sticking slide, and reversed in each iteration.
        pytest.param(
            {"shape": "blade", "length": "8 mm", "width": "2 mm", "at": ["3 mm", "2 mm"]},
            {"epsilon": "10 mm", "fine": "2.9 mm"},
            0.3,
            marks=pytest.mark.nightly,
        ),
    ],
    ids=["disc", "blade"],
)
def test_friction_of_a_flat_punch_settles(tool, mesh, poisson):
    body = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"]}
    mesh = mesh | {"coarse": "8 mm", "rim": "1 mm", "growth": 0.8}
    probe = {"shape": "disc", "contact": "unilateral", "depth": "0.3 mm"} | tool
    smooth, rubs, sticks = (record(friction, probe, mesh, poisson, body=body) for friction in (0.0, 0.3, "stick"))
    assert smooth.force < rubs.force < sticks.force


def test_tractions_obey_coulomb():
    (case,) = study(body=BODY, probe=SPHERE | {"friction": 0.2}, mesh=MESH).cases()
    with Spaces(mesh_case(case, ("x", "y"), MPI.COMM_SELF)) as spaces:
        problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, case.way.element, tool=tool_of(case))
        solution = problem.solve(law_of(case), movement_of(case))
        contact = problem.constraint.contact
    step, corner = contact.rubbed.fine, contact.obstacle.candidates.is_corner
    normal, tangential = -step.forces[:, 2], np.linalg.norm(step.forces[:, :2], axis=1)
    touching, sliding = step.active & ~corner, step.slide.sliding & ~corner
    assert solution.balance < 1e-6
    assert (normal[touching] > 0).all()
    assert (tangential[touching] <= 0.2 * normal[touching] + 1e-6 * normal.max()).all()
    assert tangential[sliding] == pytest.approx(0.2 * normal[sliding], abs=1e-6 * normal.max())
    assert np.abs(step.forces[~step.active]).max() == 0.0
    through = contact.rubbed.moved[:, 2] - contact.obstacle.bounds
    assert np.abs(through[step.active]).max() < 1e-9 * 0.1e-3
    assert through[~corner].max() < 1e-5 * 0.1e-3
    assert through.max() < 0.02 * 0.1e-3  # corners beside the edge have no part of a pressure


def test_half_a_body_and_a_quarter_agree():
    """Nodes in the planes of symmetry slide along them."""
    forces = []
    for planes in (("x", "y"), ("y",)):
        (case,) = study(body=BODY, probe=SPHERE | {"friction": 0.2}, mesh=MESH).cases()
        with Spaces(mesh_case(case, planes, MPI.COMM_SELF)) as spaces:
            problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, case.way.element, tool=tool_of(case))
            solution = problem.solve(law_of(case), movement_of(case))
            forces.append(solution.reaction)
    assert forces[1][2] == pytest.approx(forces[0][2], rel=1e-4)
    assert abs(forces[1][0]) < 1e-4 * forces[1][2]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"probe": SPHERE | {"friction": 2.5}}, 'a number from 0 to 2, or "stick"'),
        ({"probe": SPHERE | {"friction": "rough"}}, 'a number from 0 to 2, or "stick"'),
        ({"probe": DISC | {"contact": "bonded", "friction": 0.3}}, 'use contact = "unilateral"'),
    ],
)
def test_what_friction_is_not_for(changes, reason):
    with pytest.raises(StudyError, match=reason):
        study(**changes)


def test_a_sweep_may_hold_numbers_and_the_word():
    probes = study(body=BODY, mesh=MESH, probe=SPHERE | {"friction": [0, 0.3, "stick"]})
    assert [case.probe.friction for case in probes.cases()] == [0.0, 0.3, inf]
    assert [case.words["friction"] for case in probes.cases()] == ["0", "0.3", "stick"]


def test_closed_form_is_that_of_a_flat_punch_with_the_depth_of_a_ball():
    """ν → 1/2: no effect; ν = 0: ln 3 of the flat punch, times the effect of the wider contact."""
    assert known.stick_ratio(0.4999, 2) == pytest.approx(1.0, abs=1e-5)
    assert known.stick_ratio(0.0, 2) == pytest.approx(1.0529, abs=1e-3)
    assert known.stick_ratio(0.0, 2) < log(3)


LARGE = {"body": {"shape": "cylinder", "radius": "20 mm", "height": "15 mm"}}
NEO_HOOKEAN = {"law": "neo-hookean", "poisson": 0.3}


def large(friction, mesh=None):
    """Return the record of a ball on neo-Hookean tissue."""
    mesh = {"fine": "6 mm", "coarse": "6 mm", "rim": "0.35 mm", "growth": 0.7} | (mesh or {})
    return solved(**LARGE, probe=SPHERE | {"friction": friction}, mesh=mesh, material=NEO_HOOKEAN)


def test_at_large_displacements_little_friction_is_none():
    assert large(1e-9).force == pytest.approx(large(0.0).force, rel=1e-6)
    assert large(1e-9).slip_area == pytest.approx(large(1e-9).contact_area)


@pytest.mark.parametrize("rim", ["0.42 mm", pytest.param("0.5 mm", marks=pytest.mark.nightly)])
def test_little_friction_settles_at_large_displacements(rim):
    forces = [large(friction, {"rim": rim}).force for friction in (0.0, 0.1, 0.3)]
    assert forces[0] < forces[1] < forces[2]


def test_at_small_depth_the_law_does_not_matter():
    """What friction adds is that at small displacements, up to the ratio of contact radius and ball, which is 0.1."""
    for friction in (0.3, "stick"):
        found, smooth = large(friction), large(0.0)
        added = found.force / smooth.force - 1
        wanted = record(friction).force / record().force - 1
        assert added == pytest.approx(wanted, rel=0.25)
        assert added > 0.005
        assert found.balance < 1e-6
    assert large("stick").slip_area == 0.0
    assert 0 < large(0.3).slip_area < large(0.3).contact_area


def test_the_torque_of_a_blade_that_sticks_is_that_of_the_bonded_one():
    """Both components of the force across the axis, and the torque about it, from the stiffness of six motions."""
    square, depth = {"shape": "box", "size": ["16 mm", "16 mm", "8 mm"]}, 0.1e-3
    blade = {"shape": "blade", "length": "4 mm", "width": "1 mm", "depth": "0.1 mm", "direction": [1, 0.4, 0]}
    blade |= {"at": ["4 mm", "2 mm"]}
    mesh = {"fine": "4 mm", "coarse": "4 mm", "rim": "0.8 mm"}
    sticks = record("stick", blade | {"contact": "unilateral"}, mesh, body=square)
    bonded = record(0.0, blade | {"contact": "bonded", "motion": "all"}, mesh, body=square)
    force = -depth * np.array(bonded.stiffness)[:, 2]
    assert sticks.contact_area == pytest.approx(4e-6, rel=0.02)
    assert sticks.torque == pytest.approx(force[5], rel=1e-4)
    assert abs(sticks.torque) > 1e-8
    assert -np.array(sticks.force_vector) == pytest.approx(force[:3], rel=1e-4)


def test_a_ball_beside_a_corner_has_forces_across_its_axis_and_next_to_no_torque():
    square = {"shape": "box", "size": ["12 mm", "12 mm", "8 mm"]}
    ball = SPHERE | {"radius": "4 mm", "depth": "0.2 mm", "at": ["3 mm", "1.2 mm"]}
    found = record(0.3, ball, {"fine": "4 mm", "coarse": "4 mm", "rim": "0.35 mm"}, poisson=0.2, body=square)
    across, along, _ = found.force_vector
    assert across > 2 * along > 0
    assert abs(found.torque) < 0.01 * found.friction_force * found.contact_radius


@pytest.mark.parametrize(("poisson", "rim"), [(0.4, "0.9 mm"), (0.45, "1.5 mm")])
def test_below_a_sharp_disc_to_which_tissue_sticks_friction_is_that_of_the_meridian(poisson, rim):
    """The traction is singular at its edge, where nodal forces alternate: their sizes add up to more."""
    scene = {
        "body": {"shape": "cylinder", "radius": "10 mm", "height": "8 mm"},
        "material": {"poisson": poisson},
        "probe": DISC | {"radius": "3 mm", "friction": "stick"},
    }
    (coarse,) = solve(**scene, mesh=MESH | {"fine": "3.6 mm", "coarse": "6 mm", "rim": rim}).values()
    (exact,) = solve(**scene, mesh=NO_SIZES | {"accuracy": "2 %"}, plan={"without": []}).values()
    assert exact.origin == "axisymmetric"
    error = abs(coarse.friction_force - exact.friction_force)
    assert error < 0.3 * exact.friction_force
    assert error < coarse.friction_force_error + exact.friction_force_error


def test_the_size_of_a_traction_is_its_integral():
    """An even one exactly, whatever the shares of nodes; nodal forces that alternate within facets cancel."""
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [2.0, 2.0, 0.0]])
    for degree in (2, 3):
        shape = facet_nodes(degree)
        nodes = np.concatenate([shape.corners @ corners[[0, 1, 2]], shape.corners @ corners[[1, 3, 2]]])
        points, facets = np.unique(nodes.round(9), axis=0, return_inverse=True)
        facets, none = facets.reshape(2, -1), np.zeros(2, dtype=np.int32)
        both = Candidates(np.arange(len(points)), points, facets, shape, points[:, 0] < 0, none, np.ones(2), none)
        even = both.weights[:, None] * np.array([0.6, 0.8, 0.0])
        assert both.size_of(even) == pytest.approx(4.0)
        assert both.size_of(even - 2 * even * (points[:, :1] > 1)) < 4.0
    assert both.size_of(np.zeros_like(even)) == 0.0


def test_friction_that_slides_is_the_law_times_the_force():
    """Without slope, the sizes of the tangential forces add up to µ F where all of the contact slides."""
    slides = record(0.02)
    assert slides.slip_area == pytest.approx(slides.contact_area)
    assert slides.friction_force == pytest.approx(0.02 * slides.force, rel=0.05)
    assert slides.torque == 0.0
    assert record("stick").friction_force > 0


def test_few_nodes_touch_and_have_friction():
    """The corner below the tip is inside the tool, which is no error at small displacements."""
    tool = {"shape": "cone", "angle": "86 deg", "radius": "4 mm", "depth": "0.02 mm", "mesh_depths": ["5 um", "0.2 mm"]}
    body = {"shape": "cylinder", "radius": "60 mm", "height": "60 mm"}
    mesh = {"fine": "20 mm", "coarse": "20 mm", "rim": "0.3 mm", "growth": 0.5}
    smooth, rough = (
        solve(MPI.COMM_SELF, body=body, probe=tool | {"friction": mu}, material={"poisson": 0.1}, mesh=mesh)[()]
        for mu in (0.0, 0.4)
    )
    assert smooth.force < rough.force < 1.1 * smooth.force


def test_a_rounded_edge_with_friction_settles():
    """Many nodes of its flat face stick and slide in turn before they settle."""
    tool = {"shape": "disc", "radius": "4 mm", "edge": "1 mm", "depth": "0.2 mm", "contact": "unilateral"}
    body = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}
    mesh = {"epsilon": "8 mm", "fine": "3 mm", "coarse": "8 mm", "rim": "0.3 mm", "growth": 0.8}
    smooth, rough = (record(mu, tool, mesh, body=body).force for mu in (0.0, 0.3))
    assert smooth < rough < 1.05 * smooth
