"""A process that is ended from outside, or from below Python, costs the case that it was at, and no other."""

import errno
import json
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.read import read_file
from epsmesh.run.begun import KILLED, Begun, Ended, done_beside, fail_begun, store_done
from epsmesh.run.execute import compute
from epsmesh.run.outbox import Outbox
from epsmesh.run.reading import open_to_read
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from epsmesh.workflow import _lacking as lacking
from epsmesh.workflow import prepare
from tests.cases import study
from tests.commands import run_script as run
from tests.studies import small_text

# The command, with a solve in it that ends the process, and one that only it is told of.
COMMAND = """
import os, sys
from epsmesh.run.runner import StepRunner
solve = StepRunner._solve
def fatal(self, case, *rest):
    if "epsilon = 4 mm" in case.label or "poisson = 0.3" in case.label:
        {ends}
    return solve(self, case, *rest)
StepRunner._solve = fatal
from epsmesh.__main__ import main
main()
"""
# The command, which ends in the path with friction to the second of two depths, on its finer load steps.
ON_THE_PATH = """
import os
from epsmesh.solve.contact import large
reach, begun = large.reach_contact_with_friction, []
def fatal(*given):
    begun.append(given)
    if len(begun) == 4:
        os.abort()
    return reach(*given)
large.reach_contact_with_friction = fatal
from epsmesh.__main__ import main
main()
"""
# Ends the process once another has finished all other cases.
WAIT = """
        import time
        from pathlib import Path
        for _ in range(1200):
            if sum(path.read_bytes().count(b"key") for path in Path(sys.argv[4]).glob(".*-done-*")) == 2:
                break
            time.sleep(0.05)
        os.abort()"""
BEGIN = """
import os, signal, sys
from pathlib import Path
from epsmesh.run.begun import Begun
signal.signal(signal.SIGTERM, lambda *_: None)
begun = Begun(Path(sys.argv[1]))
begun.name(["c"])
begun.name(["a", "b"])
os.kill(os.getpid(), signal.{asked})
os.kill(os.getpid(), signal.SIGKILL)
"""

