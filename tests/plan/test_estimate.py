"""Estimates made before a case is meshed: right within a factor of two, over sizes, probes and columns."""

import subprocess
import sys

import pytest

from pipeline.mesh.of_case import mesh_arrays
from pipeline.plan import estimate
from tests.cases import BLADE, solve, study

MESHES = {
    "coarse": {"fine": "5 mm", "rim": "1 mm"},
    "fine": {"fine": "2 mm", "rim": "0.5 mm"},
    "rim": {"fine": "4 mm", "rim": "0.05 mm", "growth": 0.5},
    "ball": {"epsilon": "8 mm", "fine": "1.2 mm", "rim": "0.5 mm", "growth": 0.5},
    "column": {"epsilon": "8 mm", "fine": "1.2 mm", "rim": "0.5 mm", "outside": "free"},
}


@pytest.mark.parametrize("probe", ["disc", "blade"])
@pytest.mark.parametrize("name", MESHES)
def test_cells(name, probe):
    changes = {"mesh": MESHES[name] | {"degree": 1, "model": "3d"}} | ({"probe": BLADE} if probe == "blade" else {})
    (record,) = solve(**changes).values()
    assert 0.5 < estimate.cells(study(**changes).case(())) / record.cells < 2.0


ORGAN = {"shape": "surface", "file": "meshes/kidney.obj", "unit": "mm", "fixed": {"below": "-10 mm"}}
BALL = {"name": "ball", "at": ["0 mm", "0 mm", "-6 mm"], "radius": "3 mm", "young": "9 kPa", "poisson": 0.3}
LAYER = {"name": "skin", "thickness": "1 mm", "young": "60 kPa", "poisson": 0.45}


@pytest.mark.parametrize("body", [ORGAN, {"inclusion": [BALL]}, {"layers": [LAYER]}], ids=["organ", "tumour", "skin"])
def test_cells_that_a_surface_and_regions_ask_for(body):
    sizes = {"fine": "15 mm", "coarse": "15 mm", "growth": 0.5}
    case = study(body=body, probe={"at": ["0 mm", "0 mm"]}, mesh=sizes).case(())
    assert 0.55 < estimate.cells(case) / len(mesh_arrays(case, ()).cells) < 1.6


@pytest.mark.parametrize("method", ["direct", "iterative"])
def test_memory_of_a_solve_is_not_underestimated(method):
    """In a process of its own: one that has solved before keeps memory for the next time."""
    code = (
        "from tests.cases import solve;"
        f"(r,) = solve(mesh={{'fine': '2.5 mm', 'model': '3d'}}, solve={{'method': '{method}'}}).values();"
        "print(r.memory, r.dofs)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    memory, dofs = map(float, done.stdout.split())
    estimated = max(estimate.solving_memory(dofs, 2, direct=method == "direct"), estimate.enriched_memory(dofs, 2))
    assert memory < 1.3 * estimated < 3 * memory
