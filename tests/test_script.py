"""A problem on any dolfinx mesh, from a script: forces of a study's mesh, terms, ranks, and what is refused."""

from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from mpi4py import MPI

import epsmesh
from epsmesh.plan.plan import make_plan
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import problem_of, solve_problem
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.solve import SolveError
from epsmesh.solve.spaces import Spaces
from tests.cases import study

GROUPS, NAMES = {"tool": 1, "fixed": 2}, {"tool": PROBE, "fixed": FIXED}
BALL = {"shape": "sphere", "radius": "5 mm"}
BLUNT, DEPTH = {"shape": "sphere", "radius": "30 mm"}, 0.8e-3
LAW = {"young": 10e3, "poisson": 0.4, "law": "neo-hookean"}
TOOLS: dict[str, tuple[dict[str, Any], dict[str, Any] | None, float]] = {
    "bonded": ({}, None, 0.2e-3),
    "found": ({"probe": BALL | {"depth": "0.5 mm", "contact": "unilateral"}}, BALL, 0.5e-3),
}


def tags_of(mesh: Any, groups: dict[int, np.ndarray]) -> Any:
    facets = np.concatenate([*groups.values()]).astype(np.int32)
    values = np.concatenate([np.full(len(own), value) for value, own in groups.items()]).astype(np.int32)
    order = np.argsort(facets)
    return dolfinx.mesh.meshtags(mesh, 2, facets[order], values[order])


def box(comm: MPI.Comm = MPI.COMM_SELF) -> tuple[Any, Any]:
    """Return dolfinx's own mesh of a box of 40 × 40 × 20 mm, a tool's footprint of 24 × 24 mm, and its bottom."""
    ends = [np.array([-20e-3, -20e-3, -20e-3]), np.array([20e-3, 20e-3, 0.0])]
    mesh = dolfinx.mesh.create_box(comm, ends, [10, 10, 5])
    top, bottom, side = (
        dolfinx.mesh.locate_entities_boundary(mesh, 2, where)
        for where in (
            lambda x: (x[2] > -1e-9) & (np.abs(x[:2]).max(axis=0) < 12.1e-3),
            lambda x: x[2] < -20e-3 + 1e-9,
            lambda x: x[0] > 20e-3 - 1e-9,
        )
    )
    return mesh, tags_of(mesh, {1: top, 2: bottom, 3: side})


@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
@pytest.mark.parametrize("contact", TOOLS)
def test_the_force_is_that_of_a_study_on_the_same_mesh(contact, law):
    changes, tool, depth = TOOLS[contact]
    material = {"law": law, "poisson": 0.4}
    (planned,) = make_plan(study(material=material, mesh={"model": "3d"}, **changes)).solves
    case = planned.case
    body = mesh_case(case, (), MPI.COMM_SELF)
    with Spaces(body) as spaces, problem_of(spaces, case) as problem:
        known = solve_problem(case, problem, estimate=True)
    tags = tags_of(body.mesh, {value: body.facets[NAMES[name]] for name, value in GROUPS.items()})
    found = epsmesh.Problem(body.mesh, tags, GROUPS, LAW | {"law": law}, tool=tool).solve(depth)
    assert found.force == known.reaction[2]
    assert found.force_error == known.reaction_bars[2]
    assert found.balance < 1e-6
    assert np.isnan(found.area) == (tool is None)


@pytest.mark.parametrize("contact", TOOLS)
def test_a_term_is_a_function_of_the_displacement(contact):
    """Springs in place of the support: stiff ones are a fixed face; the displacement is a function of dolfinx."""
    tool = None if contact == "bonded" else BLUNT
    mesh, tags = box()
    below = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(2)
    fixed = epsmesh.Problem(mesh, tags, GROUPS, LAW, tool=tool).solve(DEPTH, estimate=False)

    def springs(stiffness: float) -> Any:
        def energy(u: Any) -> Any:
            return stiffness / 2 * ufl.inner(u, u) * below

        return epsmesh.Problem(mesh, tags, {"tool": 1}, LAW, tool=tool, terms=[energy]).solve(DEPTH, estimate=False)

    soft, stiff = springs(1e4), springs(1e9)
    assert soft.force < 0.6 * fixed.force
    assert stiff.force == pytest.approx(fixed.force, rel=1e-3)
    moved = dolfinx.fem.assemble_scalar(dolfinx.fem.form(soft.displacement[2] * below))
    assert soft.force == pytest.approx(-1e4 * moved, rel=1e-6)


