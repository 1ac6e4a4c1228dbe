"""A tool that slides, at constant depth or along an inclined path: its drag is the coefficient times the force."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of
from epsmesh.run.tools import tool_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.contact.contact_steps import (
    ContactPath,
    ContactPathPoint,
    Friction,
    reach_contact,
    reach_contact_with_friction,
)
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.placed import placed_tool
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import solve, study

BODY = {"shape": "cylinder", "radius": "12 mm", "height": "8 mm"}
MESH = {"fine": "6 mm", "coarse": "6 mm", "rim": "0.6 mm", "growth": 0.7}
NEO_HOOKEAN = {"poisson": 0.45, "law": "neo-hookean"}
DEPTH, FRICTION = 0.2e-3, 0.3
BALL = {"shape": "sphere", "radius": "16 mm", "depth": "0.2 mm"}


def test_drag_at_constant_depth_is_the_law_times_the_force():
    """The tool presses, and then moves along x by three quarters of its depth, which is beyond the sticking range."""
    (case,) = study(body=BODY, probe=BALL | {"friction": FRICTION}, mesh=MESH, material=NEO_HOOKEAN).cases()
    with Spaces(mesh_case(case, ("y",), MPI.COMM_SELF)) as spaces, ExitStack() as stack:
        problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, case.way.element, tool=tool_of(case))
        body = DeformedBody(problem.elements, Surface(spaces), law_of(case), "direct", stack)
        tool, path = tool_of(case), ContactPath(ContactPathPoint(0.0, np.zeros_like(body.state)))
        friction = Friction.on(body, tool, DEPTH)
        reach_contact_with_friction(body, lambda depth: placed_tool(body, tool, depth), path, DEPTH, friction, 4)

        def beside(travel):
            shift = np.array([travel - DEPTH, 0.0, 0.0])
            return replace(placed_tool(body, tool, DEPTH), distance=lambda points: tool.distance(points - shift, DEPTH))

        along = replace(friction, advance=np.array([1.0, 0.0, 0.0]))
        drags = []
        for share in (0.05, 0.75):
            reach_contact(body, beside, path, (1 + share) * DEPTH, along)
            touched = path.last.touched
            across, _, up = -touched.forces.sum(axis=0)
            drags.append(-across / up)
    assert 0 < drags[0] < 0.8 * FRICTION
    assert touched.slide.sliding[touched.active].all()
    assert drags[-1] == pytest.approx(FRICTION, rel=0.005)


def test_drag_of_an_inclined_path_is_the_law_times_the_force():
    """An inclined axis is a path that presses and slides at once; little friction slides from the first touch on.

    The slope of the ball at the edge of contact, 0.23, and the mesh change the ratio by some per cent.
    """
    ball = {"shape": "sphere", "radius": "8 mm", "depth": "0.4 mm", "axis": [0.242, 0, -0.970], "at": ["0 mm", "0 mm"]}
    (found,) = solve(body=BODY, probe=ball | {"friction": 0.05}, mesh=MESH, material=NEO_HOOKEAN).values()
    assert found.status == "ok", found.message
    drag, _, force = found.force_vector
    assert found.slip_area == pytest.approx(found.contact_area)
    assert -drag == pytest.approx(0.05 * force, rel=0.04)
    assert found.friction_force == pytest.approx(0.05 * force, rel=0.04)


def test_friction_on_a_surface_that_gravity_has_bent():
    """Without friction it is the frictionless contact; with it, friction adds what it adds to the unloaded body.

    Tissue of this ν moves inwards below the tool, so friction adds per cents; gravity adds 0.8 %.
    """
    gravity = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
    heavy = NEO_HOOKEAN | {"young": "1 kPa", "poisson": 0.2, "density": "1060 kg/m^3"}

    def force(friction, **load):
        ball = {"shape": "sphere", "radius": "4 mm", "depth": "0.2 mm", "friction": friction}
        (found,) = solve(body=BODY, probe=ball, mesh=MESH | {"rim": "0.3 mm"}, material=heavy, **load).values()
        assert found.status == "ok", found.message
        return found.force

    smooth, unloaded = force(0.0, load=gravity), force(0.0)
    assert force(1e-9, load=gravity) == pytest.approx(smooth, rel=1e-6)
    added, wanted = force(0.3, load=gravity) / smooth - 1, force(0.3) / unloaded - 1
    assert added == pytest.approx(wanted, rel=0.02)
    assert added > 0.01
    assert smooth > 1.005 * unloaded