FINISH = """
import os, signal, sys
from pathlib import Path
from epsmesh.run.begun import Begun
from epsmesh.run.record import Record
begun = Begun(Path(sys.argv[1]))
begun.name("ab")
begun.done(Record("a", "ok", force=1.0))
begun.done(Record("b", "ok", force=2.0))
begun.name("c")
os.write(begun._open("done"), b'\\n{"key": "c", "sta')
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def store(tmp_path: Path):
    opened = Store(tmp_path / "cases.sqlite")
    yield opened
    opened.close()


NONE = Ended({}, frozenset())


def test_a_case_of_a_process_that_was_killed_is_tried_again_once_but_forces_on_record_stay(store: Store):
    store.put(Record("a", "ok", force=1.0))
    run(BEGIN.format(asked="SIGCONT"), store.path)
    assert fail_begun(store, {"c"}) == NONE  # done by then
    ended = fail_begun(store, {"a", "b", "c"})
    assert (list(ended.failed), ended.again) == (["a"], {"b"})
    found = store.get({"a", "b"})
    assert (found["a"].is_ok, found["b"].status) == (True, "failed")
    assert fail_begun(store, {"b"}) == NONE
    with Begun(store.path) as begun:
        begun.name(["b"])
        left = {path: path.read_bytes() for path in store.path.parent.glob(".*")}
    for path, content in left.items():  # as if the process had been killed
        path.write_bytes(content)
    ended = fail_begun(store, {"a", "b", "c"})
    assert (list(ended.failed), ended.again) == (["b"], set())
    assert "the process was killed while it computed this case" in ended.failed["b"].message
    assert [path.name for path in store.path.parent.iterdir()] == ["cases.sqlite"]


def without_locks(*_: object) -> None:
    raise OSError(errno.ENOLCK, "No locks available")


@pytest.mark.parametrize("has_locks", [True, False])
def test_records_of_a_killed_process_are_stored_but_for_a_torn_one_and_blame_no_case(
    store: Store, monkeypatch, has_locks: bool
):
    run(FINISH, store.path)
    if not has_locks:
        monkeypatch.setattr("fcntl.flock", without_locks)
    assert store.get("abc") == {}
    assert {*store_done(store)} == {"a", "b"}
    assert {key: record.force for key, record in store.get("abc").items()} == {"a": 1.0, "b": 2.0}
    assert fail_begun(store, {"a", "b"}) == NONE
    assert fail_begun(store, {"c"}).again == {"c"}
    assert [path.name for path in store.path.parent.iterdir()] == ["cases.sqlite"]
    with Begun(store.path) as begun:
        begun.name(["d"])
        begun.done(Record("e", "ok", force=3.0))
        assert {*store_done(store)} == {"e"}
        assert fail_begun(store, {"d"}) == NONE
        assert len(list(store.path.parent.iterdir())) == 3
    assert [path.name for path in store.path.parent.iterdir()] == ["cases.sqlite"]


def test_a_signal_while_records_are_written_loses_none(store: Store, monkeypatch):
    plan, write = Mock(meshes=[Mock(solves=[Mock(key=key) for key in "abc"])]), Record.to_json

    def interrupted(record: Record) -> str:
        monkeypatch.setattr(Record, "to_json", write)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Outbox(store, plan) as outbox:
        for key in "abc":
            if key == "c":
                monkeypatch.setattr(Record, "to_json", interrupted)
            outbox.put(Record(key, "ok", force=1.0))
    assert {*store.get("abc")} == {*"abc"}


def test_a_process_that_was_asked_to_end_blames_no_case(store: Store):
    """Also where C code computes, and Python cannot answer: Slurm then sends SIGKILL."""
    run(BEGIN.format(asked="SIGTERM"), store.path)
    assert fail_begun(store, {"a", "b"}) == NONE
    assert [path.name for path in store.path.parent.iterdir()] == ["cases.sqlite"]


def test_what_still_runs_or_has_ended_well_blames_no_case(store: Store):
    with Begun(store.path) as begun:
        begun.name(["a"])
        assert len(list(store.path.parent.iterdir())) == 2
        assert fail_begun(store, {"a"}) == NONE
        assert len(list(store.path.parent.iterdir())) == 2
    assert [path.name for path in store.path.parent.iterdir()] == ["cases.sqlite"]


def test_a_reason_that_was_written_is_that_of_the_failure(store: Store):
    with Begun(store.path) as begun:
        begun.name(["a"], "MemoryError: on rank 1")
    assert fail_begun(store, {"a"}).failed["a"].message == "MemoryError: on rank 1"


@pytest.mark.parametrize("fresh", [False, True])
def test_a_case_that_ends_its_process_is_left_out_of_a_fresh_run_though_an_older_force_is_on_record(
    store: Store, fresh: bool
):
    """It would end that run, too, and every one after it. Where forces are read back, its own is."""
    wanted = study()
    (key,) = make_plan(wanted).keys
    store.put(Record(key, "ok", young=1e4, depth=2e-4, force=1.0, force_error=0.1))
    with Begun(store.path) as begun:
        begun.name([key], "MemoryError: on rank 1")
    plan, opened = prepare(wanted, MPI.COMM_SELF, store.path, fresh=fresh)
    opened.store.close()
    assert plan.solves == ()
    assert (opened.records[key].is_ok, bool(opened.notices)) == (not fresh, fresh)


def test_a_file_that_its_process_removes_meanwhile_is_none(store: Store, monkeypatch):
    for what in ("begun", "done"):
        (store.path.parent / f".{store.path.name}-{what}-here-1-2").write_text(Record("a", "ok").to_json())

    def ends(path: Path, *_: object) -> bool:
        path.unlink()
        return False

    monkeypatch.setattr("epsmesh.run.begun.is_held", ends)
    assert not store_done(store)
    assert not fail_begun(store, ["a"]).failed
    (store.path.parent / f".{store.path.name}-done-here-1-2").write_text(Record("a", "ok").to_json())
    assert not [*done_beside(store.path)]


def test_a_further_trial_that_ends_its_process_is_noticed(tmp_path: Path):
    """Which depths are tried at a given force is not known before the first ones are on record."""
    wanted = study(probe={"shape": "cone", "angle": "70 deg", "radius": "9 mm", "contact": "unilateral",
                          "force": "5 mN", "depth": None})  # fmt: skip
    plan, path = make_plan(wanted), tmp_path / "cases.sqlite"
    records = compute(plan, MPI.COMM_SELF)
    further = next(key for key in records if key not in plan.all_keys)
    store = Store(path)
    store.put_all([records[key] for key in plan.all_keys])
    store.close()
    begun = tmp_path / f".{path.name}-begun-here-1-2"
    for times in (1, 2):
        begun.write_text(json.dumps({"keys": [further], "why": KILLED}))
        planned, opened = prepare(wanted, MPI.COMM_SELF, path)
        assert begun.is_file()
        following = lacking(planned, opened, MPI.COMM_SELF)
        assert following is not None
        assert not begun.is_file()
        assert (further in opened.again) == (further in following.all_keys) == (times == 1)
        assert (opened.records.get(further) is not None) == (times == 2)
        opened.store.close()
    assert opened.records[further].message == KILLED


def test_a_damaged_file_blames_no_case(store: Store):
    for number, content in enumerate((b"", b"\0\xff", b"[1]\n", b'{"keys": 3, "why": ""}\n')):
        store.path.with_name(f".{store.path.name}-begun-{number}").write_bytes(content)
    assert fail_begun(store, {"a"}) == NONE


@pytest.mark.nightly
def test_a_case_that_ends_its_process_twice_fails_in_the_next_run_alone(epsmesh, tmp_path: Path):
    """The second run does it last. The fourth run tries it again. What another rank has finished is kept."""
    file = tmp_path / "small.toml"
    file.write_text(small_text(mesh={"epsilon": ["4 mm", "6 mm", "full"], "degree": 1}, solve={"exact": False}))
    words = ("run", file, "--output", tmp_path, "--meshes", tmp_path / "meshes")
    killed = run(COMMAND.format(ends=WAIT), *words, ranks=2)
    assert killed.returncode not in (0, 1, 2)
    stored = Store(tmp_path / "cases.sqlite")
    store_done(stored)
    assert [record.status for record in stored.records()] == ["ok", "ok"]
    stored.close()
    killed = run(COMMAND.format(ends="os.abort()"), *words)
    assert killed.returncode not in (0, 1, 2)
    assert "while it solved cases: 1 case will be solved after the others" in killed.stderr
    with open_to_read(tmp_path / "cases.sqlite") as stored:
        assert sorted(record.status for record in stored.records()) == ["failed", "ok", "ok"]
    following = epsmesh(*words)
    assert following.exit_code == 1, following.stderr
    assert "an earlier run was killed while it solved cases: 1 case failed" in following.stderr
    assert "2 ok, 1 failed (the process was killed while it computed this case" in following.stdout
    data = read_file(tmp_path / "small.nc").squeeze()
    assert list(data["status"].values) == ["failed", "ok", "ok"]
    assert np.isfinite(data["force"].values).tolist() == [False, True, True]
    again = epsmesh(*words)
    assert (again.exit_code, "3 ok" in again.stdout) == (0, True), again.stderr


def test_a_run_that_is_killed_on_a_path_with_friction_is_taken_up_with_the_forces_of_one_that_was_not(
    epsmesh, tmp_path: Path
):
    """A path has a memory, and begins again from the first touch; the depth before is not solved again."""
    file = tmp_path / "path.toml"
    probe = {"shape": "sphere", "radius": "4 mm", "depth": ["0.3 mm", "0.6 mm"], "contact": "unilateral"}
    changes = {
        "probe": probe | {"friction": 0.2},
        "material": {"law": "neo-hookean"},
        "mesh": {"epsilon": "full", "rim": "0.8 mm"},
        "plan": {"without": ["axisymmetric"]},
    }
    file.write_text(small_text(**changes))
    words, forces = ("run", file, "--meshes", tmp_path / "meshes", "--output"), []
    killed = run(ON_THE_PATH, *words, tmp_path / "killed")
    assert killed.returncode not in (0, 1, 2), killed.stderr
    stored = Store(tmp_path / "killed" / "cases.sqlite")
    store_done(stored)
    assert [record.status for record in stored.records()] == ["ok"]  # the depth before
    stored.close()
    for name in ("killed", "whole"):
        ended = epsmesh(*words, tmp_path / name)
        assert ended.exit_code == 0, ended.stderr
        data = read_file(tmp_path / name / "path.nc").squeeze()
        forces.append(data["force"].values)
        assert list(data["status"].values) == ["ok", "ok"]
        assert (data["slip_area"].values > 0).all()
    assert forces[0][0] < forces[0][1]
    assert forces[0] == pytest.approx(forces[1], rel=1e-5)


def test_a_rank_that_fails_alone_ends_the_run_and_the_next_one_knows_why(epsmesh, tmp_path: Path):
    ends = "\n        ".join(
        (
            "from epsmesh.run import failure; failure.PATIENCE = 1.0",
            "if self._comm.rank: raise MemoryError('no room')",
            "self._comm.barrier()",
        )
    )
    together = "from epsmesh.plan import schedule\nschedule._FEWEST_CELLS = 1\n"
    file = tmp_path / "small.toml"
    ratios = {"material": {"poisson": [0.3, 0.4]}}
    file.write_text(small_text(mesh={"epsilon": "full", "degree": 1}, solve={"exact": False}, **ratios))
    words = ("run", file, "--output", tmp_path, "--meshes", tmp_path / "meshes")
    ended = run(together + COMMAND.format(ends=ends), *words, ranks=2)
    assert ended.returncode not in (0, 2)
    following = epsmesh(*words)
    assert following.exit_code == 1, following.stderr
    assert "1 failed (MemoryError: no room" in following.stdout


def test_results_that_cannot_be_built_are_told_in_words(epsmesh, small, monkeypatch, tmp_path):
    def broken(*_):
        raise ValueError("dimension `load` against variable `load`")

    monkeypatch.setattr("epsmesh.report.dataset.build", broken)
    done = epsmesh("run", small, "--output", tmp_path / "out", "--json")
    assert done.exit_code == 1
    told = json.loads(done.stdout)
    assert told["status"] == 1
    assert "cannot be built: ValueError: dimension `load` against variable `load`" in told["errors"][0]["message"]
    monkeypatch.undo()
    again = epsmesh("run", small, "--output", tmp_path / "out", "--json")
    assert (again.exit_code, json.loads(again.stdout)["studies"][0]["stored"]) == (0, 12)
