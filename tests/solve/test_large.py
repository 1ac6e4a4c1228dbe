"""Large displacements: hyperelastic bodies are linear at small depths, and agree with closed forms at any."""

import re

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from epsmesh.plan.key import mesh_key
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.run.meshing import mesh_case
from epsmesh.solve import load_steps
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.forms import ElasticForms, HyperelasticForms
from epsmesh.solve.kernels import multigrid
from epsmesh.solve.laws import LAWS
from epsmesh.solve.laws.law import Law
from epsmesh.solve.load_steps import check_path
from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.study.case import Scale
from tests.cases import force, solve, study

LARGE = {"law": "neo-hookean"}
SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4}


def test_small_depths_are_linear():
    ratios = {}
    for depth in (0.003, 0.006):
        changes = {"probe": {"depth": f"{depth} mm"}}
        ratios[depth] = force(material=LARGE, **changes) / force(**changes)
    assert ratios[0.003] == pytest.approx(1.0, abs=2e-4)
    assert (ratios[0.006] - 1) / (ratios[0.003] - 1) == pytest.approx(2.0, rel=0.02)


def test_quarter_is_the_whole_and_force_goes_with_the_modulus():
    probe = {"depth": "0.3 mm"}
    (whole,) = solve(material=LARGE, probe=probe, mesh={"model": "3d"}).values()
    quarter, stiff = solve(material=LARGE | {"young": ["10 kPa", "30 kPa"]}, probe=probe).values()
    assert (quarter.origin, whole.origin) == ("symmetric", "solved")
    assert whole.force == pytest.approx(quarter.force, rel=1e-6)
    assert whole.energy == pytest.approx(quarter.energy, rel=1e-6)
    assert whole.force_error == pytest.approx(quarter.force_error, rel=0.1)
    assert whole.max_strain == pytest.approx(quarter.max_strain, rel=1e-5)
    assert stiff.origin == "scaled"
    assert stiff.force == pytest.approx(3 * quarter.force, rel=1e-12)
    assert stiff.energy == pytest.approx(3 * quarter.energy, rel=1e-12)


def test_an_indefinite_preconditioner_is_repaired(monkeypatch):
    """Its set-up estimates the largest eigenvalue, which a few slender elements make too small."""
    changes = {"material": LARGE, "solve": {"method": "iterative"}}
    known = force(**changes)
    monkeypatch.setattr(multigrid, "_LANCZOS", 1)
    assert force(**changes) == pytest.approx(known, rel=1e-8)
    monkeypatch.setattr(multigrid.Cycle, "refine_eigenvalues", lambda self: None)
    (record,) = solve(**changes).values()
    assert record.status == "failed"


def test_every_depth_is_solved_and_none_is_another_s():
    depths = {"depth": ["0.1 mm", "0.2 mm"]}
    plan = make_plan(study(material={"law": ["linear", "neo-hookean"]}, probe=depths, solve={"exact": True}))
    assert len({solve.key for solve in plan.solves if not solve.is_reference}) == 3  # one of them is linear
    assert sum(solve.is_reference for solve in plan.solves) == 1
    assert any("large" in skipped.reason for skipped in plan.skipped)


@pytest.mark.parametrize(
    ("poisson", "depth", "known"),
    [(0.3, "1.2 mm", 11.77), (0.3, "2 mm", 19.13), (0.45, "2 mm", 21.65)],
)
def test_a_deep_disc_has_the_force_of_other_elements(poisson, depth, known):
    """Forces (E mm²) of NGSolve's axisymmetric elements of degree 3, extrapolated in the size at the edge: ± 0.5 %."""
    (record,) = solve(
        body={"shape": "cylinder", "size": None, "radius": "30 mm", "height": "30 mm"},
        material=LARGE | {"poisson": poisson},
        probe={"radius": "4 mm", "depth": depth},
        mesh={"epsilon": "full", "fine": "15 mm", "coarse": "30 mm", "rim": "0.6 mm", "growth": 0.45},
    ).values()
    assert record.status == "ok"
    assert record.force_error <= 0.08
    assert record.force == pytest.approx(known * 1e-2, rel=record.force_error)


def test_only_deep_probes_have_no_quarter_points():
    """In tissue of large displacements, and where the edge is singular."""
    depths = {"depth": ["0.2 mm", "0.4 mm"]}
    disc = {"shape": "disc", "radius": "3 mm"} | depths
    with_points = {
        (law, probe["shape"]): [each.has_quarter_points for each in study(material={"law": law}, probe=probe).cases()]
        for law in ("linear", "neo-hookean")
        for probe in (disc, disc | {"shape": "sphere", "contact": "unilateral"})
    }
    assert with_points.pop(("neo-hookean", "disc")) == [True, False]
    assert all(all(found) for found in with_points.values())
    shallow, deep = study(material=LARGE, probe=depths).cases()
    assert mesh_key(shallow) != mesh_key(deep)


