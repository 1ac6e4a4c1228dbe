"""What becomes of a computed force: kept with its bar, failed with a reason, or tried on the next mesh."""

from dataclasses import replace
from math import inf, isnan, nan

import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.attempts import Attempts
from epsmesh.run.execute import compute, execute
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.runner import StepRunner
from epsmesh.study.read import parse
from tests import cases
from tests.cases import raw, study

WORLD = MPI.COMM_WORLD
GOAL = "0.3 %"


def record(bar: float, **content) -> Record:
    return replace(Record("", "ok", force=2.0, force_error=bar, time_solve=1.0, time_error=0.5), **content)


def asked(exact: bool = False):
    """Return the solve of a case with a goal, or of its F_exact."""
    plan = make_plan(parse({**raw(), "mesh": {"accuracy": GOAL}, "solve": {"exact": True}, "plan": {}}))
    return next(solve for solve in plan.solves if solve.is_reference == exact)


def plain():
    (solve,) = make_plan(study()).solves
    return solve


def judged(solve, *records: Record) -> Record:
    """Judge the records of one attempt after the other, as far as more are asked for."""
    attempts, found = Attempts(), None
    for tried in records:
        assert found is None
        found = attempts.judge(solve, tried)
        (solve,) = attempts.take_again() or (solve,)
    assert found is not None
    assert not attempts.take_again()
    return found


@pytest.mark.parametrize("force", [nan, inf, -inf])
@pytest.mark.parametrize("solve", [plain(), asked(), asked(exact=True)])
def test_a_force_that_is_no_number_is_a_failure(solve, force):
    found = judged(solve, record(1e-4, force=force))
    assert (found.status, found.message) == ("failed", f"the computed force is {force}")


def test_an_energy_released_that_is_known_by_its_order_alone_is_left_out():
    known = judged(plain(), record(1e-2, energy_release=3.0, energy_release_error=0.4))
    assert (known.status, known.energy_release, known.message) == ("ok", 3.0, "")
    found = judged(plain(), record(1e-2, energy_release=3.0, energy_release_error=1.22))
    assert (found.status, found.force) == ("ok", 2.0)
    assert isnan(found.energy_release)
    assert isnan(found.energy_release_error)
    assert "error bar 122 %" in found.message


@pytest.mark.parametrize("bar", [nan, inf, -0.2])
@pytest.mark.parametrize("solve", [plain(), asked(), asked(exact=True)])
def test_a_bar_that_is_no_number_is_a_failure_and_no_reason_for_a_finer_mesh(solve, bar):
    found = judged(solve, record(bar))
    assert found.status == "failed"
    assert "the computed error bar is" in found.message


def test_a_force_whose_bar_had_no_memory_says_so():
    found = judged(plain(), record(nan, message="the error bar needs about 9 GB"))
    assert (found.status, found.force) == ("ok", 2.0)


@pytest.mark.parametrize("solve", [plain(), replace(asked(), later=()), replace(asked(exact=True), later=())])
def test_no_force_is_relied_on_whose_bar_is_as_large_as_itself(solve):
    assert judged(solve, record(1.2)).status == "failed"


def test_attempts_go_on_until_the_bar_is_small_and_all_their_time_counts():
    found = judged(asked(), record(0.005), record(0.004), record(0.002))
    assert (found.status, found.force_error, found.time_error) == ("ok", 0.002, 0.0)
    assert found.time_solve == 3 * 1.5
    assert found.observation() is None


def test_meshes_that_would_miss_by_as_much_are_passed_over():
    """What the first mesh missed by is known of the others, too: none is solved on that it tells to be too coarse."""
    solve = asked()
    first, expected = solve.later[0], [rung.bar for rung in solve.later]
    assert solve.again(1.01 * solve.expected).case.mesh == first.mesh
    # As far above what was expected as leaves the third to come the first that serves.
    more = 0.89 * solve.goal / expected[2]
    found = solve.again(more * solve.expected)
    assert (found.case.mesh, found.expected) == (solve.later[2].mesh, expected[2])
    assert found.later == solve.later[3:]
    # Where none serves, nothing is left out.
    assert solve.again(1e3 * solve.expected).later == solve.later[1:]


