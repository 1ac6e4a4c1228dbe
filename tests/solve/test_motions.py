"""Several rigid motions of a probe: mechanics of its stiffness, and superposition of forces."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report import accessor  # noqa: F401 (registers dataset.epsmesh)
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.solve.balance import Sums
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.movement import Motion, Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Scale
from tests.cases import BLADE, solve, study
from tests.solve.test_mixed import law, make_mesh
from tests.verification import known

TRAVEL = (0.1e-3, 0.05e-3, -0.2e-3)
OFF = {"probe": {"at": ["4 mm", "2 mm"]}}
KINDS = pytest.mark.parametrize(("kind", "poisson"), [("displacement", 0.3), ("mixed", 0.49)])


def run(kind, movement, poisson=0.3, comm=MPI.COMM_SELF, mesh=None, **options):
    with (
        Spaces(mesh or make_mesh(comm, (), **OFF)) as spaces,
        QuasiStaticProblem(spaces, 2, Conditions(), kind) as problem,
    ):
        return problem.solve(law(poisson), movement, **options)


def all_six(centre=(4e-3, 2e-3, 0.0), travel=TRAVEL):
    return Movement.all(travel, centre)


@pytest.mark.mpi
@KINDS
@pytest.mark.parametrize("method", ["direct", "iterative"])
def test_movements_superpose(kind, poisson, method):
    """Press and slide, solved separately, give force and energy of both at once."""
    norm = float(np.linalg.norm(TRAVEL))
    together = Movement((Motion(tuple(t / norm for t in TRAVEL)),), (norm,))
    options = {"method": method, "tolerance": 1e-10, "comm": MPI.COMM_WORLD}
    whole, parts = (run(kind, movement, poisson, **options) for movement in (together, Movement.along(TRAVEL)))
    assert parts.energy == pytest.approx(whole.energy, rel=1e-9)
    assert parts.reaction == pytest.approx(whole.reaction, rel=1e-8, abs=1e-8 * whole.reaction[2])
    assert parts.max_strain == pytest.approx(whole.max_strain, rel=1e-7)


@KINDS
def test_stiffness_of_all_motions(kind, poisson):
    """Symmetric and positive; forces are its rows; another reference point transforms it."""
    here = run(kind, all_six(), poisson, tolerance=1e-9)
    stiffness = here.stiffness
    assert stiffness.shape == (6, 6)
    assert np.array_equal(stiffness, stiffness.T)
    assert np.linalg.eigvalsh(stiffness).min() > 0
    assert here.reaction == pytest.approx(-stiffness[:3] @ here.response.amounts, rel=1e-12)
    for j, force in enumerate(here.response.forces):  # sums of residuals, linear in the solver's error
        assert force == pytest.approx(-stiffness[:3, j], abs=1e-6 * np.abs(stiffness[:3, j]).max())
    arm = np.array([1e-3, -2e-3, 3e-3])
    there = run(kind, all_six(tuple(np.array([4e-3, 2e-3, 0.0]) + arm)), poisson, tolerance=1e-9).stiffness
    # A rotation about c + arm is a rotation about c plus a translation by arm × ω.
    shift = np.eye(6)
    shift[:3, 3:] = np.cross(np.eye(3), -arm).T
    assert there == pytest.approx(shift.T @ stiffness @ shift, rel=1e-7, abs=1e-7 * np.abs(there).max())


def test_rotations_are_those_of_the_residuals():
    """Reciprocity: the torque of the pressed probe's residual is the axial force of a rotation."""
    found = run("displacement", all_six(), tolerance=1e-10)
    with Spaces(make_mesh(mirrors=(), **OFF)) as spaces, QuasiStaticProblem(spaces, 2, Conditions()) as problem:
        turned = problem.solve(law(0.3), Movement((all_six().motions[3],), (1.0,)), tolerance=1e-10)
        assert turned.response.forces[0] == pytest.approx(-found.stiffness[:3, 3], rel=1e-6)
        assert 2 * turned.energy == pytest.approx(found.stiffness[3, 3], rel=1e-9)


