"""Material laws: energies that are objective, linear at small strain, and known in uniform stretch and shear."""

from typing import get_args

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from epsmesh.plan.plan import make_plan
from epsmesh.run.meshing import mesh_case
from epsmesh.shapes import tissue
from epsmesh.solve.compiled import compiling, vector_space
from epsmesh.solve.forms import ElasticForms, HyperelasticForms
from epsmesh.solve.laws import LAWS
from epsmesh.solve.laws.law import Shape
from epsmesh.solve.physics import MaterialLaw
from epsmesh.study.schema import Material
from tests.cases import solve, study
from tests.sampling import sampled
from tests.verification.laws import FURTHER, YOUNG, Cube, Stress, rounding

LARGE = tuple(FURTHER)
SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4}
BOX = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}


def density(law, gradient, of=None, pressure=None):
    """Return the energy for a matrix F, by the value of its UFL expression."""
    of = {"lame_mu": 1.0, "lame_lambda": 2.0} | FURTHER.get(law, {}) | (of or {})
    return float(LAWS[law].density(ufl.as_matrix(np.asarray(gradient).tolist()), of, pressure).value)


def gradients(seed, size=0.25, count=5):
    found = np.eye(3) + size * np.random.default_rng(seed).standard_normal((count, 3, 3))
    return found[np.linalg.det(found) > 0.2]


def test_study_and_solver_name_the_same_laws_and_parameters():
    assert {*get_args(Material.model_fields["law"].annotation)} == {*LAWS} == {*tissue.LAWS} == {"linear", *LARGE}
    for name, law in LAWS.items():
        assert {*law.parameters} == {*FURTHER.get(name, {})}


@pytest.mark.parametrize("law", LARGE)
def test_an_energy_does_not_change_with_rotations(law):
    for number, gradient in enumerate(gradients(1)):
        turn = Rotation.random(random_state=number).as_matrix()
        known = density(law, gradient)
        assert density(law, turn @ gradient) == pytest.approx(known, rel=1e-11)
        if law != "holzapfel":  # isotropic
            assert density(law, gradient @ turn) == pytest.approx(known, rel=1e-11)


@pytest.mark.parametrize("law", LARGE)
def test_rest_is_the_least_energy(law):
    assert density(law, np.eye(3)) == pytest.approx(0.0, abs=1e-14)
    assert all(density(law, gradient) > 0 for gradient in gradients(2))


@pytest.mark.parametrize("law", LAWS)
def test_a_pressure_that_is_stationary_gives_the_same_energy(law):
    """With λ = λ₀ + λ₁ and p = λ₁ D, ψ(F, p) = ψ(F)."""
    rest = 1.25
    for gradient in gradients(3):
        pressure = rest * float(LAWS[law].dilation(Shape(ufl.as_matrix(gradient.tolist()))))
        split = density(law, gradient, {"lame_lambda": 2.0 - rest}, (pressure, 1 / rest))
        assert split == pytest.approx(density(law, gradient), rel=1e-12)


def forces(law, gradient):
    """Return the forces on a cube, compiled under the cache's lock: who holds it removes code that is not finished."""
    with compiling():
        return Cube(law).forces(gradient)


@pytest.mark.parametrize("law", LARGE)
@pytest.mark.parametrize("stretch", [0.7, 1.0, 1.4])
def test_uniaxial_stress_is_the_closed_form(law, stretch):
    lateral, nominal = Stress.of_law(law).uniaxial(stretch) if stretch != 1 else (1.0, 0.0)
    force, inside = forces(law, np.diag([lateral, lateral, stretch]))
    assert force == pytest.approx([0, 0, nominal], rel=rounding(law), abs=rounding(law) * YOUNG)
    assert inside < 1e-12 * YOUNG
    if law == "holzapfel":  # whose fibres are along z
        return
    wide, _ = forces(law, np.diag([stretch, lateral, lateral]))  # the same stress on other faces
    assert wide == pytest.approx([0, 0, 0], abs=rounding(law) * YOUNG)


@pytest.mark.parametrize("law", LARGE)
def test_simple_shear_is_the_closed_form(law):
    force, inside = forces(law, np.eye(3) + 0.6 * np.outer([1, 0, 0], [0, 0, 1]))
    assert force[0] == pytest.approx(Stress.of_law(law).shear(0.6), rel=rounding(law))
    assert inside < 1e-12 * YOUNG


@pytest.mark.parametrize("law", LARGE)
def test_inverted_tissue_has_no_finite_energy(law):
    assert np.isfinite(Cube(law).energy(np.diag([0.5, 1.2, 1.1])))
    assert not np.isfinite(Cube(law).energy(np.diag([-0.5, 1.2, 1.1])))


@sampled("law", LAWS, by_day=3)
def test_laws_are_linear_at_small_strains(law):
    """The tangent at zero displacement is the stiffness of linear elasticity."""
    (planned,) = make_plan(study()).solves
    body = mesh_case(planned.case, planned.mirrors, MPI.COMM_SELF, None)
    space = vector_space(body.mesh, 2)
    elastic = ElasticForms(space)
    forms = HyperelasticForms(space, elastic, (law,))
    elastic.set_law(MaterialLaw.of_moduli(10e3, 0.4, law, **FURTHER.get(law, {})))
    direction = np.random.default_rng(2).standard_normal(len(elastic.displacement.x.array))
    forms.directions[0].x.array[:] = direction
    found = fem.assemble_vector(forms.products[0]).array
    elastic.displacement.x.array[:] = direction
    known = fem.assemble_vector(elastic.action).array
    assert np.abs(found - known).max() < rounding(law) * np.abs(known).max()


