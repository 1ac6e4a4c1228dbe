"""The fields to look at are those of the solver: conditions, symmetry, ranks."""

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.plan.recipe import Rung
from epsmesh.run.execute import compute
from epsmesh.run.problem import CaseFailure
from epsmesh.run.solved import solve_alone
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.view.compute import compute_fields
from tests.cases import BLADE, solve, study

WORLD = MPI.COMM_WORLD


def fields(comm=MPI.COMM_SELF, mesh_only=False, **changes):
    made = study(**changes)
    (case,) = made.cases()
    return compute_fields(solve_alone(made, case), comm, mesh_only=mesh_only)


@pytest.mark.parametrize(
    "changes",
    [
        {"mesh": {"degree": 1, "rim": "0.5 mm"}},
        {"material": {"poisson": 0.49}},
        {"mesh": {"degree": 3}, "probe": {"at": ["5 mm", "-3 mm"]}},
        {"mesh": {"epsilon": "8 mm", "outside": "fixed"}},
        {"probe": BLADE | {"slice": "0.1 mm"}},
    ],
)
def test_displacement_is_what_probe_and_support_prescribe(changes):
    found = fields(**changes)
    at = {name: found.displacement[np.unique(found.facets[name])] for name in (PROBE, FIXED)}
    travel = np.broadcast_to(found.case.travel, at[PROBE].shape)
    np.testing.assert_allclose(at[PROBE], travel, rtol=0, atol=1e-12)
    np.testing.assert_allclose(at[FIXED], 0.0, atol=1e-12)
    assert np.linalg.norm(found.displacement, axis=1).max() < 1.2 * np.linalg.norm(travel[0])


@pytest.mark.parametrize("changes", [{}, {"material": {"poisson": 0.49}}])
def test_strain_and_unknowns_are_the_record_s(changes):
    found = fields(**changes)
    (record,) = solve(**changes).values()
    assert np.abs(found.strain / record.max_strain - 1).min() < 1e-6
    assert found.strain.max() >= (1 - 1e-12) * record.max_strain  # it is the largest of cells clear of the probe's edge
    assert (found.dofs, len(found.cells)) == (record.dofs, record.cells)


def test_reflected_quarter_is_the_whole_model():
    solve = {"energy_tolerance": 1e-10}  # strains are linear in the solver's error
    quarter, whole = (fields(mesh={"model": model}, solve=solve) for model in ("auto", "3d"))
    np.testing.assert_array_equal(quarter.points, whole.points)
    np.testing.assert_array_equal(quarter.cells, whole.cells)
    scale = 0.2e-3
    np.testing.assert_allclose(quarter.displacement, whole.displacement, atol=1e-6 * scale)
    np.testing.assert_allclose(quarter.strain, whole.strain, rtol=1e-5, atol=1e-9)


def test_round_scene_is_shown_in_three_dimensions():
    body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
    made = study(body=body, plan={"without": []}, mesh={"epsilon": "8 mm", "outside": "free"})
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=True)
    # What is kept is the column: the longest distance from its axis is ε.
    assert np.hypot(*found.points[:, :2].T).max() == pytest.approx(8e-3, rel=1e-9)
    assert np.ptp(found.points[:, 2]) == pytest.approx(20e-3, rel=1e-9)


@pytest.mark.mpi
@pytest.mark.parametrize("changes", [{"mesh": {"degree": 3}}, {"material": {"poisson": 0.49}}])
def test_ranks_agree(changes):
    together = fields(WORLD, **changes)
    if WORLD.rank:
        assert together is None
        return
    alone = fields(**changes)
    np.testing.assert_array_equal(together.cells, alone.cells)
    np.testing.assert_allclose(together.displacement, alone.displacement, atol=1e-9)
    np.testing.assert_allclose(together.strain, alone.strain, rtol=1e-4, atol=1e-7)


def test_elements_are_small_within_epsilon():
    found = fields(mesh_only=True, mesh={"epsilon": "8 mm", "fine": "2 mm", "coarse": "8 mm"})
    inside = found.within_epsilon
    assert np.quantile(found.sizes[inside], 0.95) < np.quantile(found.sizes[~inside], 0.05) * 2
    assert np.median(found.sizes[inside]) < 0.5 * np.median(found.sizes[~inside])
    # A regular tetrahedron of edge a has the volume a³/(6√2): together they are the body.
    assert (found.sizes**3).sum() / (6 * np.sqrt(2)) == pytest.approx(40e-3 * 40e-3 * 20e-3, rel=1e-9)


