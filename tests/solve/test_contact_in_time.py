"""Found contact in time steps: Lee and Radok while it grows, Ting while it shrinks, its loss, friction and loads."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve import time_steps
from epsmesh.solve.history import Course, History
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.solution import Request, Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.viscoelastic import Motion, Terms, follow
from tests.cases import solve, study

TERMS = ((0.4, 0.5), (0.2, 3.0))
BALL = {"shape": "sphere", "radius": "4 mm", "depth": "1 mm"}
MESH = {"rim": "0.5 mm", "fine": "4 mm", "coarse": "6 mm", "growth": 1.5}
LINEAR, LARGE = {"poisson": 0.4}, {"poisson": 0.4, "law": "neo-hookean"}
HOLD = (0.0, 1.0, 4.0), (0.0, 1.0, 1.0)
BACK = (0.0, 1.0, 1.5), (0.0, 1.0, 0.0)
LONG = (0.0, 1.0, 500.0), (0.0, 1.0, 1.0)
LEFT = 1 - sum(share for share, _ in TERMS)
GRAVITY = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
HEAVY = {"density": "1060 kg/m^3"}
DISC = {"shape": "disc", "radius": "3 mm", "depth": "0.5 mm"}


def followed(
    motion, terms: Terms, steps: int, comm=MPI.COMM_SELF, probe=BALL, planes=("x", "y"), **changes
) -> tuple[History, Solution]:
    """Return the history of a ball, ``steps`` for each part of the motion, and the static solution at its depth."""
    times = np.unique(np.concatenate([np.linspace(a, b, steps + 1) for a, b in pairwise(motion[0])]))
    breaks = frozenset(np.flatnonzero(np.isin(times, motion[0])).tolist())
    course = Course(tuple(times), tuple(np.interp(times, *motion)), breaks)
    case = study(**{"probe": probe, "mesh": MESH} | changes).case(())
    with Spaces(mesh_case(case, planes, comm)) as spaces, problem_of(spaces, case) as problem:
        law = law_of(case)
        law = MaterialLaw(tuple(replace(each, relaxation=terms) for each in law.parameters))
        solution = problem.answer(Request(law, movement_of(case), course=course))
        assert solution.history is not None
        return solution.history, solution


def convolved(times: FloatArray, forces: FloatArray) -> FloatArray:
    """Return the hereditary integral of elastic forces that are linear between times."""
    found = np.zeros(len(times))
    for end, time in enumerate(times):
        for start in range(end):
            step = times[start + 1] - times[start]
            left = 1.0 - sum(share for share, _ in TERMS)
            for share, tau in TERMS:
                left += (
                    share * tau / step * (np.exp((times[start + 1] - time) / tau) - np.exp((times[start] - time) / tau))
                )
            found[end] += left * (forces[start + 1] - forces[start])
    return found


@pytest.mark.parametrize("element", ["displacement", pytest.param("mixed", marks=pytest.mark.nightly)])
def test_growing_contact_on_linear_tissue_is_the_hereditary_integral(element):
    """E. H. Lee and J. R. M. Radok 1960."""
    changes = {"material": LINEAR, "mesh": MESH | {"element": element}}
    elastic, static = followed(HOLD, (), 5, **changes)
    found, _ = followed(HOLD, TERMS, 5, **changes)
    assert elastic.forces[5, 2] == pytest.approx(static.reaction[2], rel=2e-4)
    assert found.forces[:, 2] == pytest.approx(
        convolved(found.times, elastic.forces[:, 2]), abs=1e-7 * static.reaction[2]
    )
    assert (np.diff(found.dissipated) >= 0).all()
    assert found.areas == pytest.approx(elastic.areas, rel=1e-6)  # the area does not depend on the modulus


def test_contact_in_time_without_relaxation_is_the_static_one():
    """Other code finds the static set. In degree 2, unlike in degree 3, the two differ in corners at the edge."""
    motion = (0.0, 1.0), (0.0, 1.0)
    elastic, static = followed(motion, (), 2, material=LINEAR, mesh=MESH | {"degree": 3, "rim": "0.8 mm"})
    assert elastic.forces[-1, 2] == pytest.approx(static.reaction[2], rel=1e-7)
    assert elastic.areas[-1] == pytest.approx(static.contact.area, rel=1e-7)


def test_shrinking_contact_on_linear_tissue_is_that_of_an_earlier_time():
    """T. C. T. Ting 1966. Contact is lost before the tool is back, and then has no force."""
    elastic, _ = followed(BACK, (), 8, material=LINEAR)
    found, _ = followed(BACK, TERMS, 8, material=LINEAR)
    up = slice(1, 9)
    depths = np.interp(elastic.times[up], *BACK)
    known = follow(Motion(*BACK), TERMS, found.times, depths, 1.5).weights @ elastic.forces[up, 2]
    assert elastic.forces[8:, 2] == pytest.approx(elastic.forces[8::-1, 2], abs=1e-6 * elastic.forces[8, 2])
    assert found.forces[8:, 2] == pytest.approx(known[8:], abs=0.01 * known[8])
    assert not found.forces[-3:].any()
    assert not found.areas[-3:].any()
    assert (found.forces[:, 2] >= 0).all()
    assert (np.diff(found.dissipated) >= 0).all()
    assert np.abs(found.imbalance).max() < 0.03 * found.dissipated[-1]


def test_a_law_of_large_displacements_relaxes_as_linear_tissue_at_a_small_depth():
    changes = {"material": LARGE, "mesh": MESH | {"rim": "0.25 mm"}, "probe": BALL | {"depth": "0.05 mm"}}
    (elastic, static), (found, _) = (followed(HOLD, terms, 3, **changes) for terms in ((), TERMS))
    assert elastic.forces[-1, 2] == pytest.approx(static.reaction[2], rel=1e-6)
    assert found.forces[3:, 2] == pytest.approx(convolved(found.times, elastic.forces[:, 2])[3:], rel=3e-3)


def test_a_law_of_large_displacements_relaxes_while_held_and_lets_go():
    motion = (0.0, 1.0, 3.0, 3.5), (0.0, 1.0, 1.0, 0.0)
    found, static = followed(motion, TERMS, 4, material=LARGE)
    forces = found.forces[:, 2]
    assert (np.diff(forces[:5]) > 0).all()
    assert (np.diff(forces[4:]) <= 0).all()
    assert forces[4] < static.reaction[2]
    assert forces[-1] == 0
    assert (np.diff(found.dissipated) >= 0).all()
    assert np.abs(found.imbalance).max() < 0.1 * found.dissipated[-1]


# ---- friction ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", [LINEAR, pytest.param(LARGE, marks=pytest.mark.nightly)], ids=["linear", "large"])
def test_friction_in_time_is_that_of_the_load_path(material):
    """Without relaxation; and next to no friction is none, with relaxation."""
    found, static = followed(HOLD, (), 6, probe=BALL | {"friction": 0.3}, material=material)
    assert found.forces[6, 2] == pytest.approx(static.reaction[2], rel=6e-4)  # other steps
    assert found.forces[-1, 2] == pytest.approx(found.forces[6, 2], rel=1e-6)  # nothing relaxes
    (small, _), (none, _) = (
        followed(HOLD, TERMS, 8, probe=BALL | more, material=material) for more in ({"friction": 1e-6}, {})
    )
    assert small.forces[:, 2] == pytest.approx(none.forces[:, 2], rel=1e-6)
    assert small.dissipated == pytest.approx(none.dissipated, abs=5e-5 * none.dissipated[-1])  # residuals differ


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.nightly)])
def test_bars_of_few_steps_hold(friction):
    """The bar is from half as many steps, although the rate may change at each time; 16 times the steps tell it."""
    changes = {"material": {"poisson": 0.2}, "probe": BALL | {"depth": "2 mm", "friction": friction}}
    one = (0.0, 1.0), (0.0, 1.0)
    few, many = (followed(one, ((0.5, 0.1),), steps, **changes)[0] for steps in (1, 16))
    assert few.times.tolist() == [0.0, 0.5, 1.0]
    assert 0 < abs(few.forces[-1, 2] - many.forces[-1, 2]) <= few.bars[-1] + many.bars[-1]
    assert few.bars[-1] < 0.05 * few.forces[-1, 2]


def test_a_jump_with_friction_has_the_bar_of_its_steps(monkeypatch):
    """However many there are: the force depends on the path of nodes that stick."""
    jump, scene = ((0.0, 1.0), (1.0, 1.0)), {"probe": BALL | {"friction": 0.3}, "material": {"poisson": 0.2}}
    found, static = followed(jump, (), 1, **scene)
    monkeypatch.setattr(time_steps, "_FEWEST_WITH_FRICTION", 16)
    many, _ = followed(jump, (), 1, **scene)
    assert (np.abs(found.forces[:, 2] - many.forces[:, 2]) <= found.bars).all()
    assert abs(found.forces[0, 2] - static.reaction[2]) <= found.bars[0] + 1e-3 * static.reaction[2]
    assert 1e-5 < found.bars[0] / static.reaction[2] < 0.01


def test_work_of_a_tool_that_rubs_and_returns_is_its_heat():
    """Elastic tissue keeps nothing; tissue that sticks turns nothing into heat."""
    found, _ = followed(BACK, (), 6, probe=BALL | {"friction": 0.1}, material=LINEAR)
    assert not found.forces[-1].any()
    work = found.imbalance[-1] + found.dissipated[-1]
    assert found.dissipated[-1] == pytest.approx(work, rel=0.1)
    assert found.dissipated[-1] > 0
    assert np.diff(found.dissipated).min() > -0.05 * found.dissipated[-1]
    sticks, _ = followed(HOLD, (), 3, probe=BALL | {"friction": "stick"}, material=LINEAR)
    assert abs(sticks.dissipated[-1]) < 1e-3 * found.forces[6, 2] * 1e-3


@pytest.mark.nightly
def test_tissue_with_friction_relaxes_and_lets_go():
    found, _ = followed(BACK, TERMS, 6, probe=BALL | {"friction": 0.3}, material=LARGE)
    smooth, _ = followed(BACK, TERMS, 6, material=LARGE)
    assert found.forces[:, 2] == pytest.approx(smooth.forces[:, 2], abs=0.01 * smooth.forces[6, 2])
    assert not found.forces[-2:].any()
    assert found.dissipated[-1] > 0
    assert np.abs(found.imbalance).max() < 0.2 * found.dissipated[-1]


@pytest.mark.nightly
def test_friction_on_a_quarter_is_that_of_the_whole():
    changes = {"probe": BALL | {"friction": 0.3}, "material": LINEAR, "mesh": MESH | {"rim": "0.8 mm"}}
    quarter, whole = (followed(HOLD, TERMS, 3, planes=planes, **changes)[0] for planes in (("x", "y"), ()))
    assert quarter.forces[:, 2] == pytest.approx(whole.forces[:, 2], rel=0.02)
    assert quarter.dissipated[-1] == pytest.approx(whole.dissipated[-1], rel=0.02)


# ---- loads ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", [LINEAR, pytest.param(LARGE, marks=pytest.mark.nightly)], ids=["linear", "large"])
@pytest.mark.parametrize("probe", [BALL, DISC], ids=["ball", "disc"])
def test_under_loads_tissue_that_does_not_relax_has_the_static_force(probe, material):
    found, static = followed(HOLD, (), 3, probe=probe, material=material | HEAVY, load=GRAVITY)
    assert found.forces[3:, 2] == pytest.approx(static.reaction[2], rel=1e-7)
    if probe is BALL:
        assert found.sag == pytest.approx(static.contact.sag, rel=1e-9)
        assert found.load_energy == pytest.approx(static.contact.load_energy, rel=1e-9)


@pytest.mark.parametrize("material", [pytest.param(LINEAR, marks=pytest.mark.nightly), LARGE], ids=["linear", "large"])
@pytest.mark.parametrize("probe", [BALL, DISC], ids=["ball", "disc"])
def test_under_loads_tissue_relaxes_to_the_softer_one_under_the_same_loads(probe, material):
    scene = {"probe": probe, "load": GRAVITY}
    found, static = followed(LONG, TERMS, 4, material=material | HEAVY, **scene)
    softer = material | HEAVY | {"young": f"{10 * LEFT} kPa"}
    _, left = followed(((0.0, 1.0), (0.0, 1.0)), (), 1, material=softer, **scene)
    assert found.forces[-1, 2] == pytest.approx(left.reaction[2], rel=1e-5)
    assert left.reaction[2] < found.forces[:, 2].max() < static.reaction[2] * (1.0 if material is LINEAR else 1.1)
    if probe is BALL:
        assert found.sag == pytest.approx(left.contact.sag, rel=1e-6)
    assert (np.diff(found.dissipated) >= 0).all()
    assert np.abs(found.imbalance).max() < 0.2 * found.dissipated[-1]


def test_a_tool_may_touch_no_node_at_first():
    """The first touch of a cone under a load is a corner, which follows its neighbours: no node is active."""
    cone = {"shape": "cone", "depth": "0.2 mm", "angle": "70 deg", "radius": "8 mm", "tip": "1 mm"}
    ((_, found),) = solve(
        body={"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"},
        material={
            "young": "10 kPa",
            "poisson": 0.3,
            "relaxation": [{"share": 0.4, "time": "2 s"}, {"share": 0.2, "time": "30 s"}],
        },
        probe=cone | {"contact": "unilateral", "history": {"ramp": "1 s", "hold": "5 s"}},
        load={"traction": [{"on": "free", "pressure": "0.2 kPa"}]},
        mesh={"epsilon": "8 mm", "fine": "3 mm", "coarse": "8 mm", "rim": "0.3 mm", "growth": 0.8, "outside": "coarse"},
    ).items()
    assert found.status == "ok", found.message
    assert found.course["force"][0] == 0.0


def test_a_bonded_tool_on_linear_tissue_does_not_feel_the_loads():
    """Superposition; the force counts from the surface as the loads leave it."""
    changes = {"probe": DISC, "material": LINEAR | HEAVY}
    (loaded, _), (alone, _) = (followed(HOLD, TERMS, 3, load=load, **changes) for load in (GRAVITY, {}))
    assert loaded.forces[:, 2] == pytest.approx(alone.forces[:, 2], rel=1e-7)
    assert loaded.dissipated == pytest.approx(alone.dissipated, rel=1e-6)


def test_a_study_with_friction_and_loads_over_time():
    relaxing = HEAVY | {"relaxation": [{"share": 0.4, "time": "0.5 s"}]}
    probe = BALL | {"friction": 0.3, "history": {"ramp": "1 s", "hold": "2 s", "steps": 4}}
    ((_, found),) = solve(material=LINEAR | relaxing, probe=probe, mesh=MESH, load=GRAVITY).items()
    assert found.status == "ok", found.message
    _, static = followed(HOLD, (), 1, material=LINEAR | HEAVY, load=GRAVITY)
    assert found.sag == pytest.approx(static.contact.sag / 0.6, rel=1e-6)
    assert np.isnan(found.friction_force)
    assert found.load_force == 0.0


@pytest.mark.mpi
@pytest.mark.nightly
def test_ranks_agree():
    own, shared = (followed(BACK, TERMS, 3, comm, material=LARGE)[0] for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert shared.forces[:, 2] == pytest.approx(own.forces[:, 2], abs=1e-6 * own.forces[3, 2])


@pytest.mark.mpi
@pytest.mark.nightly
def test_ranks_agree_on_friction_under_loads():
    changes = {"probe": BALL | {"friction": 0.3}, "material": LINEAR | HEAVY, "load": GRAVITY}
    own, shared = (followed(BACK, TERMS, 3, comm, **changes)[0] for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert shared.forces[:, 2] == pytest.approx(own.forces[:, 2], abs=1e-5 * own.forces[3, 2])
    assert shared.dissipated[-1] == pytest.approx(own.dissipated[-1], rel=1e-4)


def test_a_study_of_found_contact_over_time_has_force_and_area():
    history = {"ramp": "1 s", "hold": "2 s", "steps": 4}
    material = LARGE | {"relaxation": [{"share": 0.4, "time": "0.5 s"}]}
    records = solve(material=material, probe=BALL | {"history": history}, mesh=MESH)
    last = records[max(records)]
    assert last.status == "ok", last.message
    assert len(last.course["area"]) == len(last.course["time"])
    assert last.course["force"][-1] < max(last.course["force"]) < last.force