@cache
def on_half_space(poisson):
    """The stiffness of a disc of 1 mm bonded to a body of 60 radii, extrapolated, and its bars, for μ = 1 and a = 1."""
    changes = {
        "body": {"shape": "cylinder", "radius": "60 mm", "height": "60 mm"},
        "probe": {"radius": "1 mm", "depth": "0.05 mm"},
        "mesh": {"fine": "20 mm", "coarse": "20 mm", "rim": "0.2 mm", "growth": 0.5},
    }
    spaces = Spaces(make_mesh(mirrors=(), **changes))
    material = MaterialLaw.of_moduli(2 * (1 + poisson), poisson)
    with spaces, QuasiStaticProblem(spaces, 2, Conditions()) as problem:
        movement = Movement.all((0.0, 0.0, -1.0), (0.0, 0.0, 0.0))
        solution = problem.solve(material, movement, estimate=True).extrapolated(
            Convergence(degree=2, element="displacement")
        )
    unit = 1e-3 * np.outer([1, 1, 1, 1e-3, 1e-3, 1e-3], [1, 1, 1, 1e-3, 1e-3, 1e-3])
    return solution.stiffness / unit, solution.bars / unit


@pytest.mark.parametrize("poisson", [pytest.param(0.0, marks=pytest.mark.nightly), 0.3])
def test_bonded_disc_on_half_space(poisson):
    """Closed forms: torsion 16/3, whatever the material (E. Reissner and H. F. Sagoci 1944), and D. A. Spence's press
    (1968). The finite body of 60 a is stiffer by 1 % in the latter.
    """
    stiffness, bars = on_half_space(poisson)
    assert stiffness[5, 5] == pytest.approx(16 / 3, abs=bars[5, 5] + 1e-4)
    assert bars[5, 5] < 0.01 * stiffness[5, 5]
    mu = 1 / (2 * (1 + poisson))
    press = known.half_space_disc(1.0, poisson, 1.0, 1.0, "bonded")[0] / mu
    assert 0 < stiffness[2, 2] / press - 1 < 0.02
    # Axisymmetric: both slides are equal, both tilts are equal, and neither couples to press or torsion.
    assert stiffness[0, 0] == pytest.approx(stiffness[1, 1], abs=2 * bars[0, 0])
    assert stiffness[3, 3] == pytest.approx(stiffness[4, 4], abs=2 * bars[3, 3])
    assert stiffness[0, 4] == pytest.approx(-stiffness[1, 3], abs=2 * bars[0, 4])
    apart = [(0, 1), (0, 2), (0, 3), (0, 5), (2, 3), (2, 5), (3, 4), (3, 5)]
    assert all(abs(stiffness[i, j]) <= bars[i, j] for i, j in apart)


def test_slide_and_tilt_of_a_bonded_disc():
    """At ν = ½ the slide needs no pressure, and press and tilt need no shear. The closed forms of frictionless discs
    and of Mindlin's slide then apply: 8 μ a, 16/3 μ a³ and 16/3 μ a. A body with fixed sides is stiffer.
    """
    changes = {
        "body": {"shape": "cylinder", "radius": "60 mm", "height": "60 mm", "fixed": "bottom+sides"},
        "probe": {"radius": "1 mm", "depth": "0.05 mm"},
        "mesh": {"fine": "20 mm", "coarse": "20 mm", "rim": "0.3 mm", "growth": 0.6},
    }
    spaces = Spaces(make_mesh(mirrors=(), **changes))
    with spaces, QuasiStaticProblem(spaces, 2, Conditions(), "mixed") as problem:
        movement = Movement.all((0.0, 0.0, -1.0), (0.0, 0.0, 0.0))
        solution = problem.solve(MaterialLaw.of_moduli(3.0, 0.5), movement, estimate=True).extrapolated(
            Convergence(degree=2, element="mixed")
        )
    unit = 1e-3 * np.outer([1, 1, 1, 1e-3, 1e-3, 1e-3], [1, 1, 1, 1e-3, 1e-3, 1e-3])
    stiffness, bars = solution.stiffness / unit, solution.bars / unit
    assert stiffness[3, 3] == pytest.approx(16 / 3, abs=bars[3, 3] + 1e-4)
    assert stiffness[5, 5] == pytest.approx(16 / 3, abs=bars[5, 5] + 1e-4)
    for j, exact in ((0, 16 / 3), (1, 16 / 3), (2, 8.0)):
        assert -bars[j, j] < stiffness[j, j] - exact < 0.03 * exact
    assert abs(stiffness[0, 4]) <= bars[0, 4] + 0.02