def test_no_finer_mesh_is_tried_for_what_friction_keeps():
    """Of a bar of 0.5 % finer meshes lower the rest alone: with 0.35 % of friction none can reach 0.3 %."""
    found = judged(asked(), record(0.005, friction_error=0.0035))
    assert found.status == "failed"
    assert "error bar 0.5 % exceeds the accuracy 0.3 %" in found.message
    assert "0.35 % of it is that of friction" in found.message
    assert judged(asked(), record(0.005, friction_error=1e-3), record(0.002)).status == "ok"


def test_the_next_mesh_is_that_which_leaves_room_for_friction():
    solve = asked()
    smooth, rubbing = (solve.again(2 * solve.expected + kept, kept).expected for kept in (0.0, 0.002))
    assert rubbing < smooth
    assert 2 * rubbing + 0.002 <= solve.goal


def test_an_accuracy_that_is_missed_for_another_reason_says_both():
    lost = Record("", "failed", "no memory left")
    found = judged(asked(), record(0.02), lost)
    assert found.status == "failed"
    assert "error bar 2 % exceeds the accuracy 0.3 %" in found.message
    assert "no memory left" in found.message
    assert judged(asked(), lost).message == "no memory left"


def test_exact_force_is_the_best_that_was_found():
    """Its own bar says how good it is: a finer mesh that fails, or is worse, takes nothing away."""
    solve = asked(exact=True)
    assert judged(solve, record(0.002, force=3.0), Record("", "failed", "no memory")).force == 3.0
    solve = replace(solve, later=solve.later[:1])
    found = judged(solve, record(0.002, force=3.0), record(0.004))
    assert (found.status, found.force, found.force_error) == ("ok", 3.0, 0.002)


class Notes(Progress):
    """Remembers what was worked on."""

    def __init__(self):
        self.texts = []

    def note(self, text):
        self.texts.append(text)


@pytest.mark.mpi
def test_accuracy_without_memory_for_its_proof_is_refused_and_no_finer_mesh_is_tried(monkeypatch):
    """The force would be worth nothing: neither the case nor F_exact has one."""
    changes = {"mesh": {"accuracy": GOAL, "degree": 2}, "solve": {"exact": True, "method": "iterative"}, "plan": {}}
    plan = make_plan(parse({**raw(), **changes}), without=("axisymmetric",))
    monkeypatch.setattr("epsmesh.run.memory.FreeMemory.available", lambda self: 1e9)
    monkeypatch.setattr("epsmesh.plan.estimate.error_bar_memory", lambda *_, **__: 2e9)
    found, notes = [], Notes()
    execute(plan, WORLD, found.append, notes)
    if WORLD.rank == 0:
        records = {record.key: record for record in found}
        case, exact = (records[solve.key] for solve in plan.solves)
        assert (case.status, exact.status) == ("failed", "failed")
        assert "the error bar that proves the accuracy needs about" in case.message
        assert "GB of memory" in exact.message
    assert sum(text == "meshing: the one case" for text in notes.texts) <= 1


def test_a_solve_that_waits_for_its_next_mesh_has_one_record_whatever_else_fails(monkeypatch):
    """A step that fails beside any case takes down those that have no record, and not the one that is to go on."""

    on_mesh, bars, found = StepRunner._on_mesh, iter((1.0, 1e-9)), []

    def breaks(runner, step, memory):
        on_mesh(runner, step, memory)
        if not found:
            raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(StepRunner, "_solve", lambda _, solve, *__: record(next(bars), key=solve.key))
    monkeypatch.setattr(StepRunner, "_on_mesh", breaks)
    wanted = {"mesh": {"accuracy": GOAL}, "solve": {"exact": False}, "plan": {}}
    plan = make_plan(parse({**raw(), **wanted}), without=("axisymmetric",))
    assert execute(plan, MPI.COMM_SELF, found.append, Progress()) == 0
    assert [(one.key, one.status) for one in found] == [(plan.keys[0], "ok")]


