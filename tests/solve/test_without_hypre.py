"""PETSc's own algebraic multigrid, where PETSc has no hypre: as robust, for jumps, near locking and flat elements."""

from pathlib import Path

import pytest
from mpi4py import MPI

from epsmesh.plan import schedule
from epsmesh.solve import krylov
from tests.cases import solve

LIVER = Path(__file__).parents[2] / "meshes" / "liver.stl"
BALL = {"name": "stiff", "radius": "4 mm", "at": ["0 mm", "0 mm", "-9 mm"], "young": "100 MPa", "poisson": 0.3}
SKIN = {"name": "skin", "thickness": "2 mm", "young": "100 MPa", "poisson": 0.3}
ORGAN = {"shape": "surface", "file": str(LIVER), "unit": "mm", "fixed": {"below": "-20 mm"}, "size": None}
SCENES = {
    "inclusion, 1e4 times stiffer": ({"body": {"inclusion": [BALL]}}, 25),
    "thin layer, 1e4 times stiffer": ({"body": {"layer": [SKIN]}}, 100),
    "near locking": ({"material": {"poisson": 0.49}}, 30),
    "degree 1": ({"material": {"poisson": 0.45}, "mesh": {"degree": 1, "fine": "3 mm"}}, 30),
    "incompressible": ({"material": {"poisson": 0.5}}, 30),
    "flat elements of an organ": (
        {"body": ORGAN, "probe": {"at": ["-25 mm", "0 mm"]}, "mesh": {"fine": "10 mm", "coarse": "20 mm"}},
        25,
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("scene", SCENES)
def test_without_hypre_a_force_is_that_of_a_factorisation(monkeypatch, scene):
    """In few iterations, on several ranks too; on one rank every run has the same bits."""
    if scene.endswith("organ"):
        pytest.importorskip("igl")
    monkeypatch.setattr(krylov, "has_hypre", lambda: False)
    monkeypatch.setattr(schedule, "_FEWEST_CELLS", 1)  # all ranks solve it together
    changes, most = SCENES[scene]
    (found,), (again,), (exact,) = (
        solve(MPI.COMM_WORLD, **changes, solve={"method": method}).values()
        for method in ("iterative", "iterative", "direct")
    )
    assert found.status == exact.status == "ok", found.message
    # On several ranks, partitions and with them roundings may differ from run to run.
    assert found.force == pytest.approx(exact.force, rel=1e-7 if MPI.COMM_WORLD.size == 1 else 3e-7)
    assert 1 < found.iterations <= most
    if MPI.COMM_WORLD.size == 1:
        assert (again.force, again.iterations) == (found.force, found.iterations)
