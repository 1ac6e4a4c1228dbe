"""A run: failures are recorded and the rest goes on, ranks agree, and nothing that is made stays."""

import itertools
import re
import subprocess
import sys
from dataclasses import replace
from math import isnan

import psutil
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.plan.plan import make_plan
from epsmesh.run import meshing, problem
from epsmesh.run.basis import ReducedBasis
from epsmesh.run.execute import compute, execute
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.progress import Progress
from epsmesh.solve import SolveError
from epsmesh.solve.balance import BALANCE_LIMIT
from epsmesh.stages import Times, recharge
from tests.cases import BLADE, solve, study
from tests.commands import ENVIRONMENT, MPIRUN

WORLD = MPI.COMM_WORLD
SCENE = {"probe": BLADE, "material": {"poisson": [0.3, 0.49]}, "mesh": {"rim": "0.5 mm", "fine": "4 mm"}}
SCRIPT = """
from mpi4py import MPI
from epsmesh.plan import schedule
from tests.cases import solve
from tests.run.test_execute import SCENE
schedule._FEWEST_CELLS = 1
for method in ("iterative", "direct"):
    for key, record in solve(MPI.COMM_WORLD, **SCENE, solve={"method": method}).items():
        assert record.is_ok, record.message
        if MPI.COMM_WORLD.rank == 0:
            print("force", repr(record.force), record.cells)
"""


