"""The solution in hand is that of the run: its force, and stresses that balance it, whatever the elements and law."""

import basix
import numpy as np
import pytest
from mpi4py import MPI

import epsmesh
from epsmesh import compat
from epsmesh.run.case_solution import CaseSolution
from epsmesh.solve.points.locate import table_of
from tests.cases import raw, solve
from tests.sampling import sampled

WORLD = MPI.COMM_WORLD
LAYER = {"name": "skin", "young": "30 kPa", "poisson": 0.45, "thickness": "3 mm"}
SPHERE = {"shape": "sphere", "radius": "6 mm", "depth": "0.5 mm"}
MATRIX = {
    "bonded, aside": {"probe": {"at": ["5 mm", "0 mm"]}},
    "incompressible below a layer": {"material": {"poisson": 0.5}, "body": {"layer": [LAYER]}},
    "contact found, friction": {"probe": SPHERE | {"friction": 0.3}},
    "large, mixed": {"material": {"law": "neo-hookean", "poisson": 0.49}, "probe": {"depth": "1 mm"}},
}
BALL = {
    "body": {"shape": "ellipsoid", "axes": ["15 mm", "12 mm", "10 mm"], "fixed": {"below": "-5 mm"}, "size": None},
    "mesh": {"fine": "4 mm", "coarse": "6 mm"},
}


def solution(comm=MPI.COMM_SELF, **changes) -> CaseSolution:
    return epsmesh.read(raw(**changes)).solve(comm=comm)


def force_of_stress(found: CaseSolution, height: float) -> float:
    """Return the force (N) on the top of a body of a ``height`` (m), held at its bottom: ∫ P_zz dV / height.

    That is the virtual work in a uniform strain. P is the first Piola-Kirchhoff stress, σ at small displacements.
    """
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, 6)
    nodes = found.mesh.geometry.x[compat.geometry_dofs(found.mesh)]
    table = table_of(1 if nodes.shape[1] == 4 else 2, points)
    volumes = np.abs(np.linalg.det(np.einsum("rqk,nkd->nqdr", table[1:], nodes))) * weights
    values = found.at(np.einsum("qk,nkd->nqd", table[0], nodes).reshape(-1, 3))
    stress = values.stress.values
    if not found.law.is_linear:
        deformation = np.eye(3) + found.solved.state.at(np.stack([values[c].values for c in "xyz"], axis=1)).gradient
        stress = np.linalg.det(deformation)[:, None, None] * stress @ np.linalg.inv(deformation).swapaxes(1, 2)
    parts = 2 ** len(found.solved.state.body.mirrored)
    return -parts * float(stress[:, 2, 2] @ volumes.reshape(-1)) / height


@sampled("name", MATRIX, by_day=1)
def test_force_is_the_run_s_and_stresses_balance_it(name):
    found = solution(**MATRIX[name])
    (record,) = solve(**MATRIX[name]).values()
    assert found.force == pytest.approx(record.force, rel=1e-12)
    assert found.force_error == pytest.approx(record.force_error * record.force, rel=1e-9)
    assert force_of_stress(found, 20e-3) == pytest.approx(found.force, rel=2e-3)


def test_quarter_has_the_values_of_the_whole():
    points = np.random.default_rng(3).uniform([-19e-3, -19e-3, -19e-3], [19e-3, 19e-3, 0], (200, 3))
    how = {"solve": {"energy_tolerance": 1e-10}, "material": {"poisson": 0.45}}
    quarter, whole = (solution(mesh={"model": model}, **how).at(points) for model in ("auto", "3d"))
    assert np.isfinite(whole.stress).all()
    for name in ("displacement", "stress", "principal_stress"):
        largest = float(abs(whole[name]).max())
        np.testing.assert_allclose(quarter[name], whole[name], atol=1e-5 * largest, err_msg=name)


def test_body_ends_where_its_shape_does_and_the_tool_presses_from_the_side():
    found = solution(probe={"at": ["15 mm", "0 mm", "0 mm"], "radius": "2 mm"}, **BALL)
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(300, 3))
    surface = np.array([15e-3, 12e-3, 10e-3]) * directions / np.linalg.norm(directions, axis=1)[:, None]
    assert np.isfinite(found.at(0.98 * surface).displacement).all()
    outside = found.at(1.03 * surface)
    assert np.isnan(outside.stress).all()
    assert (outside.region == -1).all()
    below = found.at([(15e-3 * (1 - (0.5 / 12) ** 2 - (0.3 / 10) ** 2) ** 0.5, 0.5e-3, -0.3e-3)])
    np.testing.assert_allclose(below.displacement[0], found.case.travel, atol=1e-9)
    assert float(below.contact_pressure[0]) == pytest.approx(-float(below.stress[0, 0, 0]), rel=0.05)


