"""A run: failures are recorded and the rest goes on, ranks agree, and nothing that is made stays."""

import os
import re
import subprocess
import sys

import psutil
import pytest
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import execute
from pipeline.run.progress import Silent
from pipeline.solve.solution import BALANCE_LIMIT
from tests.cases import BLADE, solve, study

WORLD = MPI.COMM_WORLD
SCRIPT = """
from mpi4py import MPI
from tests.cases import BLADE, solve
for method in ("iterative", "direct"):
    for key, record in solve(MPI.COMM_WORLD, probe=BLADE, material={"poisson": [0.3, 0.49]},
                             mesh={"rim": "0.5 mm", "fine": "4 mm"}, solve={"method": method}).items():
        if MPI.COMM_WORLD.rank == 0:
            print("force", repr(record.force), record.cells, record.status)
"""


def forces(ranks: int) -> list[tuple[float, int]]:
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    found = re.findall(r"force (\S+) (\d+) ok", done.stdout)
    return [(float(force), int(cells)) for force, cells in found]


@pytest.mark.skipif(WORLD.size > 1, reason="starts mpirun itself")
def test_one_two_and_three_ranks_agree():
    serial, two, three = (forces(ranks) for ranks in (1, 2, 3))
    assert len(serial) == 4
    for (a, cells), *others in zip(serial, two, three, strict=True):
        for force, count in others:
            assert count == cells
            assert force == pytest.approx(a, rel=1e-8)


@pytest.mark.mpi
def test_world_agrees_with_each_rank_alone():
    together = solve(WORLD, material={"poisson": [0.3, 0.45]})
    alone = solve(MPI.COMM_SELF, material={"poisson": [0.3, 0.45]})
    for index, record in together.items():
        assert record.status == "ok"
        assert record.force == pytest.approx(alone[index].force, rel=1e-8)
        assert record.dofs == alone[index].dofs


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_forces_balance(degree):
    mesh = {"degree": degree, "rim": "0.4 mm" if degree == 1 else "1 mm"}
    (record,) = solve(WORLD, probe=BLADE | {"slice": "0.1 mm"}, mesh=mesh).values()
    assert record.status == "ok"
    assert record.balance < BALANCE_LIMIT
    assert record.force > 0
    work = record.force * 0.1e-3 - record.force_vector[0] * 0.1e-3
    assert work == pytest.approx(2 * record.energy, rel=1e-7)


@pytest.mark.mpi
def test_failed_cases_are_recorded_and_the_rest_goes_on():
    """A held column as wide as the disc leaves no displacement between probe and support: refused, not solved."""
    records = solve(WORLD, mesh={"epsilon": ["3 mm", "8 mm"], "outside": "fixed"})
    assert records[0,].status == "failed"
    assert "touches the held face" in records[0,].message
    assert records[1,].status == "ok"


@pytest.mark.mpi
def test_what_does_not_fit_into_memory_is_refused():
    records = solve(WORLD, mesh={"fine": ["0.01 mm", "5 mm"], "rim": "0.01 mm", "epsilon": "full", "growth": 1.0})
    assert records[0,].status == "failed"
    assert re.search(r"needs about .* GB of memory, .* GB are available", records[0,].message)


@pytest.mark.mpi
def test_solver_that_does_not_converge_is_a_failed_case(monkeypatch):
    monkeypatch.setattr("pipeline.solve.linear._MOST_ITERATIONS", 2)
    (record,) = solve(WORLD, solve={"method": "iterative"}).values()
    assert record.status == "failed"
    assert "did not converge" in record.message


@pytest.mark.mpi
def test_wrong_solution_is_a_failed_case():
    """A solver told to stop early returns a solution; the balance of forces gives it away."""
    (record,) = solve(WORLD, solve={"method": "iterative", "tolerance": 1e-3}).values()
    assert record.status == "failed"
    assert "do not balance" in record.message


def test_gmsh_failure_is_a_failed_case(monkeypatch):
    def fail(*_):
        raise Exception("no elements in volume 1")

    monkeypatch.setattr("gmsh.model.mesh.generate", fail)
    (record,) = solve().values()
    assert record.status == "failed"
    assert "no elements in volume 1" in record.message


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
def test_three_hundred_cases_do_not_grow_memory():
    """300 cases with as many meshes: what the first hundred leave behind is all there ever is."""
    sizes = [f"{5 + 0.01 * i} mm" for i in range(300)]
    plan = make_plan(study(mesh={"fine": sizes, "degree": 2}, solve={"method": "iterative"}))
    resident, messages = [], []

    def keep(record):
        resident.append(psutil.Process().memory_info().rss)
        messages.append(record.message)

    failed = execute(plan, MPI.COMM_SELF, keep, Silent())
    assert not any(messages), messages
    assert failed == 0
    assert len(resident) == 300
    assert resident[-1] - resident[99] < 15e6


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
def test_timed_cases_are_medians_of_repeats():
    records = solve(mesh={"epsilon": ["6 mm", "full"]}, solve={"timing": True, "repeats": 2})
    assert all(record.status == "ok" and record.time_total > 0 for record in records.values())