@pytest.mark.nightly
@pytest.mark.skipif(WORLD.size > 1, reason="starts mpirun itself")
def test_one_and_three_ranks_agree():
    """What two ranks compute, the tests with the mark mpi hold against one."""
    command = [*MPIRUN, "3", sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    three = [(float(force), int(cells)) for force, cells in re.findall(r"force (\S+) (\d+)", done.stdout)]
    alone = [
        record for method in ("iterative", "direct") for record in solve(**SCENE, solve={"method": method}).values()
    ]
    assert len(alone) == 4
    for record, (force, cells) in zip(alone, three, strict=True):
        assert cells == record.cells
        assert force == pytest.approx(record.force, rel=1e-8)


@pytest.fixture
def together(monkeypatch):
    """No mesh is too small for all ranks."""
    monkeypatch.setattr("epsmesh.plan.schedule._FEWEST_CELLS", 1)


@pytest.mark.mpi
@pytest.mark.usefixtures("together")
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_forces_balance(degree):
    # Linear elements need a fine rim: on a coarser one the error bar is near that from where a case is refused.
    mesh = {"degree": degree, "rim": "0.2 mm" if degree == 1 else "1 mm"}
    (record,) = solve(WORLD, probe=BLADE | {"slice": "0.1 mm"}, mesh=mesh).values()
    assert record.status == "ok"
    assert record.balance < BALANCE_LIMIT
    assert record.force > 0
    work = record.force * 0.1e-3 - record.force_vector[0] * 0.1e-3
    assert work == pytest.approx(2 * record.energy, rel=1e-7)


@pytest.mark.mpi
def test_failed_cases_are_recorded_and_the_rest_goes_on():
    """Elements of a nanometre's thousandth fit into no machine: refused, not made."""
    records = solve(WORLD, mesh={"rim": ["1e-9 mm", "1 mm"]})
    assert records[0,].status == "failed"
    assert re.search(r"needs about .* GB of memory; .* GB are available, and a case may use 90 %", records[0,].message)
    assert records[1,].status == "ok"


@pytest.mark.mpi
def test_solver_that_fails_is_a_failed_case_and_the_others_are_as_without_it(monkeypatch):
    ratios = {"material": {"poisson": [0.2, 0.3, 0.4]}, "solve": {"method": "iterative", "exact": False}}
    whole = solve(WORLD, **ratios)

    def solve_problem(case, *arguments, **options):
        if case.material.poisson == 0.3:
            raise SolveError("the linear solver did not converge: diverged_dtol after 7 iterations")
        return problem.solve_problem(case, *arguments, **options)

    monkeypatch.setattr("epsmesh.run.runner.solve_problem", solve_problem)
    records = solve(WORLD, **ratios)
    assert [records[i,].status for i in range(3)] == ["ok", "failed", "ok"]
    assert "did not converge: diverged_dtol" in records[1,].message
    assert isnan(records[1,].force)
    for index in (0, 2):
        assert records[index,].force == pytest.approx(whole[index,].force, rel=1e-8)


@pytest.mark.mpi
def test_cases_whose_reduced_basis_fails_are_solved(monkeypatch):
    """A reduction may fail; what it was to spare is then done."""

    class Broken:
        def __init__(self, *_):
            raise SolveError("the basis fell apart")

    ratios = {"material": {"poisson": [0.035 * i for i in range(12)]}}
    solved = solve(WORLD, **ratios, plan={"without": ["axisymmetric", "reduced"]})
    monkeypatch.setattr("epsmesh.run.basis.ReducedBasis", Broken)
    found = solve(WORLD, **ratios)
    assert found.keys() == solved.keys()
    for index, record in found.items():
        assert record.status == "ok", record.message
        assert record.force == pytest.approx(solved[index].force, rel=1e-8)


@pytest.mark.mpi
def test_a_bound_that_is_none_is_not_relied_on(monkeypatch):
    class Doubtful(ReducedBasis):
        def evaluate(self, t):
            return replace(super().evaluate(t), bound=-1e-9)

    monkeypatch.setattr("epsmesh.run.basis.ReducedBasis", Doubtful)
    records = solve(WORLD, material={"poisson": [0.035 * i for i in range(12)]})
    assert {record.origin for record in records.values()} == {"symmetric"}


@pytest.mark.mpi
def test_without_memory_for_a_reduced_basis_every_case_is_solved(monkeypatch):
    ratios = {"poisson": [0.035 * i for i in range(12)]}
    monkeypatch.setattr("epsmesh.plan.estimate.basis_memory", lambda *_: 1e18)
    solved = solve(WORLD, material=ratios)
    assert {record.origin for record in solved.values()} == {"symmetric"}
    monkeypatch.undo()
    reduced = solve(WORLD, material=ratios)
    assert {record.origin for record in reduced.values()} == {"symmetric", "reduced"}
    for index, record in solved.items():
        assert record.force == pytest.approx(reduced[index].force, rel=1e-5)


@pytest.mark.mpi
@pytest.mark.parametrize("begin", [0, 1])
def test_bars_of_a_reduced_basis_are_unknown_where_a_neighbours_is(begin, monkeypatch):
    """Memory that suffices for every second bar: what is between a known and an unknown one claims none."""
    calls = itertools.count(begin)
    monkeypatch.setattr("epsmesh.plan.estimate.error_bar_memory", lambda *_, **__: (0.0, 1e18)[next(calls) % 2])
    records = solve(WORLD, material={"poisson": [0.02 * i for i in range(20)]})
    solved = [index for index, record in sorted(records.items()) if record.origin == "symmetric"]
    unknown = {index for index in solved if isnan(records[index].force_error)}
    assert 0 < len(unknown) < len(solved) < len(records)
    for index, record in records.items():
        neighbours = {max(i for i in solved if i <= index), min(i for i in solved if i >= index)}
        assert isnan(record.force_error) == bool(neighbours & unknown)
        assert ("the error bar needs about" in record.message) == bool(neighbours & unknown)


@pytest.mark.mpi
def test_wrong_solution_is_a_failed_case():
    """A solver told to stop early returns a solution; the balance of forces gives it away."""
    plan = make_plan(study(solve={"method": "iterative"}))
    (solve_,) = plan.solves
    loose = replace(solve_.case, solve=solve_.case.solve.model_copy(update={"energy_tolerance": 1e-3}))
    (record,) = compute(replace(plan, solves=(replace(solve_, case=loose),)), WORLD).values()
    assert record.status == "failed"
    assert "do not balance" in record.message


UNFORESEEN = [
    PETSc.Error(55),
    IndexError("tuple index out of range"),
]


@pytest.mark.mpi
@pytest.mark.usefixtures("together")
@pytest.mark.parametrize("error", UNFORESEEN)
def test_whatever_is_raised_fails_its_case_alone(monkeypatch, error):
    def solve_problem(case, *arguments, **options):
        if case.material.poisson == 0.3:
            raise error
        return problem.solve_problem(case, *arguments, **options)

    monkeypatch.setattr("epsmesh.run.runner.solve_problem", solve_problem)
    records = solve(WORLD, material={"poisson": [0.3, 0.4]})
    assert [records[i,].status for i in range(2)] == ["failed", "ok"]
    assert str(error) in records[0,].message
    assert f"{type(error).__name__}: " in records[0,].message


@pytest.mark.mpi
@pytest.mark.usefixtures("together")
def test_whatever_is_raised_on_one_rank_fails_its_case_on_all(monkeypatch):
    """The last rank alone fails, once, after the last call that needs all: others can be told of it."""
    loads = iter([ValueError("no load on the last rank")])

    def machine_load():
        if WORLD.rank == WORLD.size - 1 and (error := next(loads, None)):
            raise error
        return 1.0

    monkeypatch.setattr("epsmesh.run.runner.machine_load", machine_load)
    records = solve(WORLD, material={"poisson": [0.3, 0.4]})
    assert sorted(record.status for record in records.values()) == ["failed", "ok"]
    (failed,) = (record for record in records.values() if record.status == "failed")
    assert "ValueError: no load on the last rank" in failed.message


@pytest.mark.mpi
def test_what_is_raised_beside_any_case_fails_those_of_the_step(monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("epsmesh.run.runner.StepRunner._condenses", broken)
    records = solve(WORLD, material={"poisson": [0.3, 0.4]})
    assert [record.status for record in records.values()] == ["failed", "failed"]
    assert all("ZeroDivisionError: division by zero" in record.message for record in records.values())


def test_gmsh_failure_is_a_failed_case(monkeypatch):
    def fail(*_):
        raise Exception("no elements in volume 1")

    monkeypatch.setattr("gmsh.model.mesh.generate", fail)
    (record,) = solve().values()
    assert record.status == "failed"
    assert "no elements in volume 1" in record.message


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
@pytest.mark.nightly
def test_many_cases_do_not_grow_memory():
    """120 cases with as many meshes: what the first forty leave behind is all there ever is."""
    sizes = [f"{5 + 0.01 * i} mm" for i in range(120)]
    plan = make_plan(study(mesh={"fine": sizes, "degree": 2}, solve={"method": "iterative"}))
    resident, messages = [], []

    def keep(record):
        resident.append(psutil.Process().memory_info().rss)
        messages.append(record.message)

    failed = execute(plan, MPI.COMM_SELF, keep, Progress())
    assert not any(messages), messages
    assert failed == 0
    assert len(resident) == 120
    assert resident[-1] - resident[39] < 6e6


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
def test_timed_cases_are_medians_of_repeats_each_made_afresh(monkeypatch, tmp_path):
    """Meshes said to take 5, 1 and 3 Ms; the fourth one is that of the error bar, which is no part of the case."""
    told = iter([5e6, 1e6, 3e6, 1e8])

    def mesh_case(*arguments):
        recharge(Times(mesh=next(told)))
        return meshing.mesh_case(*arguments)

    monkeypatch.setattr("epsmesh.run.runner.mesh_case", mesh_case)
    plan = make_plan(study(solve={"timing": True, "repeats": 3, "exact": False}))
    found = []
    assert execute(plan, MPI.COMM_SELF, found.append, Progress(), cache=MeshCache(tmp_path)) == 0
    (record,) = found
    assert record.time_mesh == pytest.approx(3e6, rel=1e-4)
    assert record.time_error > 1e8
    assert record.load >= 0 < record.time_spread
    assert 0 < record.force_error < 0.5
    assert next(told, None) is None
    assert not list(tmp_path.iterdir())


def test_timed_cases_have_all_bars_that_untimed_ones_have():
    slit = {**BLADE, "width": "1 mm", "incision": "4 mm"}
    timed, untimed = (
        next(iter(solve(probe=slit, mesh={"rim": "0.5 mm"}, solve=how).values()))
        for how in ({"timing": True, "repeats": 1, "exact": False}, {"exact": False})
    )
    assert timed.energy_release == pytest.approx(untimed.energy_release, rel=1e-4)
    for name in ("force_error", "force_vector_error", "energy_release_error"):
        assert getattr(timed, name) == pytest.approx(getattr(untimed, name), rel=1e-3)
