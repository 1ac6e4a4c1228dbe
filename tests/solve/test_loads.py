"""Mechanics of weights and tractions: closed forms, superposition, symmetry, and the stored energy."""

from math import pi

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.run.loads import loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.solve.compiled import global_sum, vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.loads import apply_loads
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import load_bars
from epsmesh.solve.spaces import ElasticSpace, Spaces
from tests.cases import solve, study

YOUNG, HEIGHT = 10e3, 20e-3
WEIGHT = 1060 * 9.81  # N/m³
HEAVY = {"young": "10 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}
GRAVITY = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
CAP = {"around": ["9 mm", "0 mm", "0 mm"], "radius": "3 mm"}
PULL = {"on": CAP, "traction": ["1 kPa", "0 Pa", "200 Pa"]}
SIDES = {"on": "sides", "pressure": "100 Pa"}


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """Return a quarter of the box in straight cells, for which polynomials are exact."""
    mesh = mesh_case(study(mesh={"degree": 1}).case(()), ("x", "y"), MPI.COMM_SELF)
    return mesh


def own_weight(x: FloatArray) -> FloatArray:
    """Displacement (m) of a column of ν = 0 fixed at z = -H, under its own weight."""
    above = x[2] + HEIGHT
    return np.vstack([0 * above, 0 * above, -WEIGHT / YOUNG * (HEIGHT * above - above**2 / 2)])


def squeezed(x: FloatArray) -> FloatArray:
    """Displacement (m) under a pressure of 100 Pa on the four sides, ν = 0."""
    return np.asarray(-100.0 / YOUNG * x * np.array([[1.0], [1.0], [0.0]]))


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize(
    ("load", "exact"), [(GRAVITY, own_weight), ({"traction": [SIDES]}, squeezed)], ids=["weight", "tension"]
)
def test_closed_forms_leave_no_residual(body, degree, load, exact):
    loads = loads_of(study(material=HEAVY, load=load).case(()))
    with Spaces(body) as spaces:
        space: ElasticSpace = spaces.get(degree, Conditions(unilateral=True))
        space.forms.displacement.interpolate(exact)
        applied = apply_loads(loads, body, space.space)
        with vector(space.space) as residual:
            space.apply(residual, MaterialLaw.of_moduli(YOUNG, 0.0))
            left = residual.array - applied.forces
    left[space.prescribed_owned] = 0.0
    assert np.abs(left).max() < 1e-9 * applied.size


def test_resultants_are_those_of_the_loads(body):
    load = {**GRAVITY, "traction": [{"on": "sides", "traction": ["100 Pa", "0 Pa", "0 Pa"]}, PULL]}
    found = []
    for kept in (GRAVITY, {"traction": load["traction"][:1]}, {"traction": load["traction"][1:]}):
        with Spaces(body) as spaces:
            space = spaces.get(2, Conditions()).space
            found.append(apply_loads(loads_of(study(material=HEAVY, load=kept).case(())), body, space).resultant)
    # A quarter of the box contains half of the cap.
    assert found[0] == pytest.approx([0, 0, -WEIGHT * 20e-3**3], abs=1e-12)
    assert found[1] == pytest.approx([100 * 2 * 20e-3 * 20e-3, 0, 0], abs=1e-12)
    assert found[2] == pytest.approx(np.array([1000, 0, 200]) * pi / 2 * 3e-3**2, rel=5e-4)


def test_each_layer_has_its_own_weight():
    skin = {"name": "skin", "thickness": "5 mm", "young": "10 kPa", "poisson": 0.3, "density": "2120 kg/m^3"}
    case = study(body={"layer": [skin]}, material=HEAVY, load=GRAVITY, mesh={"degree": 1}).case(())
    layered = mesh_case(case, ("x", "y"), MPI.COMM_SELF)
    with Spaces(layered) as spaces:
        applied = apply_loads(loads_of(case), layered, spaces.get(1, Conditions()).space)
    assert applied.resultant == pytest.approx([0, 0, -WEIGHT * (2 * 5e-3 + 15e-3) * 20e-3**2], abs=1e-12)


@pytest.fixture(scope="module")
def pulled():
    (record,) = solve(load={"traction": [PULL]}).values()
    return record


def test_loads_add_up_and_leave_the_force_of_the_depth(pulled):
    (plain,), (squeezed_,), (both,) = (
        solve(load=load).values() for load in ({}, {"traction": [SIDES]}, {"traction": [PULL, SIDES]})
    )
    assert np.isnan(plain.load_force)
    assert both.force == pytest.approx(plain.force, rel=1e-8)
    parts = np.array([pulled.load_force_vector, squeezed_.load_force_vector])
    assert both.load_force_vector == pytest.approx(parts.sum(axis=0), abs=1e-6 * pulled.load_force_vector[0])
    assert both.load_force == both.load_force_vector[2]


@pytest.mark.mpi
def test_nodal_forces_include_those_from_other_ranks():
    """Shape functions sum up to 1: so nodal forces sum up to the resultant, wherever dofs are owned."""
    load = {**GRAVITY, "traction": [PULL]}
    body = mesh_case(study(mesh={"degree": 1}).case(()), ("x", "y"), MPI.COMM_WORLD)
    with Spaces(body) as spaces:
        space = spaces.get(2, Conditions()).space
        applied = apply_loads(loads_of(study(material=HEAVY, load=load).case(())), body, space)
    whole = global_sum(body.comm, applied.forces.reshape(-1, 3).sum(axis=0))
    assert whole == pytest.approx(applied.resultant, rel=1e-9)


def test_loads_grow_apart_from_depth_and_modulus(pulled):
    """The loads' force on a fixed probe depends on neither; the sag of a free probe decreases with E."""
    (other,) = solve(
        load={"traction": [PULL]}, material={"young": "20 kPa"}, probe={"depth": "0.4 mm"}
    ).values()  # fmt: skip
    assert other.force == pytest.approx(4 * pulled.force, rel=1e-6)
    assert other.load_force == pytest.approx(pulled.load_force, rel=1e-5)
    assert other.load_energy == pytest.approx(pulled.load_energy / 2, rel=1e-5)
    assert other.sag == pytest.approx(pulled.sag / 2, rel=1e-5)
    # At a depth equal to the sag the force is zero.
    assert pulled.force * pulled.sag / pulled.depth + pulled.load_force == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("contact", ["bonded", "frictionless"])
def test_pressure_on_incompressible_tissue_is_borne_by_the_probe(contact):
    """With fixed sides and pressure on the rest of the top, pressure is uniform, and nothing moves."""
    (record,) = solve(
        body={"fixed": "bottom+sides"}, material={"poisson": 0.5}, probe={"contact": contact},
        load={"traction": [{"on": "free", "pressure": "100 Pa"}]},
    ).values()  # fmt: skip
    assert record.load_force == pytest.approx(100 * pi * 3e-3**2, rel=1e-4)
    assert record.load_energy == pytest.approx(0, abs=1e-9 * record.energy)


def test_on_a_tilted_probe_loads_are_in_the_coordinates_of_the_body():
    """Under the side of an ellipsoid, tissue pushes the probe out along the normal."""
    (record,) = solve(
        body={"shape": "ellipsoid", "axes": ["20 mm", "18 mm", "15 mm"], "fixed": {"below": "-4 mm"}},
        material={"young": "10 kPa", "poisson": 0.5}, probe={"at": ["8 mm", "5 mm", "11 mm"]},
        mesh={"rim": "1.5 mm"}, load={"traction": [{"on": "surface", "pressure": "100 Pa"}]},
    ).values()  # fmt: skip
    size = np.linalg.norm(record.load_force_vector)
    assert size == pytest.approx(100 * pi * 3e-3**2, rel=1e-3)
    assert record.load_force == pytest.approx(size, rel=1e-3)
    assert min(record.load_force_vector) > 0


def test_the_bar_holds(pulled):
    (finer,) = solve(load={"traction": [PULL]}, mesh={"degree": 3}).values()
    assert abs(pulled.load_force - finer.load_force) < pulled.load_force_error
    assert finer.load_force_error < pulled.load_force_error / 2


@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_the_bar_is_narrower_if_errors_are_at_different_places(element):
    """It is the geometric mean of both bars if both have the same error, a fraction of it otherwise, and never zero."""
    root, bars = 6.0, np.array([[4.0, 6.0], [6.0, 9.0]])
    alike, apart, none = (np.array([[1.0, s], [s, 4.0]]) for s in (2.0, 0.2, 0.0))
    found = [load_bars(bars, decrements, element)[0, 1] for decrements in (alike, apart, none)]
    assert found[0] == root and root > 2 * found[1] and found[1] > found[2] > 0.1 * root
    still = load_bars(bars, np.diag([1.0, 0.0]), element)  # loads that do no work
    assert np.array_equal(still, still.T) and still[0, 1] == root and np.array_equal(np.diag(still), np.diag(bars))


@pytest.mark.parametrize("rim", ["0.5 mm", "2 mm"])
def test_the_load_force_of_a_body_under_one_pressure_all_around_is_that_on_the_footprint(rim):
    """Incompressible tissue has no strain then: elements are exact, but for the curved edge of the disc."""
    pressures = [{"on": face, "pressure": "100 Pa"} for face in ("top", "sides")]
    body = {"shape": "cylinder", "size": None, "radius": "20 mm", "height": "20 mm"}
    (found,) = solve(
        body=body,
        material={"poisson": 0.5},
        probe={"contact": "bonded"},
        mesh={"rim": rim},
        load={"traction": pressures},
    ).values()
    exact = 100 * pi * 3e-3**2
    assert 1e-7 * exact < abs(found.load_force - exact) < found.load_force_error < 0.005 * exact