@KINDS
def test_bars_of_movements_hold_those_of_finer_meshes(kind, poisson):
    """Entries of the stiffness, and forces, of a coarse mesh compared with those of a finer one of higher degree."""
    coarse, fine = (make_mesh(mirrors=(), mesh={"rim": rim}, **OFF) for rim in ("1.5 mm", "0.5 mm"))
    rough = run(kind, all_six(), poisson, mesh=coarse, estimate=True)
    with Spaces(fine) as spaces, QuasiStaticProblem(spaces, 3, Conditions(), kind) as problem:
        exact = problem.solve(law(poisson), all_six(), estimate=True).extrapolated(Convergence(degree=3, element=kind))
    assert np.all(np.abs(rough.stiffness - exact.stiffness) <= rough.bars + exact.bars)
    gaps, bars = np.subtract(rough.reaction, exact.reaction), np.add(rough.reaction_bars, exact.reaction_bars)
    assert np.all(np.abs(gaps) <= bars)


def test_one_movement_is_a_matrix_of_one():
    """Decrements and bars are the same whether a motion is solved for alone or with others."""
    press = Movement.along((0.0, 0.0, -1.0))
    alone, among = (
        run("displacement", movement, estimate=True) for movement in (press, Movement.along((1.0, 0.0, -1.0)))
    )
    assert among.stiffness[0, 0] == pytest.approx(alone.stiffness[0, 0], rel=1e-9)
    assert among.decrements[0, 0] == pytest.approx(alone.decrements[0, 0], rel=1e-6)
    assert among.bars[0, 0] == pytest.approx(alone.bars[0, 0], rel=1e-6)


def test_decrements_are_those_of_the_higher_degree():
    """K_p - K_{p+1}, entry by entry, within the error of the few iterations."""
    mesh = make_mesh(mirrors=(), **OFF)
    found = run("displacement", all_six(), mesh=mesh, estimate=True)
    with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, 3, Conditions()) as problem:
        wanted = found.stiffness - problem.solve(law(0.3), all_six()).stiffness
    root = np.sqrt(np.diag(wanted))
    assert np.all(np.abs(found.decrements - wanted) <= 0.05 * np.outer(root, root))
    assert np.all(np.abs(wanted) <= 1.0000001 * np.outer(root, root))


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_study_asks_for_the_stiffness(poisson):
    """In a study the force is that of the press alone, and scales; the stiffness has the symmetry of the scene."""
    material = {"poisson": poisson}
    alone, found = (next(iter(solve(material=material, probe={"motion": m}).values())) for m in ("press", "all"))
    assert alone.stiffness == ()
    assert found.status == "ok", found.message
    assert found.force == pytest.approx(alone.force, rel=1e-8)
    stiffness, bars = np.array(found.stiffness), np.array(found.stiffness_error)
    assert found.force == pytest.approx(stiffness[2, 2] * 0.2e-3, rel=1e-12)
    assert found.force_error == pytest.approx(bars[2, 2] / stiffness[2, 2], rel=1e-12)
    assert found.force_error == pytest.approx(alone.force_error, rel=0.05)
    double = found.scaled(Scale(20e3, 0.4e-3))
    assert np.array(double.stiffness) == pytest.approx(2 * stiffness)
    assert double.force == pytest.approx(4 * found.force)
    assert type(found).from_json(found.to_json()).stiffness == found.stiffness


def test_blade_that_slices_has_bars_on_each_component():
    records = solve(probe=BLADE | {"slice": "0.1 mm", "at": ["3 mm", "0 mm"]}, mesh={"degree": [2, 3], "rim": "0.5 mm"})
    coarse, fine = records[0,], records[1,]
    for i in (0, 2):
        assert 0 < coarse.force_vector_error[i] < 0.2 * abs(coarse.force_vector[i])
        gap = abs(coarse.force_vector[i] - fine.force_vector[i])
        assert gap <= coarse.force_vector_error[i] + fine.force_vector_error[i]
    assert coarse.force_vector_error[1] == coarse.force_vector[1] == 0.0
    assert coarse.force_error == pytest.approx(coarse.force_vector_error[2] / coarse.force)