@pytest.mark.mpi
def test_timed_case_of_an_accuracy_has_the_force_of_an_untimed_one():
    def force(**solve):
        plan = make_plan(parse({**raw(), "mesh": {"accuracy": "3 %"}, "solve": {"exact": False, **solve}, "plan": {}}))
        (found,) = compute(plan, WORLD).values()
        assert found.status == "ok", found.message
        return found

    timed, untimed = force(timing=True, repeats=2), force()
    assert timed.force == pytest.approx(untimed.force, rel=1e-4)
    assert timed.force_error == pytest.approx(untimed.force_error, rel=0.05)
    assert (timed.time_error, timed.time_total > 0) == (0.0, True)


def test_a_force_that_failed_is_no_yardstick():
    """Of a full order that failed there is no F/F_max, whatever number came out; nor is there F/F_exact."""
    plan = make_plan(study(mesh={"epsilon": ["6 mm", "full"]}, solve={"exact": True}))
    records = {}
    for solve in plan.solves:
        content = {"young": solve.case.material.young, "depth": solve.case.probe.depth}
        bad = solve.is_reference or solve.case.is_full
        records[solve.key] = replace(
            record(0.01, force=1.0, force_vector=(0.0, 0.0, 1.0), energy=1.0, **content), key=solve.key,
            status="failed" if bad else "ok", message="no" if bad else "",
        )  # fmt: skip
    data = build(plan, records)
    assert data["force"].notnull().values.tolist() == [True, False]
    for name in ("force_max", "force_ratio", "force_exact", "force_exact_ratio"):
        assert data[name].isnull().all(), name


SMALL = {"shape": "sphere", "radius": "4 mm", "contact": "unilateral"}


def of_hertz(depth: float, poisson: float) -> float:
    """Return F (N) of a ball of 4 mm in 10 kPa at a ``depth`` (m), by H. Hertz."""
    return 4 / 3 * 1e4 / (1 - poisson**2) * 4e-3**0.5 * depth**1.5


@pytest.mark.parametrize(
    ("at", "poisson", "depth", "growth"),
    [(["0 mm", "0 mm"], 0.42, "0.004 mm", 0.8), (["1.3 mm", "-2.1 mm"], 0.42, "0.0158 mm", 0.4)],
    ids=["7.9 half widths, on the axis", "4 half widths, beside it"],
)
def test_bars_of_a_contact_smaller_than_the_elements_hold(at, poisson, depth, growth):
    """One degree more changes F by 1 %, while it is a tenth or a quarter too high."""
    probe, mesh = {**SMALL, "at": at, "depth": depth}, {"rim": "1 mm", "fine": "3 mm", "growth": growth}
    (found,) = cases.solve(probe=probe, mesh=mesh, material={"poisson": poisson}).values()
    exact = of_hertz(float(depth.split()[0]) * 1e-3, poisson)
    assert abs(found.force - exact) <= found.force_error * found.force
    assert min(found.contact_area_error, found.force_error) > 0.2


@pytest.mark.parametrize(
    ("depth", "words"),
    [
        ("1e-4 mm", "elements are 50 times as large as the contact's half width: F is not proved"),
        ("1e-11 mm", "gmsh leaves out the edge of the contact"),
    ],
)
def test_a_contact_far_smaller_than_the_elements_is_refused_in_words(depth, words):
    (found,) = cases.solve(probe={**SMALL, "depth": depth}, mesh={"rim": "1 mm"}).values()
    assert found.status == "failed"
    assert words in found.message
