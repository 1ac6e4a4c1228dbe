"""Terms of the energy besides that of the law: closed forms, limits, and that they combine with all the rest."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh.mesh.distribute import BodyMesh
from epsmesh.plan.plan import make_plan
from epsmesh.run.loads import loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.tools import tool_of
from epsmesh.scene.model import FIXED, FREE, PROBE
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import general_form
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.elements import elements_of
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.terms import EnergyTerm, Place
from tests.cases import study

LARGE = {"material": {"law": "neo-hookean", "poisson": 0.4}}
BALL = {"probe": {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}}
AREA, DEPTH = 40e-3**2, 0.2e-3


def springs(stiffness: float) -> EnergyTerm:
    """Return springs of a stiffness (N/m³) under the body."""

    def energy(at: Place) -> Any:
        return at.constant(stiffness) / 2 * ufl.inner(at.u, at.u) * at.ds

    return EnergyTerm(energy, ("springs", stiffness), lambda _, normals: normals[:, 2] < -0.9)


def fluid(pressure: float) -> EnergyTerm:
    """Return the pressure (Pa) of a fluid round the body, which follows the surface."""
    return EnergyTerm(lambda at: at.constant(pressure) * ufl.det(at.gradient) * at.dx, ("fluid", pressure))


def unfixed(mesh: BodyMesh) -> BodyMesh:
    """Return a mesh whose support is free."""
    facets = np.sort(np.concatenate([mesh.facets[FREE], mesh.facets[FIXED]]))
    return replace(mesh, facets=mesh.facets | {FREE: facets, FIXED: facets[:0]})


def solve(term: EnergyTerm | None, comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Solution:
    """Solve the base study with changes; with springs the body stands on them alone."""
    method, element, estimate = (changes.pop(key, None) for key in ("method", "element", "estimate"))
    (planned,) = make_plan(study(**changes)).solves
    case, terms = planned.case, () if term is None else (term,)
    mesh = mesh_case(case, planned.mirrors, comm, None)
    if term is not None and term.key[0] == "springs":
        mesh = unfixed(mesh)
    is_found = case.probe.is_unilateral
    conditions, tool = Conditions(bonded=not is_found, unilateral=is_found, terms=terms), tool_of(case)
    with Spaces(mesh) as spaces:
        how = {"element": element or "displacement", "tool": tool if is_found else None}
        with QuasiStaticProblem(spaces, case.mesh.degree, conditions, **how) as problem:
            asked = {"method": method or "iterative", "estimate": bool(estimate)}
            return problem.solve(law_of(case), movement_of(case), **asked)


def force(term: EnergyTerm | None, **changes: Any) -> float:
    return solve(term, **changes).reaction[2]


@pytest.mark.parametrize("law", [{}, LARGE], ids=["linear", "neo-Hookean"])
def test_a_body_on_soft_springs_is_rigid(law):
    stiffness = 0.1
    assert force(springs(stiffness), **law) == pytest.approx(stiffness * AREA * DEPTH, rel=3e-6)


@pytest.mark.parametrize("element", ["displacement", "mixed"])
@pytest.mark.parametrize("method", [pytest.param("iterative", marks=pytest.mark.nightly), "direct"])
@pytest.mark.parametrize("contact", [{}, BALL], ids=["bonded", "found"])
def test_stiff_springs_are_a_support(contact, method, element):
    """The difference from a fixed face falls as their compliance; the solver needs no more iterations."""
    how = {**LARGE, **contact, "method": method, "element": element}
    fixed, stiff, stiffer = (solve(term, **how) for term in (None, springs(1e8), springs(1e9)))
    rest, less = (fixed.reaction[2] - other.reaction[2] for other in (stiff, stiffer))
    assert 0 < rest < 2e-3 * fixed.reaction[2]
    assert less == pytest.approx(rest / 10, rel=0.06)
    assert stiffer.iterations <= fixed.iterations + 4


def test_linear_tissue_on_springs_is_the_limit_of_small_depths():
    at = {"probe": BALL["probe"] | {"depth": "0.02 mm"}, "mesh": {"rim": "0.2 mm"}}
    soft = {"material": {"poisson": 0.4}}
    term = springs(1e5)
    assert force(term, **soft, **at) == pytest.approx(force(term, **LARGE, **at), rel=5e-3)


def test_a_loaded_column_moves_as_a_whole_on_springs():
    """With λ = 0 a column in tension does not narrow: it is displaced by the tension over the springs' stiffness."""
    young, stiffness, tension = 10e3, 1e6, 2e3
    pull = {"traction": [{"on": "top", "traction": ["0 Pa", "0 Pa", f"{tension} Pa"]}]}
    case = study(**LARGE, load=pull, probe={"at": ["20 mm", "0 mm", "-10 mm"]}, mesh={"degree": 1}).case(())
    turn = np.eye(3) if case.frame.turn is None else case.frame.turn
    down = turn @ np.array([0.0, 0.0, -1.0])

    def energy(at: Place) -> Any:
        return stiffness / 2 * ufl.inner(at.u, at.u) * at.ds

    term = EnergyTerm(energy, on_facets=lambda _, normals: normals @ down > 0.9)
    conditions = Conditions(terms=(term,)).without_footprint
    with Spaces(unfixed(mesh_case(case, (), MPI.COMM_SELF))) as spaces:
        elements = elements_of(spaces, 2, conditions)
        sag(elements, MaterialLaw.of_moduli(young, 0.0, "neo-hookean"), loads_of(case))
        places, moved = (v.reshape(-1, 3) @ turn for v in (elements.displacements.places, elements.values))
    half = tension / young
    stretch = half + np.sqrt(half**2 + 1)
    exact = tension / stiffness + (stretch - 1) * (places[:, 2] - places[:, 2].min())
    assert moved[:, 2] == pytest.approx(exact, abs=1e-8)
    assert np.abs(moved[:, :2]).max() < 1e-8