def test_the_weak_form_is_stationary_at_the_solution():
    mesh, tags = box()
    problem = epsmesh.Problem(mesh, tags, GROUPS, LAW)
    found = problem.solve(0.2e-3, estimate=False)
    u = next(f for f in problem.form.coefficients() if f.ufl_shape == (3,))
    u.x.array[:] = found.displacement.x.array
    residual = dolfinx.fem.form(ufl.derivative(problem.form, u))
    forces = dolfinx.fem.assemble_vector(residual).array.reshape(-1, 3)
    footprint = dolfinx.fem.locate_dofs_topological(u.function_space, 2, tags.find(1))
    assert -forces[footprint, 2].sum() == pytest.approx(found.force, rel=1e-9)
    assert "tangent" in problem.options


@pytest.mark.mpi
@pytest.mark.parametrize("contact", TOOLS)
def test_ranks_agree(contact):
    tool, forces = None if contact == "bonded" else BLUNT, []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        mesh, tags = box(comm)
        side = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(2)
        terms = [lambda u, side=side: 1e6 * ufl.inner(u, u) * side]
        forces.append(epsmesh.Problem(mesh, tags, {"tool": 1}, LAW, tool=tool, terms=terms).solve(DEPTH).force)
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"groups": {"tool": 1}}, "a term must hold the body"),
        ({"groups": {"tool": 1, "fixed": 7}}, "no facet of the boundary has the tag 7"),
        ({"groups": {"probe": 1, "fixed": 2}}, "must be one of tool, fixed"),
        ({"law": {"young": 10e3, "poisson": 0.1, "law": "neo-hookean"}}, "0.2 to 0.5"),
        ({"law": {"young": 10e3, "poisson": 0.3, "law": "gent"}}, "has the parameters limit"),
        ({"degree": 1}, "must be 2 or 3"),
        ({"tool": {"shape": "ball"}}, "must be one of"),
        ({"tool": BALL, "at": (0.0, 0.0, -2e-3)}, "inside the body"),
        ({"tool": BALL, "at": (0.0, 0.0, 1e-3)}, "0.001 m above its facets"),
        ({"tool": BALL | {"motion": "all"}}, "motion is a key of studies"),
        ({"tool": BALL | {"radius": 5}}, "tool.radius = 5: must be a number with a unit as text"),
        ({"tool": BALL | {"radus": "5 mm"}}, "tool.radus"),
        ({"tool": {"shape": "disc", "radius": "6 mm"}}, "mark those below it"),
        ({"tool": {"shape": "disc", "radius": "20 mm"}}, "mark those below it"),
        ({"groups": GROUPS | {"mirror_x": 3}}, "must lie in the plane x = 0"),
    ],
)
def test_what_cannot_work_is_refused(changes, message):
    mesh, tags = box()
    given = {"groups": GROUPS, "law": LAW} | changes
    with pytest.raises(ValueError, match=message):
        epsmesh.Problem(mesh, tags, given.pop("groups"), given.pop("law"), **given)


@pytest.mark.parametrize("size", [1e3, 1e2])
def test_millimetres_are_refused(size):
    """Also of a body of a few millimetres."""
    mesh, tags = box()
    mesh.geometry.x[:] *= size
    with pytest.raises(ValueError, match="coordinates are metres"):
        epsmesh.Problem(mesh, tags, GROUPS, LAW)


def test_a_bonded_tool_that_reaches_the_support_is_refused():
    mesh, _ = box()
    top, side = (
        dolfinx.mesh.locate_entities_boundary(mesh, 2, where)
        for where in (lambda x: x[2] > -1e-9, lambda x: x[0] > 20e-3 - 1e-9)
    )
    with pytest.raises(ValueError, match=r"both have the node at .0\.02"):
        epsmesh.Problem(mesh, tags_of(mesh, {1: top, 2: side}), GROUPS, LAW)


@pytest.mark.parametrize("tool", [None, BLUNT])
def test_terms_that_do_not_hold_the_body_are_refused(tool):
    mesh, tags = box()
    below = ufl.Measure("ds", domain=mesh, subdomain_data=tags)(2)
    for energy in (lambda u: 1e3 * u[0] * below, lambda u: 1e6 * u[2] ** 2 * below):
        problem = epsmesh.Problem(mesh, tags, {"tool": 1}, LAW, tool=tool, terms=[energy])
        with pytest.raises(SolveError, match="nothing of the body is fixed, and the terms that act on it let it"):
            problem.solve(DEPTH)


def test_tags_of_another_dimension_are_refused():
    mesh, tags = box()
    for wrong in ({"facets": dolfinx.mesh.meshtags(mesh, 1, tags.indices, tags.values)}, {"cells": tags}):
        given = {"facets": tags, "law": LAW} | wrong | ({"law": {1: LAW}} if "cells" in wrong else {})
        with pytest.raises(ValueError, match="are tags of dimension"):
            epsmesh.Problem(mesh, given.pop("facets"), GROUPS, given.pop("law"), **given)