def test_half_ball_is_where_its_place_is():
    mesh = {"epsilon": "6 mm", "fine": "2.5 mm", "outside": "green"}
    found = solution(mesh=mesh, probe={"at": ["5 mm", "-3 mm"]})
    values = found.at([(5e-3, -3e-3, 0), (5e-3, -3e-3, -5e-3), (-5e-3, 3e-3, -1e-3)])
    np.testing.assert_allclose(values.displacement[0], [0, 0, -0.2e-3], atol=1e-12)
    assert 0.02e-3 < -float(values.displacement[1, 2]) < 0.15e-3
    assert int(values.region[2]) == -1


@pytest.mark.mpi
@pytest.mark.parametrize("changes", [{"material": {"poisson": 0.49}}, {"probe": SPHERE}])
def test_ranks_agree(changes):
    points = np.random.default_rng(5).uniform([-19e-3, -19e-3, -22e-3], [19e-3, 19e-3, 0], (100, 3))
    together, alone = (solution(comm, **changes).at(points) for comm in (WORLD, MPI.COMM_SELF))
    for name in ("displacement", "stress", "von_mises"):
        np.testing.assert_allclose(together[name], alone[name], atol=1e-4 * float(abs(alone[name]).max()))
    assert all(WORLD.allgather(together.equals(WORLD.bcast(together))))


def test_samples_have_coordinates_and_units():
    found = solution()
    line = found.along(("0 mm", "0 mm", "0 mm"), (0, 0, -25e-3), 26)
    np.testing.assert_allclose(line.distance, np.arange(26) * 1e-3, atol=1e-15)
    np.testing.assert_array_equal(np.isfinite(line.von_mises), line.z > -20.001e-3)
    falls = -line.displacement.sel(component="z").dropna("distance").values
    assert falls[0] == pytest.approx(0.2e-3)
    assert np.all(np.diff(falls) < 0)
    plane = found.on((0, 2e-3, 0), (0, 1, 0), "2 mm")
    assert plane.sizes["u"] == plane.sizes["v"] * 2 - 1 == 21
    np.testing.assert_allclose(plane.y, 2e-3)
    np.testing.assert_allclose(plane.sel(u=4e-3, method="nearest").x, 4e-3)
    assert (plane.stress.units, plane.u.units, plane.displacement.units) == ("Pa", "m", "m")
    np.testing.assert_allclose(plane.von_mises, plane.von_mises.isel(u=slice(None, None, -1)).values, rtol=1e-9)
    with pytest.raises(ValueError, match="normal"):
        found.on((0, 0, 0), (0, 0, 0))
    with pytest.raises(ValueError, match="at most 2000000"):
        found.on((0, 0, 0), (0, 1, 0), "1 um")
    with pytest.raises(ValueError, match="three coordinates"):
        found.at([(0, 0)])


def test_case_is_chosen_by_its_labels():
    probes = [{"name": "disc", **raw()["probe"]}, {"name": "ball", **SPHERE}]
    study = epsmesh.read(raw(probe=None) | {"probe": probes, "material": {"young": "10 kPa", "poisson": [0.3, 0.4]}})
    found = study.solve({"poisson": 0.4}, probe="ball", comm=MPI.COMM_SELF)
    assert (found.case.probe.shape, found.case.material.poisson) == ("sphere", 0.4)
    with pytest.raises(ValueError, match="2 cases have these labels; they differ in poisson"):
        study.solve(probe="disc")
    with pytest.raises(ValueError, match=r"no such case; the study has probe = disc, ball; poisson = 0\.3, 0\.4"):
        study.solve(probe="disc", poisson=0.35)
    with pytest.raises(ValueError, match="does not sweep 'young'"):
        study.solve(young=10e3)


@pytest.mark.parametrize("changes", [{}, {"material": {"poisson": 0.49}}], ids=["displacement", "mixed"])
def test_bars_at_points_hold_a_finer_solution(changes):
    points = np.random.default_rng(11).uniform([-9e-3, -9e-3, -15e-3], [9e-3, 9e-3, -1.5e-3], (60, 3))
    mesh = {"fine": "2.5 mm", "coarse": "5 mm", "rim": "0.7 mm"}
    coarse, fine = (solution(mesh=m, **changes).at(points) for m in ({}, mesh))
    off = abs(coarse.displacement - fine.displacement).max("component") <= coarse.displacement_error
    assert off.mean() > 0.95
    for name in ("von_mises", "principal_stress"):
        assert (abs(coarse[name] - fine[name]) <= coarse[f"{name}_error"]).mean() > 0.9
        assert float((coarse[f"{name}_error"] / abs(fine.von_mises)).median()) < 0.5


def test_stress_at_a_singular_edge_and_of_found_contact_has_no_bar():
    edge = solution().at([(2.95e-3, 0, -0.02e-3), (0, 0, -5e-3)])
    np.testing.assert_array_equal(np.isfinite(edge.von_mises_error), [False, True])
    assert np.isfinite(edge.displacement_error).all()
    assert "von_mises_error" not in solution(probe=SPHERE).at([(0, 0, -5e-3)])
