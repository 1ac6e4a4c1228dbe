"""Estimates made before a case is meshed: right within a factor of two, over sizes, probes and columns."""

import subprocess
import sys
from dataclasses import replace
from itertools import product

import pytest

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan import estimate
from epsmesh.plan.cost import CostModel, features
from epsmesh.plan.describe import summary
from epsmesh.plan.plan import make_plan
from epsmesh.plan.steps import MeshStep, OperatorStep, mesh_steps
from epsmesh.run.problem import memory_of
from tests.cases import BLADE, solve, study
from tests.folded import study_of
from tests.sampling import sampled

MESHES = {
    "coarse": {"fine": "5 mm", "rim": "1 mm"},
    "fine": {"fine": "2 mm", "rim": "0.5 mm"},
    "rim": {"fine": "4 mm", "rim": "0.05 mm", "growth": 0.5},
    "ball": {"epsilon": "8 mm", "fine": "1.2 mm", "rim": "0.5 mm", "growth": 0.5},
    "column": {"epsilon": "8 mm", "fine": "1.2 mm", "rim": "0.5 mm", "outside": "free"},
}


@sampled("name, probe", product(MESHES, ("disc", "blade")), by_day=5)
def test_cells(name, probe):
    changes = {"mesh": MESHES[name] | {"degree": 1, "model": "3d"}} | ({"probe": BLADE} if probe == "blade" else {})
    (record,) = solve(**changes).values()
    assert 0.5 < estimate.cells(study(**changes).case(())) / record.cells < 2.0


ORGAN = {"shape": "surface", "file": "meshes/kidney.obj", "unit": "mm", "fixed": {"below": "-10 mm"}}
BALL = {"name": "ball", "at": ["0 mm", "0 mm", "-6 mm"], "radius": "3 mm", "young": "9 kPa", "poisson": 0.3}
LAYER = {"name": "skin", "thickness": "1 mm", "young": "60 kPa", "poisson": 0.45}


@pytest.mark.parametrize("body", [ORGAN, {"inclusion": [BALL]}, {"layer": [LAYER]}], ids=["organ", "tumour", "skin"])
def test_cells_that_a_surface_and_regions_ask_for(body):
    sizes = {"fine": "15 mm", "coarse": "15 mm", "growth": 0.5}
    case = study(body=body, probe={"at": ["0 mm", "0 mm"]}, mesh=sizes).case(())
    assert 0.55 < estimate.cells(case) / len(mesh_arrays(case, ()).cells) < 1.6