def test_small_pressure_of_a_fluid_is_a_dead_load():
    """It acts before the tool does; where the displacement grows it follows the surface."""
    moved = []
    for term, pressure in ((None, 2.0), (fluid(2.0), 0.0)):
        load = {"traction": [{"on": "free", "pressure": f"{pressure} Pa"}]}
        case = study(**LARGE, load=load).case(())
        mesh = mesh_case(case, (), MPI.COMM_SELF)
        facets = np.sort(np.concatenate([mesh.facets[FREE], mesh.facets[PROBE]]))
        mesh = replace(mesh, facets=mesh.facets | {FREE: facets, PROBE: facets[:0]})
        conditions = Conditions(terms=() if term is None else (term,)).without_footprint
        with Spaces(mesh) as spaces:
            elements = elements_of(spaces, 2, conditions)
            sag(elements, law_of(case), loads_of(case))
            moved.append(elements.values)
    assert np.linalg.norm(moved[0] - moved[1]) < 1e-3 * np.linalg.norm(moved[0])


@pytest.mark.parametrize(("contact", "rest"), [({}, 0.05), (BALL, 0.3)], ids=["bonded", "found"])
def test_a_term_that_acts_before_the_tool_is_sagged_under(contact, rest):
    """What it does at the tool's first touch is no part of F. Nodes come into contact one by one."""
    one, two, alone = (force(term, **LARGE, **contact) for term in (fluid(20.0), fluid(40.0), None))
    assert two - alone == pytest.approx(2 * (one - alone), rel=rest)
    assert abs(one / alone - 1) < 0.01


def test_linear_tissue_has_the_same_first_touch_with_a_term_of_no_effect():
    """Sideways gravity moves a sloping surface across the axis, which changes no gap of a linear law."""
    sideways = {"load": {"gravity": ["9.81 m/s^2", "0 m/s^2", "0 m/s^2"]}}
    soft = {"material": {"young": "3 kPa", "density": "1000 kg/m^3"}, "probe": BALL["probe"] | {"at": ["9 mm", "0 mm"]}}
    alone, beside = (solve(term, **soft, **sideways) for term in (None, fluid(0.0)))
    assert beside.reaction[2] == pytest.approx(alone.reaction[2], rel=1e-6)
    assert beside.contact.sag == pytest.approx(alone.contact.sag, rel=1e-6)


def test_a_body_that_leans_on_its_springs_has_the_force_of_one_that_stands():
    """Sideways gravity moves the surface by 1.5 mm and tilts it by 0.03: the first touch of the ball is 2 μm higher."""
    lean = {
        "material": {"poisson": 0.4, "density": "1000 kg/m^3"},
        "load": {"gravity": ["9.81 m/s^2", "0 m/s^2", "0 m/s^2"]},
    }
    upright, leaning = (solve(springs(5e5), **BALL, **more) for more in ({"material": {"poisson": 0.4}}, lean))
    assert leaning.reaction[2] == pytest.approx(upright.reaction[2], rel=0.01)
    assert -4e-6 < leaning.contact.sag < 0


def test_bars_cover_a_finer_mesh():
    term, finer = springs(1e5), {"mesh": {"fine": "3 mm", "rim": "0.5 mm"}}
    found = solve(term, estimate=True, **LARGE)
    exact = solve(term, estimate=True, **LARGE, **finer)
    assert abs(exact.reaction[2] / found.reaction[2] - 1) < found.bar
    assert exact.bar < found.bar


def test_symmetric_halves_are_the_whole():
    term = springs(1e5)
    assert force(term, **LARGE) == pytest.approx(force(term, **LARGE, mesh={"model": "3d"}), rel=1e-8)


@pytest.mark.parametrize("model", ["auto", "3d"])
def test_planes_of_symmetry_hold_no_body(model):
    """On rollers the whole body is free to move along its face, and so is a quarter of it."""

    def energy(at: Place) -> Any:
        return at.constant(1e5) / 2 * ufl.dot(at.u, at.normal) ** 2 * at.ds

    rollers = EnergyTerm(energy, ("springs", "rollers"), lambda _, normals: normals[:, 2] < -0.9)
    with pytest.raises(SolveError, match=r"let it (move along|turn about z).*fix a face"):
        solve(rollers, **BALL, mesh={"model": model})


@pytest.mark.mpi
@pytest.mark.parametrize("comm", [MPI.COMM_SELF, MPI.COMM_WORLD], ids=["alone", "together"])
def test_a_cap_has_its_area_on_facets_of_half_its_radius(comm):
    case = study(mesh={"degree": 1, "coarse": "6 mm", "fine": "6 mm"}).case(())
    body = mesh_case(case, (), comm, None)
    with Spaces(body) as spaces:
        u = spaces.get(2, Conditions()).forms.displacement
        for place, radius in ((-9e-3, 2.5e-3), (-11e-3, 4e-3)):
            at = Place(
                body, u, lambda corners, _: corners[:, :, 0].min(axis=1) > 19.9e-3, ((20e-3, 1e-3, place), radius)
            )
            area = comm.allreduce(fem.assemble_scalar(general_form(at.constant(1.0) * at.ds)))
            assert area == pytest.approx(np.pi * radius**2, rel=5e-4)


@pytest.mark.mpi
@pytest.mark.parametrize("contact", [{}, BALL], ids=["bonded", "found"])
@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_ranks_agree(contact, element):
    how = {**LARGE, **contact, "element": element}
    together, alone = (solve(springs(1e5), comm, **how).reaction[2] for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together == pytest.approx(alone, rel=1e-8)
