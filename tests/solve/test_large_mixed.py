"""Large displacements of nearly and fully incompressible bodies, with mixed elements."""

from math import inf

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.plan.plan import make_plan
from epsmesh.run.meshing import mesh_case
from epsmesh.scene.model import FIXED
from epsmesh.solve import load_steps
from epsmesh.solve.compiled import form
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements.mixed import MixedElements
from epsmesh.solve.laws import LAWS
from epsmesh.solve.measures import dx
from epsmesh.solve.movement import Movement
from epsmesh.solve.path import follow
from epsmesh.solve.physics import MaterialLaw, SplitLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import force, solve, study
from tests.sampling import sampled
from tests.verification.laws import FURTHER, rounding

MIXED = {"element": "mixed"}


def soft(poisson: float) -> dict[str, object]:
    return {"law": "neo-hookean", "poisson": poisson}


def make_mesh(comm: MPI.Comm = MPI.COMM_SELF, **changes: object) -> BodyMesh:
    (planned,) = make_plan(study(**changes)).solves
    return mesh_case(planned.case, planned.mirrors, comm, None)


@pytest.mark.parametrize("poisson", [0.49, 0.5])
def test_uniform_stretch(poisson):
    """Uniaxial stretch with free sides is an equilibrium of u and p, with the stress of the closed form."""
    stretch, law = 0.7, MaterialLaw.of_moduli(10e3, poisson, "neo-hookean")
    (lame_lambda,), (mu,) = law.lame_lambda, law.lame_mu
    # Free sides: μ (b - 1/b) + p J/b = 0 with J = b² stretch and p = λ (J - 1), by Newton's method on b.
    b = stretch**-0.5
    for _ in range(50 if lame_lambda < inf else 0):
        volume = b * b * stretch
        wrong = mu * (b - 1 / b) + lame_lambda * (volume - 1) * b * stretch
        b -= wrong / (mu * (1 + 1 / b**2) + lame_lambda * stretch * (volume - 1 + 2 * volume))
    volume = b * b * stretch
    pressure = -mu * (b - 1 / b) * b / volume
    stress = mu * (stretch - 1 / stretch) + pressure * b**2
    elements = MixedElements(Spaces(make_mesh()), 2, Conditions(bonded=True))
    forms = elements.large_forms(law)
    elements.set_law(law)
    unit = elements.unit(law)
    elements.displacements.forms.displacement.interpolate(
        lambda x: np.array([(b - 1) * x[0], (b - 1) * x[1], (stretch - 1) * x[2]])
    )
    of_lambda_1 = pressure - mu * (volume - 1)  # λ₀ is μ
    elements.pressures.forms.pressure.x.array[:] = of_lambda_1 / unit
    forces, volumes = (np.array(fem.assemble_vector(residual).array) for residual in forms.residuals)
    space = elements.displacements.space
    nodal, points = unit * forces.reshape(-1, 3), space.tabulate_dof_coordinates()
    bottom = fem.locate_dofs_topological(space, 2, elements.body.facets[FIXED])
    expected = -stress * 20e-3**2
    assert nodal[bottom, 2].sum() == pytest.approx(expected, rel=1e-9)
    inner = (points[:, 2] < -1e-6) & (points[:, 2] > -20e-3 + 1e-6)
    assert np.abs(nodal[inner, 2]).max() < 1e-10 * abs(expected)
    assert np.abs(volumes).max() < 1e-10 * 20e-3**3
    elements.close()


@sampled("law", LAWS, by_day=2)
def test_laws_are_linear_at_small_strains(law):
    """At rest the blocks of the tangent are those of linear elasticity."""
    material = MaterialLaw.of_moduli(10e3, 0.49, law, **FURTHER.get(law, {}))
    elements = MixedElements(Spaces(make_mesh()), 2, Conditions(bonded=True))
    forms = elements.large_forms(material)
    elements.set_law(material)
    fields = elements.displacements.forms.displacement, elements.pressures.forms.pressure
    random = np.random.default_rng(4)
    for direction in forms.directions:
        direction.x.array[:] = random.standard_normal(len(direction.x.array))
    found = [np.array(fem.assemble_vector(product).array) for product in forms.products]
    for field, direction in zip(fields, forms.directions, strict=True):
        field.x.array[:] = direction.x.array
    of, compliance = elements.pressures.forms, SplitLaw.of(material).compliance[0]
    linear = (elements.displacements.forms.action, of.pull), (of.dilation,)
    known = [sum(np.array(fem.assemble_vector(form).array) for form in row) for row in linear]
    mass = compat.assemble_matrix(of.mass, [], 1.0)
    weighed = mass * of.pressure.vector if hasattr(of.pressure, "vector") else mass * of.pressure.x.petsc_vec
    known[1] -= compliance * weighed.array
    for one, other in zip(found, known, strict=True):
        assert np.abs(one - other).max() < rounding(law) * np.abs(other).max()
    elements.close()


@pytest.mark.parametrize("poisson", [pytest.param(0.45, marks=pytest.mark.nightly), 0.5])
def test_small_depths_are_linear(poisson):
    """F tends to that of linear mixed elements on the same mesh, linearly in the depth."""
    ratios = []
    for depth in (0.003, 0.006):
        linear, large = (
            force(material={"law": law, "poisson": poisson}, probe={"depth": f"{depth} mm"}, mesh=MIXED)
            for law in ("linear", "neo-hookean")
        )
        ratios.append(large / linear - 1)
    assert abs(ratios[0]) < 2e-4
    assert ratios[1] / ratios[0] == pytest.approx(2.0, rel=0.05)