@pytest.mark.parametrize("method", ["direct", "iterative"])
@pytest.mark.nightly
def test_memory_of_a_solve_is_not_underestimated(method):
    """In a process of its own: one that has solved before keeps memory for the next time."""
    code = (
        "from tests.cases import solve;"
        f"(r,) = solve(mesh={{'fine': '2.5 mm', 'model': '3d'}}, solve={{'method': '{method}'}}).values();"
        "print(r.memory, r.dofs)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    memory, dofs = map(float, done.stdout.split())
    estimated = max(estimate.solving_memory(dofs, 2, direct=method == "direct"), estimate.error_bar_memory(dofs, 2))
    assert memory < 1.3 * estimated < 3 * memory


@pytest.mark.nightly
@pytest.mark.parametrize("rim", [1.5, 0.9])
@pytest.mark.parametrize("history", [None, {"ramp": "1 s", "hold": "1 s", "steps": 2}], ids=["static", "in time"])
def test_memory_of_found_contact_and_time_steps_is_that_of_the_plan(history, rim):
    changes = {
        "material": {"poisson": 0.4, "law": "neo-hookean"}
        | ({"relaxation": [{"share": 0.4, "time": "0.5 s"}, {"share": 0.2, "time": "3 s"}]} if history else {}),
        "probe": {"shape": "sphere", "radius": "4 mm", "depth": "0.5 mm"} | ({"history": history} if history else {}),
        "mesh": {"rim": f"{rim} mm", "fine": f"{1.2 * rim} mm", "coarse": f"{4 * rim} mm", "growth": 0.4},
    }
    code = f"from tests.cases import solve; print(max(r.memory for r in solve(**{changes!r}).values()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    (planned,) = mesh_steps(make_plan(study(**changes)).solves)
    assert 0.7 < float(done.stdout) / CostModel().step(planned).memory < 1.3


def test_a_step_takes_what_the_largest_of_its_solves_takes():
    """Poisson's ratios of one mesh need other elements; large displacements need matrices."""
    ratios = study(material={"poisson": [0.3, 0.49]}, mesh={"fine": "0.5 mm", "rim": "0.5 mm"})
    (step,) = mesh_steps(make_plan(ratios).solves)
    each = [CostModel().step(MeshStep((OperatorStep((solve,)),))).memory for solve in step.solves]
    assert [solve.case.way.element for solve in step.solves] == ["displacement", "mixed"]
    assert CostModel().step(step).memory == max(each) > 1.2 * min(each)
    laws = [study(material={"law": law}, mesh={"fine": "1 mm"}).case(()) for law in ("linear", "neo-hookean")]
    linear, large = map(estimate.peak_memory, laws)
    assert large > 1.2 * linear


def test_a_reduced_basis_and_further_ranks_take_room_of_their_own():
    ratios = study(material={"poisson": [0.035 * n for n in range(12)]}, mesh={"fine": "1 mm"})
    plan = make_plan(ratios)
    (step,) = mesh_steps(plan.solves)
    assert step.solves[0].reduced
    alone = CostModel().step(MeshStep((OperatorStep((replace(step.solves[0], reduced=False),)),))).memory
    assert CostModel().step(step).memory > 1.15 * alone
    one, two = (summary(plan, ranks)["memory"] for ranks in (1, 2))
    assert two == estimate.on_ranks(one, 2) > one


def test_the_bar_of_a_timed_case_is_found_on_what_symmetry_leaves():
    """Its times are those of the whole body; in room, that is a quarter of a bar on all of it."""
    memory = [
        CostModel().step(MeshStep((OperatorStep((solve,)),))).memory
        for timing in (True, False)
        for solve in make_plan(
            study(mesh={"fine": "1 mm", "model": "3d"}, solve={"timing": timing}), without=("symmetry",)
        ).solves
    ]
    assert memory[0] < 0.8 * memory[1]


def test_a_plan_says_from_which_depth_on_tissue_is_expected_to_fold():
    probe = {"radius": "3 mm", "depth": ["0.6 mm", "1.2 mm"]}
    large, linear = (summary(make_plan(study(material={"law": law}, probe=probe))) for law in ("neo-hookean", "linear"))
    (note,) = large["notes"]
    assert "here 0.9 mm" in note and "1 case of 2 is deeper" in note
    assert linear["notes"] == []


def test_a_folded_surface_takes_longer_to_mesh(tmp_path):
    """Of one that is as large, and of a known mesh: its elements follow the folds, and are mended where they cross."""
    (solve,) = make_plan(study_of(tmp_path, 307)).solves
    kind, cells, poisson = features(solve)
    plain = CostModel().seconds("mesh", kind.replace("folded", "curved"), cells, poisson)
    assert kind.endswith("folded") and 0.5 < cells / 4_505 < 2.0
    assert CostModel().seconds("mesh", kind, cells, poisson) > 5 * plain


def test_friction_asks_for_a_factorisation_on_a_linear_body_alone():
    """The plan and the run agree on it."""

    def needed(law, friction):
        probe = {"shape": "sphere", "radius": "5 mm", "depth": "1 mm", "contact": "unilateral", "friction": friction}
        case = study(probe=probe, material={"law": law}, mesh={"fine": "0.5 mm", "rim": "0.5 mm"}).case(())
        return memory_of(case, 1_000_000)[0], estimate.case_memory(case, 30.0)

    assert needed("neo-hookean", 0.3) == needed("neo-hookean", 0.0)
    for linear, without in zip(needed("linear", 0.3), needed("linear", 0.0), strict=True):
        assert linear > 3 * without