def test_dataset_has_the_stiffness():
    found = solved_dataset(probe={"motion": ["press", "all"]}, mesh={"degree": 1})
    stiffness = found["stiffness"]
    assert stiffness.dims == ("motion", "movement", "reaction")
    assert np.isnan(stiffness.sel(motion="press")).all()
    matrix = stiffness.sel(motion="all").values
    assert np.array_equal(matrix, matrix.T)
    depth = 0.2e-3
    assert float(found["force"][1]) == pytest.approx(depth * matrix[2, 2])
    frame = found.epsmesh.to_frame()
    assert len(frame) == 2
    assert frame["stiffness_z_z"][1] == matrix[2, 2]
    assert frame["stiffness_error_rz_rz"][1] > 0
    assert frame["force_error_z"][1] == pytest.approx(found["force_error"].values[1])


def solved_dataset(**changes):
    plan = make_plan(study(**changes))
    return build(plan, compute(plan, MPI.COMM_SELF))


def test_what_several_movements_change_in_a_plan():
    """No symmetry, no axisymmetry and no reduced basis for all motions; F_exact is that of the press."""
    round_body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
    ratios = [0.035 * n for n in range(12)]
    press, every = (
        make_plan(study(
            body=round_body, material={"poisson": ratios}, probe={"motion": motion}, solve={"exact": True},
            plan={"without": []}, mesh={"epsilon": ["8 mm", "full"], "outside": "coarse"},
        ))
        for motion in ("press", "all")
    )  # fmt: skip
    assert any(solve.reduced for solve in press.solves)
    assert not any(solve.reduced or solve.mirrors for solve in every.solves if not solve.is_reference)
    assert press.reference_keys == every.reference_keys
    assert all(solve.axisymmetric for solve in every.solves if solve.is_reference)


def test_estimates_count_the_movements():
    seconds = []
    for changes in ({}, {"slice": "0.1 mm"}, {"motion": "all"}):
        plan = make_plan(study(probe=BLADE | {"at": ["3 mm", "1 mm"]} | changes))
        seconds.append(sum(plan.cost.step(step).seconds for step in plan.meshes))
    assert seconds[0] < seconds[1] < seconds[2]
    assert seconds[1] < 2 * seconds[0]
    assert seconds[2] < 6 * seconds[0]


def test_a_slide_takes_a_finer_mesh():
    """The bar on the axial force includes the error of the slide, unless symmetry decouples them."""
    finest = []
    for changes in ({"at": ["3 mm", "0 mm"]}, {"at": ["3 mm", "0 mm"], "slice": "0.3 mm"}, {"slice": "0.3 mm"}):
        plan = make_plan(study(probe=BLADE | changes, mesh={"accuracy": "0.3 %", "epsilon": None, "fine": None,
                               "coarse": None, "rim": None, "growth": None, "degree": None}))  # fmt: skip
        (solve,) = plan.solves
        finest.append((solve.case.mesh.degree, -solve.case.mesh.rim))
    assert finest[1] > finest[0] == finest[2]


@pytest.mark.parametrize("mirrored", [(), (0,), (0, 1)])
def test_imbalance_is_relative_to_a_translation_of_the_same_energy(mirrored):
    """For a translation relative to its force; for a rotation, whose force may vanish, to that translation's."""
    movement = Movement((Motion(direction=(0.0, 0.0, 1.0)), Motion(rotation=(0.0, 0.0, 1.0))), (1.0, 1.0))
    energies, off = np.array([400.0, 1.0]), 1e-3
    straight = np.array([[0.0, 0.0, 400.0], [0.0, 0.0, 0.0]])

    def missed(of_push=0.0, of_turn=0.0, of_work=0.0):
        on_support = -straight + [[0.0, 0.0, of_push], [0.0, 0.0, of_turn]]
        return Sums(straight, on_support, np.add(energies, [0.0, of_work]), np.zeros(2)).imbalance(
            energies, movement, mirrored
        )

    assert missed() == 0.0
    assert missed(of_push=off) == pytest.approx(off / 400)
    assert missed(of_turn=off) == pytest.approx(off / 20)
    assert missed(of_work=off) == pytest.approx(off)
