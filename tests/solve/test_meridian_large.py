"""Large displacements on the meridian: small depths, another code's forces, layers, and where load steps end."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading, Meridian
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.solve.compiled import compiling
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.laws import LAWS
from epsmesh.solve.meridian.large import DEGREE, LargeMeridian, LargeSystem
from epsmesh.solve.meridian.problem import MeridianProblem, compile_axisymmetric
from epsmesh.solve.meridian.system import meshes_of
from epsmesh.solve.movement import Movement
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw, Parameters
from tests.cases import study
from tests.sampling import sampled
from tests.verification.laws import FURTHER

BODY, BONDED = Meridian(20 / 3, 20 / 3, 1.0), Conditions(bonded=True)


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    with compiling():
        compile_axisymmetric()
        compile_axisymmetric(DEGREE, laws=("neo-hookean", "yeoh"))
        compile_axisymmetric(DEGREE, laws=("neo-hookean",), curved=True)


def pressed(law, depth, body=BODY, **how):
    return LargeMeridian(body, BONDED, **how).solve(law, Movement.along((0.0, 0.0, -depth)))


def linear(poisson, body=BODY):
    return MeridianProblem(body, BONDED).solve(MaterialLaw.of_moduli(1.0, poisson), Movement.along((0.0, 0.0, -1.0)))


@sampled("law", sorted({*LAWS} - {"linear", "holzapfel"}), by_day=1)
def test_the_tangent_at_rest_is_linear_elasticity(law):
    meshes = meshes_of(BODY.mesh(Grading(0.3)))
    shape = {name: 0.0 if name.startswith("share") else 2.0 for name in LAWS[law].parameters}
    further = FURTHER.get(law, shape | {"share1": 1.0})
    with compiling():
        large, known = (
            LargeSystem(meshes, 2, MaterialLaw.of_moduli(1.0, 0.3, name, **more), bonded=True)
            for name, more in ((law, further), ("linear", {}))
        )
    assert _stiffness(large) == pytest.approx(_stiffness(known), rel=1e-6)


def _stiffness(system):
    """Return F per unit of depth of the linearised system."""
    rows, unknown = system.forms.stiffness(), np.setdiff1d(system.free, system.probe)
    moved = np.zeros(system.forms.dofs)
    moved[system.probe] = -1.0
    with system.inverse(rows[unknown][:, unknown], is_definite=False) as solve:
        moved[unknown] = -solve((rows @ moved)[unknown])
    return float(moved @ (rows @ moved))


@sampled("poisson, depth, ratio", [(0.3, 0.1, 0.988), (0.49, 0.2, 0.985), (0.5, 0.2, 0.9857)], by_day=1)
def test_force_is_that_of_other_elements(poisson, depth, ratio):
    """F over F of linear elasticity, from elements of constant change of volume and another split of λ (verify)."""
    found = pressed(MaterialLaw.of_moduli(1.0, poisson, "neo-hookean"), depth)
    known = ratio * linear(poisson).reaction[2] * depth
    assert found.reaction[2] == pytest.approx(known, rel=1.5e-3 + found.bar)
    assert found.bar < 1e-2
    assert found.balance < 1e-8


def test_the_force_is_the_derivative_of_the_energy():
    law = MaterialLaw.of_moduli(1.0, 0.45, "yeoh", c2=0.2, c3=0.05)
    system = LargeSystem(meshes_of(BODY.mesh(Grading(0.1))), 3, law, bonded=True)
    _, path = system.reach(0.2)
    state, _ = system.reach(0.2)
    energies = [system.forces(system.equilibrate(state, depth))[2] for depth in (0.199, 0.201)]
    assert (energies[1] - energies[0]) / 0.002 == pytest.approx(path[-1, 1], rel=1e-5)


def test_a_body_of_equal_layers_is_the_body_of_one_material():
    one, two = (MaterialLaw((Parameters.of_moduli(1.0, 0.4, "neo-hookean"),) * count) for count in (1, 2))
    layered = Meridian(20 / 3, 20 / 3, 1.0, interfaces=(-1.0,))
    found, known = pressed(two, 0.1, layered, accuracy=1e-2), pressed(one, 0.1, accuracy=1e-2)
    assert found.reaction[2] == pytest.approx(known.reaction[2], rel=2e-3)


def test_an_ellipsoid_is_linear_at_small_depths():
    egg = EllipticMeridian(4.0, 3.0, 1.0, -1.0)
    law = MaterialLaw.of_moduli(1.0, 0.4, "neo-hookean")
    found = pressed(law, 1e-3, egg, accuracy=3e-3)
    assert found.reaction[2] == pytest.approx(1e-3 * linear(0.4, egg).reaction[2], rel=found.bar)


def test_load_steps_that_end_tell_where():
    with pytest.raises(LargeError, match="load steps reached") as stopped:
        pressed(MaterialLaw.of_moduli(1.0, 0.3, "neo-hookean"), 0.8)
    depth, force = stopped.value.reached
    assert 0.1 < depth < 0.8
    assert force == pytest.approx(linear(0.3).reaction[2] * depth, rel=0.2)


def test_a_study_is_solved_on_the_meridian():
    scene = study(
        body={"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "fixed": "bottom"},
        material={"law": "neo-hookean", "young": "10 kPa"},
        probe={"shape": "disc", "radius": "3 mm", "depth": "0.3 mm"},
        plan={"without": []},
    )
    (record,) = compute(make_plan(scene), MPI.COMM_SELF).values()
    assert (record.status, record.kind) == ("ok", "meridian large")
    assert record.energy == pytest.approx(record.force * 0.3e-3 / 2, rel=0.02)
    assert 0.02 < record.max_strain < 0.3
