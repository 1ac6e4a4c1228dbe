"""Commands that only look: they answer from what is on record, and leave every file as it is."""

import json
import sqlite3
from dataclasses import replace

import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from epsmesh.study.read import read_study

LOOKING = ("plan", "status")


def contents(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def fill(path, plan, **states):
    """Put records of a plan's solves into a store: F_exact, and each case by the state of its ε in mm."""
    store = Store(path)
    for solve in plan.solves:
        case = solve.case
        record = Record(solve.key, "ok", force=1.0, force_error=0.01, young=case.material.young, depth=case.probe.depth)
        state = "ok" if solve.is_reference else states.get(f"at_{1e3 * case.mesh.epsilon:.0f}", "pending")
        if state == "failed":
            record = Record(solve.key, "failed", "it went wrong")
        if state != "pending":
            store.put(record)
    store.close()


@pytest.mark.parametrize("words", [*((name, "FILE") for name in LOOKING), ("plan", "FILE", "0"), ("status",)])
def test_a_damaged_store_is_named_and_left_where_it_is(epsmesh, small, tmp_path, words):
    store = tmp_path / "kept" / "cases.sqlite"
    store.parent.mkdir()
    store.write_bytes(b"this was a store, and may be one again" * 100)
    before = contents(tmp_path)
    done = epsmesh(*(small if word == "FILE" else word for word in words), "--store", store)
    assert done.exit_code == 2
    assert f"the case store {store} is damaged" in done.stderr
    assert f"`epsmesh status --prune --yes --store {store}` renames it" in done.stderr
    preview = epsmesh("status", "--prune", "--store", store)
    assert "the whole store is damaged" in preview.stdout
    assert contents(tmp_path) == before
    mended = epsmesh("status", "--prune", "--store", store, "--yes")
    assert mended.exit_code == 0
    assert "it was renamed to" in mended.stderr
    assert epsmesh(*(small if word == "FILE" else word for word in words), "--store", store).exit_code == 0


@pytest.mark.parametrize("command", LOOKING)
@pytest.mark.parametrize("text", ["{", "[1, 2]", '{"key": "k", "status": "ok"}', '{"force_vector": [1], "colour": 1}'])
def test_an_unreadable_record_is_told_with_what_removes_it(epsmesh, small, tmp_path, command, text):
    store = tmp_path / "cases.sqlite"
    plan = make_plan(read_study(small))
    fill(store, plan, at_4="ok", at_6="ok", at_inf="ok")
    with sqlite3.connect(store) as database:
        database.execute("UPDATE records SET record = ? WHERE key = ?", (text, plan.keys[0]))
    database.close()
    before = contents(tmp_path)
    done = epsmesh(command, small, "--store", store)
    assert (done.exit_code, done.exception is None or isinstance(done.exception, SystemExit)) == (2, True)
    assert f"record {plan.keys[0]} cannot be read" in done.stderr
    assert f"`epsmesh status --prune --yes --store {store}` removes it" in done.stderr
    preview = json.loads(epsmesh("status", "--prune", "--store", store, "--json").stdout)
    assert (preview["remove"], preview["reasons"], preview["done"]) == (1, {"cannot be read": 1}, False)
    assert contents(tmp_path) == before
    assert epsmesh("status", "--prune", "--store", store, "--yes").exit_code == 0
    assert epsmesh(command, small, "--store", store).exit_code == 0


@pytest.mark.parametrize("command", LOOKING)
def test_looking_makes_no_files(epsmesh, small, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    assert epsmesh(command, small).exit_code == 0
    assert contents(tmp_path) == {small: small.read_bytes()}


def test_status_counts_what_is_not_to_be_run_as_skipped(epsmesh, small, tmp_path):
    """F is at F_exact at 4 and 6 mm: the full order need not be run, and never will be."""
    store = tmp_path / "cases.sqlite"
    small.write_text(small.read_text() + '[plan]\nstop_near_exact = "5 %"\n')
    fill(store, make_plan(read_study(small)), at_4="ok", at_6="ok")
    told = json.loads(epsmesh("status", small, "--store", store, "--json").stdout)
    assert [told[state] for state in ("ok", "skipped", "failed", "pending")] == [8, 4, 0, 0]
    assert "8 ok, 0 failed, 4 skipped, 0 pending" in epsmesh("status", small, "--store", store).stdout


def test_status_asks_after_a_run_without_reductions(epsmesh, small, tmp_path):
    """Such a run keeps other records: 12 of its own where the full order is shared no more."""
    store, plan = tmp_path / "cases.sqlite", make_plan(read_study(small), without=["all"])
    fill(store, plan, at_4="failed", at_6="ok", at_inf="ok")
    assert len(plan.solves) > len(make_plan(read_study(small)).solves)
    told = json.loads(epsmesh("status", small, "--store", store, "--without", "all", "--json").stdout)
    assert [told[state] for state in ("ok", "failed", "pending")] == [8, 4, 0]
    assert {failure["message"] for failure in told["failures"]} == {"it went wrong"}
    assert json.loads(epsmesh("status", small, "--store", store, "--json").stdout)["pending"] > 0
    assert epsmesh("status", small, "--without", "everything").exit_code == 2


def test_a_plan_of_which_nothing_fits_into_memory_ends_with_1(epsmesh, small):
    done = epsmesh("plan", small, "--memory", 0.1)
    assert done.exit_code == 1
    assert "no case fits into the 0.1 GB of memory that are there" in done.stderr
    assert json.loads(epsmesh("plan", small, "--memory", 0.1, "--json").stdout)["too_large"] > 0
    told = json.loads(epsmesh("plan", small, "--memory", 100, "--json").stdout)
    assert told["too_large"] == 0
    needed = sorted(step["memory"] for step in told["steps"])
    some = epsmesh("plan", small, "--memory", (needed[0] + needed[-1]) / 2 / 0.9e9)
    assert (some.exit_code, "steps do not fit" in some.stderr) == (0, True)


def test_a_case_that_some_labels_name_is_said_to_be_the_first_of_several(epsmesh, small):
    done = epsmesh("plan", small, "poisson=0.4")
    assert done.stdout.startswith("poisson = 0.4, epsilon = 4 mm, outside = coarse")
    assert "the first of 6 such cases, which differ in epsilon, outside" in done.stderr
    assert epsmesh("plan", small, "poisson=0.4, epsilon=4 mm, outside=free").stderr == ""


@pytest.mark.parametrize("case", ["epsilon=0.4 cm", "epsilon=4.0 mm", "poisson=30 %, epsilon=4e-3 m"])
def test_a_case_is_found_by_its_numbers_in_any_unit(epsmesh, small, case):
    assert epsmesh("plan", small, case).stdout.startswith("poisson = 0.3, epsilon = 4 mm")


def test_a_force_on_record_that_is_no_number_is_computed_again(epsmesh, small, tmp_path):
    store, plan = tmp_path / "cases.sqlite", make_plan(read_study(small))
    fill(store, plan, at_4="ok", at_6="ok", at_inf="ok")
    opened = Store(store)
    opened.put(replace(opened.get(plan.keys[:1])[plan.keys[0]], force=float("nan")))
    opened.close()
    assert json.loads(epsmesh("plan", small, "--store", store, "--json").stdout)["solves"] == 1