def test_agrees_with_displacement_elements():
    """Where both elements are allowed, forces agree within their error bars, at every ν they share."""
    for poisson in (0.4, 0.45):
        mixed, displacement = (
            next(iter(solve(material=soft(poisson), probe={"depth": "0.6 mm"}, mesh={"element": each}).values()))
            for each in ("mixed", "displacement")
        )
        assert mixed.status == displacement.status == "ok"
        apart = abs(mixed.force - displacement.force)
        assert apart <= mixed.force_error * mixed.force + displacement.force_error * displacement.force
        assert apart < 0.03 * mixed.force


@pytest.mark.parametrize("poisson", [pytest.param(0.2, marks=pytest.mark.nightly), 0.4])
def test_layers_agree_with_displacement_elements(poisson):
    """Each region has a split of its own, and pressures jump between regions."""
    layers = {"layer": [{"name": "skin", "thickness": "3 mm", "young": "40 kPa", "poisson": poisson}]}
    mixed, displacement = (
        next(iter(solve(body=layers, material=soft(0.45), probe={"depth": "0.6 mm"}, mesh={"element": each}).values()))
        for each in ("mixed", "displacement")
    )
    assert mixed.status == displacement.status == "ok"
    apart = abs(mixed.force - displacement.force)
    assert apart <= displacement.force_error * displacement.force
    assert apart < 0.015 * mixed.force


def test_the_limit_of_incompressible_tissue():
    """F at ν → ½ tends to that at ½, linearly in 1 - 2ν."""
    forces = [force(material=soft(poisson), probe={"depth": "0.6 mm"}) for poisson in (0.49998, 0.49999, 0.5)]
    assert forces[0] == pytest.approx(forces[2], rel=1e-3)
    assert (forces[0] - forces[2]) / (forces[1] - forces[2]) == pytest.approx(2.0, rel=0.02)


def test_incompressible_tissue_keeps_its_volume():
    law = MaterialLaw.of_moduli(10e3, 0.5, "neo-hookean")
    body = make_mesh()
    with QuasiStaticProblem(Spaces(body), 2, Conditions(bonded=True), "mixed") as problem:
        solution = problem.solve(law, Movement.along((0.0, 0.0, -0.6e-3)))
        forms = problem.elements.large_forms(law)
        displacement = problem.elements.displacements.forms.displacement
        problem.elements.set_law(law)
        lost = [np.array(fem.assemble_vector(residual).array) for residual in forms.residuals][1]
        divergence = ufl.div(displacement) * dx(displacement.function_space, more=2)
        small = fem.assemble_scalar(form(divergence))
    volume = 20e-3**3
    assert solution.reaction[2] > 0
    assert abs(lost.sum()) < 1e-10 * volume
    assert abs(small) > 1e-6 * volume  # small strains would not keep it


def test_quarter_is_the_whole_and_force_goes_with_the_modulus():
    probe = {"depth": "0.3 mm"}
    (whole,) = solve(material=soft(0.5), probe=probe, mesh={"model": "3d"}).values()
    quarter, stiff = solve(material=soft(0.5) | {"young": ["10 kPa", "30 kPa"]}, probe=probe).values()
    assert (quarter.origin, whole.origin, stiff.origin) == ("symmetric", "solved", "scaled")
    assert whole.force == pytest.approx(quarter.force, rel=1e-6)
    assert whole.energy == pytest.approx(quarter.energy, rel=1e-6)
    assert whole.force_error == pytest.approx(quarter.force_error, rel=0.1)
    assert stiff.force == pytest.approx(3 * quarter.force, rel=1e-12)


def test_direct_and_iterative_solvers_agree():
    mesh = {"fine": "8 mm", "rim": "3 mm"}
    direct, iterative = (
        force(material=soft(0.49), mesh=mesh, solve={"method": method}) for method in ("direct", "iterative")
    )
    assert direct == pytest.approx(iterative, rel=1e-7)


def test_depths_of_a_sweep_share_one_load_path(monkeypatch):
    ends: list[float] = []

    def counted(path, *arguments, **steps):
        ends.append(path.reached)
        follow(path, *arguments, **steps)

    monkeypatch.setattr(load_steps, "follow", counted)
    second, first = solve(material=soft(0.5), probe={"depth": ["0.8 mm", "0.4 mm"]}).values()
    assert ends == [0.0, 0.4e-3]
    for record, depth in ((first, 0.4), (second, 0.8)):
        (alone,) = solve(material=soft(0.5), probe={"depth": f"{depth} mm"}).values()
        assert record.force == pytest.approx(alone.force, rel=1e-7)
        assert record.force_error == pytest.approx(alone.force_error, rel=2e-2)


@pytest.mark.usefixtures("folding")
def test_a_depth_that_is_not_reached_is_partial_and_says_where():
    (record,) = solve(material=soft(0.5), probe={"depth": "9 mm"}).values()
    assert record.status == "partial"
    assert np.isnan(record.force)
    assert 0 < record.depth_reached < 9e-3
    assert f"reached {record.depth_reached * 1e3:.3g} mm of 9 mm" in record.message


def test_ranks_agree():
    """Run on several ranks, too: F is that of one rank."""
    law, movement = MaterialLaw.of_moduli(10e3, 0.5, "neo-hookean"), Movement.along((0.0, 0.0, -0.6e-3))
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        with QuasiStaticProblem(Spaces(make_mesh(comm)), 2, Conditions(bonded=True), "mixed") as problem:
            found.append(problem.solve(law, movement, estimate=True))
    one, several = found
    assert several.reaction[2] == pytest.approx(one.reaction[2], rel=1e-7)
    assert several.bar == pytest.approx(one.bar, rel=0.02)