def test_nothing_is_solved_where_the_mesh_alone_is_asked_for(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("solved")

    monkeypatch.setattr("epsmesh.run.solved.solve_problem", refuse)
    found = fields(mesh_only=True)
    assert found.displacement is None
    assert found.strain is None
    with pytest.raises(AssertionError, match="solved"):
        fields()


def test_accuracy_is_shown_on_the_mesh_that_proves_it():
    none = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
    changes = {"mesh": none | {"accuracy": "1 %"}}
    made = study(**changes)
    (case,) = made.cases()
    # A first mesh that cannot do it is passed over.
    first = solve_alone(made, case)
    poor = first.case.mesh.model_copy(update={"fine": 10e-3, "coarse": 10e-3, "rim": 2e-3, "degree": 2})
    later = (Rung(first.case.mesh, first.expected), *first.later)
    start = replace(first, case=replace(first.case, mesh=poor), later=later, expected=nan)
    found = compute_fields(start, MPI.COMM_SELF)
    assert found.case.mesh != poor
    assert found.dofs == compute_fields(first, MPI.COMM_SELF).dofs


@pytest.mark.parametrize("accuracy", ["5 %", "1 %"])
def test_mesh_and_force_of_an_accuracy_are_the_run_s(accuracy):
    none = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
    changes = {"mesh": none | {"accuracy": accuracy}}
    (record,) = solve(**changes).values()
    found = fields(**changes)
    assert (found.dofs, len(found.cells)) == (record.dofs, record.cells)
    assert (found.force, found.force_error) == pytest.approx((record.force, record.force_error), rel=1e-9)


@pytest.mark.parametrize("mesh", [{"accuracy": "1 %"}, {"epsilon": "8 mm", "outside": "free"}])
def test_force_of_a_round_scene_is_the_meridian_s(mesh):
    body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
    none = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree")) if "accuracy" in mesh else {}
    changes = {"body": body, "plan": {"without": []}, "mesh": none | mesh}
    (record,) = solve(**changes).values()
    found = fields(**changes)
    assert record.origin == "axisymmetric"
    assert found.on_meridian
    assert found.size.endswith("unknowns in three dimensions")  # F is that of another mesh
    assert (found.force, found.force_error) == pytest.approx((record.force, record.force_error), rel=1e-9)
    assert found.displacement.shape == found.points.shape


def test_force_of_a_place_on_a_path_is_the_run_s():
    places = [["-6 mm", "2 mm"], ["0 mm", "2 mm"], ["4 mm", "2 mm"], ["7 mm", "-3 mm"]]
    mesh = {"epsilon": "5 mm", "fine": "2.5 mm", "rim": "1 mm", "outside": "green"}
    made = study(mesh=mesh, probe={"at": places}, plan={"without": []})
    plan = make_plan(made)
    assert any(solve.case.far_region for solve in plan.solves)
    records = compute(plan, MPI.COMM_SELF)
    for case in list(made.cases())[:2]:
        record = records[next(solve.key for solve in plan.solves if case.index in solve.serves)]
        found = compute_fields(solve_alone(made, case), MPI.COMM_SELF)
        assert found.force == pytest.approx(record.force, rel=1e-9)
        at = np.unique(found.facets[PROBE])
        np.testing.assert_allclose(found.points[at].mean(axis=0), case.frame.point, atol=1e-5)
        np.testing.assert_allclose(found.displacement[at], np.broadcast_to(case.travel, (len(at), 3)), atol=1e-12)


@pytest.mark.mpi
def test_what_does_not_fit_into_memory_is_refused():
    with pytest.raises(CaseFailure, match="GB are available"):
        fields(WORLD, mesh_only=True, mesh={"fine": "0.01 mm", "rim": "0.01 mm"})


def test_linear_parts_of_regions_have_names():
    changes = {"material": {"law": "neo-hookean", "poisson": 0.4}, "mesh": {"epsilon": "6 mm", "outside": "linear"}}
    found = fields(**changes, mesh_only=True)
    assert found.region_names == ("tissue", "tissue, linear")
    middle = np.linalg.norm(found.centres - found.contact, axis=1)
    np.testing.assert_array_equal(found.regions, middle > 6e-3)