@pytest.mark.usefixtures("folding")
def test_a_depth_that_is_not_reached_fails_and_says_where():
    (record,) = solve(material=LARGE, probe={"depth": "9 mm"}).values()
    assert record.status == "partial"
    assert np.isnan(record.force)
    assert 0 < record.depth_reached < 9e-3
    reached, force = f"{record.depth_reached * 1e3:.3g} mm", f"{record.force_reached:.4g} N"
    assert f"reached {reached} of 9 mm, where F is {force}" in record.message
    stiffer = record.scaled(Scale(2 * record.young, record.depth))
    assert stiffer.force_reached == pytest.approx(2 * record.force_reached)
    assert stiffer.depth_reached == record.depth_reached


@pytest.mark.usefixtures("folding")
def test_a_dataset_has_the_depth_reached():
    study_ = study(material=LARGE, probe={"depth": ["0.4 mm", "9 mm"]})
    plan = make_plan(study_)
    dataset = build(plan, compute(plan, MPI.COMM_SELF))
    assert dataset["status"].values.tolist() == ["ok", "partial"]
    assert np.isnan(dataset["force"][1]) and np.isnan(dataset["force_reached"][0])
    assert 0.4e-3 <= dataset["depth_reached"][1] < 9e-3
    assert dataset["force_reached"][1] >= dataset["force"][0]


@pytest.mark.usefixtures("folding")
def test_depths_of_a_sweep_share_one_load_path(monkeypatch):
    """Depths on the load path have the forces of single depths; deeper ones fail, and name the depth reached."""
    depths = {"depth": ["9 mm", "0.4 mm", "8 mm", "0.8 mm"]}
    ends: list[tuple[float, float]] = []

    def counted(path, solve_at, to, **steps):
        def at(depth):
            ends.append((path.reached, to))
            return solve_at(depth)

        follow(path, at, to, **steps)

    monkeypatch.setattr(load_steps, "follow", counted)
    deep, first, far, second = solve(material=LARGE, probe=depths).values()
    shared = sum(depth < 1e-3 for _, depth in ends)
    assert [reached for reached, _ in ends] == sorted(reached for reached, _ in ends)
    assert [record.status for record in (first, second, far, deep)] == ["ok", "ok", "partial", "partial"]
    reached = re.search(r"reached ([0-9.]+) mm of 8 mm, where F is ([0-9.]+) N", far.message)
    assert reached is not None
    assert float(reached[1]) >= 0.8
    assert float(reached[2]) >= 0.999 * second.force
    assert f"reached {reached[1]} mm of 9 mm" in deep.message
    ends.clear()
    for record, depth in ((first, 0.4), (second, 0.8)):
        (alone,) = solve(material=LARGE, probe={"depth": f"{depth} mm"}).values()
        assert record.force == pytest.approx(alone.force, rel=1e-8)
        assert record.force_error == pytest.approx(alone.force_error, rel=1e-2)  # of iterations
        assert record.max_strain == pytest.approx(alone.max_strain, rel=1e-6)
    assert second.iterations < alone.iterations  # those from the depth before on
    assert shared < len(ends)


def test_a_force_that_is_not_the_derivative_of_the_energy_is_refused():
    depth = 1e-3 * np.arange(1, 5) / 4
    check_path(np.column_stack([depth, 50 * depth, 25 * depth**2]), 0.0)
    wrong = np.column_stack([depth, 50 * depth, 25.1 * depth**2])
    with pytest.raises(LargeError, match="not the derivative"):
        check_path(wrong, 0.0)
    check_path(wrong * (1e-5, 1e-5, 1e-10), 1e-16)  # for so small an energy rounding is larger


def test_laws_of_one_space_have_forms_of_their_own(monkeypatch):
    """Forms of a second law are not confused with those of the first."""
    soft = LAWS["neo-hookean"]
    stiffer = Law(lambda *of: 2 * soft.shape(*of), modulus=lambda of: 2 * soft.modulus(of))
    monkeypatch.setitem(LAWS, "stiffer", stiffer)
    (planned,) = make_plan(study()).solves
    body = mesh_case(planned.case, planned.mirrors, MPI.COMM_SELF, None)
    space = vector_space(body.mesh, 1)
    elastic = ElasticForms(space)
    elastic.set_law(MaterialLaw.of_moduli(10e3, 0.4))
    elastic.displacement.interpolate(lambda x: 0.1 * x)
    energies = [
        fem.assemble_scalar(HyperelasticForms(space, elastic, (law,)).energy) for law in ("neo-hookean", "stiffer")
    ]
    assert energies[1] == pytest.approx(2 * energies[0], rel=1e-12)


def test_linear_tissue_beyond_epsilon():
    """The force tends to that of the law everywhere as ε grows."""

    def gap(epsilon):
        scene = {"probe": {"depth": "0.6 mm"}, "material": LARGE}
        linear, everywhere = (
            force(**scene, mesh={"epsilon": epsilon, "outside": outside}) for outside in ("linear", "coarse")
        )
        return linear / everywhere - 1

    gaps = [gap(epsilon) for epsilon in ("4 mm", "8 mm", "14 mm", "full")]
    assert min(gaps) > -2e-3
    assert gaps[1] < gaps[2] < gaps[3] == 0.0
    assert gaps[2] > -5e-4