def test_regions_with_laws_of_their_own_add_up():
    """The energy of a body is the sum over its regions, each with its law, and layers of one law are one body."""
    (planned,) = make_plan(study(body=BOX | {"layer": [SKIN]})).solves
    body = mesh_case(planned.case, planned.mirrors, MPI.COMM_SELF, None)
    space = vector_space(body.mesh, 2)
    deformation = np.diag([1.1, 0.95, 1.05])
    energies = []
    for laws in (("neo-hookean", "gent"), ("neo-hookean", "neo-hookean"), ("gent", "gent")):
        elastic = ElasticForms(space, body.regions)
        forms = HyperelasticForms(space, elastic, laws)
        elastic.set_law(
            MaterialLaw(tuple(MaterialLaw.of_moduli(10e3, 0.4, name, **FURTHER[name]).parameters[0] for name in laws))
        )
        elastic.displacement.interpolate(lambda x: (deformation - np.eye(3)) @ x)
        energies.append(fem.assemble_scalar(forms.energy))
    mixed, soft, stiff = energies
    assert mixed == pytest.approx(0.9 * soft + 0.1 * stiff, rel=1e-9)  # the layer is a tenth of the box
    assert soft != pytest.approx(stiff, rel=1e-4)


def test_a_layer_of_the_same_tissue_is_not_felt():
    """Within the meshes' error bars, for a law given by the layer, and for that of the material."""
    material = {"law": "yeoh", "c2": 0.4, "poisson": 0.3}
    same = {"young": "10 kPa", "poisson": 0.3}
    probe = {"depth": "0.4 mm"}
    (alone,) = solve(material=material, probe=probe).values()
    (inherits,) = solve(body=BOX | {"layer": [SKIN | same]}, material=material, probe=probe).values()
    own = SKIN | same | {"law": "yeoh", "c2": 0.4}
    (given,) = solve(body=BOX | {"layer": [own]}, material=material, probe=probe).values()
    assert given.force == pytest.approx(inherits.force, rel=1e-12)
    assert abs(alone.force - given.force) < max(alone.force_error, given.force_error) * alone.force
    assert given.status == "ok"


def test_layers_are_linear_at_small_depths():
    """For two laws in one body; F is proportional to the moduli of both."""
    layer = SKIN | {"law": "gent", "limit": 2.0}
    probe = {"depth": "0.005 mm"}
    (linear,) = solve(body=BOX | {"layer": [SKIN]}, probe=probe).values()
    (large,) = solve(body=BOX | {"layer": [layer]}, material={"law": "neo-hookean"}, probe=probe).values()
    assert large.force == pytest.approx(linear.force, rel=1e-3)


def test_terms_of_ogden_are_neo_hookean_and_mooney_rivlin():
    """Exponents 2 and −2 are I₁ and I₂; double roots, as in uniaxial stretch and at rest, are no exception."""
    of = {"share1": 0.7, "alpha1": 2.0, "share2": 0.3, "alpha2": -2.0, "share3": 0.0, "alpha3": 2.0}
    samples = [*gradients(4), np.diag([1.3, 1.3, 0.6]), np.diag([0.9, 0.9, 1.4]), np.diag([1.001, 1.001, 0.998])]
    for gradient in samples:
        known = density("mooney-rivlin", gradient, {"c2": 0.3})
        assert density("ogden", gradient, of) == pytest.approx(known, rel=1e-7)


def test_fibres_in_all_directions_are_isotropic():
    """With the dispersion 1/3 their direction has no effect, and without stiffness they are none."""
    for number, gradient in enumerate(gradients(5)):
        turn = Rotation.random(random_state=number).as_matrix()
        of = {"dispersion": 1 / 3}
        known = density("holzapfel", gradient, of)
        assert density("holzapfel", gradient @ turn, of) == pytest.approx(known, rel=1e-10)
        neo_hookean = density("yeoh", gradient, {"c2": 0.0, "c3": 0.0})
        assert density("holzapfel", gradient, {"k1": 0.0}) == pytest.approx(neo_hookean, rel=1e-12)


def test_fibres_bear_tension_alone():
    along = np.diag([0.9**-0.5, 0.9**-0.5, 0.9])
    neo_hookean = density("yeoh", along, {"c2": 0.0, "c3": 0.0})
    assert density("holzapfel", along, {"dispersion": 0.0}) == pytest.approx(neo_hookean, rel=1e-12)
    assert density("holzapfel", np.linalg.inv(along), {"dispersion": 0.0}) > 1.1 * neo_hookean


def test_force_on_fibres():
    """A quarter is the whole; with isotropic fibres, the direction has no effect; others stiffen."""
    probe = {"depth": "0.3 mm"}
    fibres = {"direction": [1, 0, 0], "k1": 0.5, "k2": 2.0}

    def found(mesh=None, **changes):
        material = {"law": "holzapfel", "fibres": fibres | changes}
        (record,) = solve(material=material, probe=probe, mesh=mesh or {}).values()
        assert record.status == "ok", record.message
        return record

    quarter, whole = found(), found({"model": "3d"})
    assert (quarter.origin, whole.origin) == ("symmetric", "solved")
    assert whole.force == pytest.approx(quarter.force, rel=1e-5)
    assert found(direction=[0, 2, 0]).force == pytest.approx(
        quarter.force, rel=2e-3
    )  # on another mesh of the square box
    (plain,) = solve(material={"law": "yeoh", "c2": 0.0}, probe=probe).values()
    assert found(k1=0.0).force == pytest.approx(plain.force, rel=1e-8)
    isotropic = [found(dispersion=1 / 3, direction=direction) for direction in ([1, 0, 0], [1, 2, 3])]
    assert isotropic[0].force == pytest.approx(isotropic[1].force, rel=1e-8)
    assert quarter.force > isotropic[0].force > plain.force
