"""Far-field coupling of a half ball: work, symmetry, places; `verify` has its known forces."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run import far_field
from epsmesh.run.execute import compute
from epsmesh.solve.far_field import _EXPONENTS, PointForce, Smooth
from tests.cases import solve, study

MESH = {"epsilon": "6 mm", "fine": "3 mm", "rim": "0.3 mm", "outside": "halfspace"}


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_energy_and_force_beyond_a_half_ball(poisson):
    """The work on the half sphere is the energy beyond it, and its traction sums up to the force."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    cosine, weights = (nodes + 1) / 2, weights / 2
    field = PointForce(poisson, (0.1, 0.0, 0.0), 2.0)
    at = np.array(field.centre) + 2 * np.column_stack([np.sqrt(1 - cosine**2), 0 * cosine, -cosine])
    area = 2 * np.pi * 2**2 * weights
    work = -np.sum(area[:, None] * field.at(at) * field.traction(at))
    assert work == pytest.approx(field.stiffness(1.0), rel=1e-12)
    assert area @ field.traction(at)[:, 2] == pytest.approx(field.force(1.0), rel=1e-12)


def smooth(poisson):
    """Return polynomials in the place of a body's regular part."""
    values = np.random.default_rng(2).uniform(-1, 1, (len(_EXPONENTS), 3))
    field = Smooth((0.1, -0.2, 0.0), 1.5, values)
    return field, lambda at, normal: field.traction(at, normal, 2 * poisson / (1 - 2 * poisson))


def half_space(poisson):
    field = PointForce(poisson, (0.0, 0.0, 0.0), 1.0)
    return field, lambda at, _: field.traction(at)


@pytest.mark.parametrize("of", [half_space, smooth])
def test_traction_is_that_of_the_displacement(of):
    (field, traction), step = of(0.3), 1e-5
    at = np.array([[0.3, 0.4, -0.5], [0.6, 0.0, -0.1]])
    gradient = np.stack([(field.at(at + e) - field.at(at - e)) / (2 * step) for e in step * np.eye(3)], axis=-1)
    strain = (gradient + gradient.transpose(0, 2, 1)) / 2
    dilation = np.trace(strain, axis1=1, axis2=2)
    stress = 2 * strain + 2 * 0.3 / (1 - 2 * 0.3) * dilation[:, None, None] * np.eye(3)
    normal = at / np.linalg.norm(at, axis=1, keepdims=True)
    assert np.einsum("nij,nj->ni", stress, normal) == pytest.approx(traction(at, normal), abs=1e-8)


def test_quarter_and_whole_agree():
    """The far field has the symmetry of the tool, and the energy of a part is its share of the whole."""
    mesh = {**MESH, "epsilon": "5 mm", "fine": "5 mm", "rim": "1 mm", "growth": 2.0}
    quarter, whole = (solve(mesh={**mesh, "model": model})[()] for model in ("auto", "3d"))
    assert quarter.force == pytest.approx(whole.force, rel=1e-6)
    assert quarter.origin == "symmetric" and whole.origin == "solved"


def test_young_and_depth_scale_and_each_poisson_is_solved():
    """Cases share a solve only if F is proportional to what differs."""
    ratios = [0.02 * n for n in range(12)]
    plan = make_plan(study(material={"young": ["1 kPa", "2 kPa"], "poisson": ratios}, mesh=MESH))
    assert len(plan.solves) == len(ratios) and not any(solve.reduced for solve in plan.solves)
    assert any("far field changes" in skipped.reason for skipped in plan.skipped)
    both = make_plan(study(mesh={**MESH, "outside": ["halfspace", "fixed"]}))
    assert len(both.solves) == len(both.meshes) == 2


def test_half_balls_of_a_path_share_one_mesh():
    """Far fields differ, from one factorisation: forces are within the bars of those on separate meshes."""
    path = {"points": [["1 mm", "2 mm"], ["-9 mm", "4 mm"], ["5 mm", "-11 mm"]]}
    mesh = {**MESH, "epsilon": "5 mm", "fine": "5 mm", "rim": "1 mm", "growth": 2.0, "outside": "green"}
    changes = {"probe": {"radius": "2 mm", "path": path}, "mesh": mesh}
    plan = make_plan(study(**changes))
    assert len(plan.solves) == 3 and len(plan.meshes) == 1 and len(plan.meshes[0].operators) == 1
    again = make_plan(study(**changes), stored={plan.keys[0]})
    far_field._known.clear()
    shared = compute(plan, MPI.COMM_SELF)
    assert len({seconds for _, seconds in far_field._known.values()}) == 1  # of one factorisation
    far_field._known.clear()
    later = compute(again, MPI.COMM_SELF)
    assert [later[key].force for key in plan.keys[1:]] == pytest.approx(
        [shared[key].force for key in plan.keys[1:]], rel=1e-8
    )  # fmt: skip
    far_field._known.clear()
    apart = make_plan(study(**changes), without=("shared-mesh",))
    alone = compute(apart, MPI.COMM_SELF)
    assert not set(apart.keys) & set(plan.keys)  # another mesh of the far field is another force
    found = ((plan, shared), (apart, alone))
    forces = np.array([[records[key].force for key in asked.keys] for asked, records in found])
    assert len({seconds for _, seconds in far_field._known.values()}) == 3
    assert np.ptp(forces[0]) > 0.01 * forces[0, 0]  # the sides are felt
    assert forces[0] == pytest.approx(forces[1], rel=max(record.force_error for record in shared.values()))
    assert "not of the closure" in build(plan, shared)["force_error"].attrs["comment"]


def test_a_sideways_force_is_not_reported():
    """A bonded tool off the centre also pulls sideways, which the far field of an axial force does not contain."""
    mesh = {**MESH, "epsilon": "5 mm", "fine": "5 mm", "rim": "1 mm", "growth": 2.0}
    (record,) = solve(probe={"at": ["3 mm", "0 mm"]}, mesh=mesh).values()
    x, y, z = record.force_vector
    assert np.isnan(x) and y == 0 and z == record.force


def test_stress_is_that_of_the_displacement():
    """For a point force, whose traction on half spheres has a separate formula; there is none on the face."""
    field = PointForce(0.3, (0.0, 0.0, 0.0), 1.0)
    at = np.array([[0.3, 0.4, -0.5], [0.0, 0.0, -0.7], [0.6, 0.1, 0.0]])
    normal = at / np.linalg.norm(at, axis=1, keepdims=True)
    assert np.einsum("nij,nj->ni", field.stress(at), normal) == pytest.approx(field.traction(at), abs=1e-12)
    assert field.stress(at)[2, :, 2] == pytest.approx(np.zeros(3), abs=1e-15)


def test_force_does_not_depend_on_the_other_places_of_its_study():
    """Equal keys, equal forces: whichever places are first, or share the mesh of the far field."""
    mesh = {**MESH, "epsilon": "5 mm", "fine": "5 mm", "rim": "1 mm", "growth": 2.0, "outside": "green"}
    here, there, others = ["1 mm", "2 mm"], ["-9 mm", "4 mm"], [["5 mm", "-11 mm"], ["8 mm", "7 mm"]]
    forces: dict[str, list[float]] = {}
    for points in ([there, here], [here, there], [here, there, *others]):
        far_field._known.clear()
        plan = make_plan(study(probe={"radius": "2 mm", "path": {"points": points}}, mesh=mesh))
        for key, record in compute(plan, MPI.COMM_SELF).items():
            forces.setdefault(key, []).append(record.force)
    assert max(map(len, forces.values())) > 1
    for same in forces.values():
        assert same == pytest.approx([same[0]] * len(same), rel=1e-8)
