"""The stress matrix: its quick cells pass, and it is not to be fooled."""

import json
from dataclasses import replace
from math import inf, isnan, nan

import pytest
from mpi4py import MPI

from benchmarks import scenes, stress
from benchmarks.stress import Result, judge, run, summary, table, to_json
from benchmarks.stress_cells import Cell, cells
from epsmesh.run.record import UNFORESEEN, Record

WORLD = MPI.COMM_WORLD
CELL = Cell("row", "value", {})
GOOD = Record("", "ok", force=1.01, force_error=0.02)
TRUTH = Record("", "ok", origin="axisymmetric", force=1.0, force_error=1e-6)


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
@pytest.mark.nightly
def test_quick_cells_pass():
    results = list(run(MPI.COMM_SELF, quick=True))
    assert len(results) > 40
    assert not [result for result in results if not result.is_good], table(results)
    assert {result.status for result in results} == {"pass", "refused"}


@pytest.mark.mpi
def test_a_wrong_force_with_a_good_status_fails(monkeypatch):
    right = scenes.compute

    def wrong(plan, comm):
        """Return forces that are 10 % off, but for those of the references."""
        found = right(plan, comm)
        factor = 1.0 if all(solve.goal for solve in plan.solves) else 1.1
        return {key: replace(record, force=factor * record.force) for key, record in found.items()}

    monkeypatch.setattr(scenes, "compute", wrong)
    results = [result for result in run(WORLD, ["Poisson's ratio"], quick=True) if result.value == "0.44"]
    (result,) = results
    assert result.status == "FAIL"
    assert result.wrong
    assert "WRONG" in result.message
    assert "1 wrong number with a good status" in summary(results)


@pytest.mark.parametrize(
    ("record", "status", "wrong"),
    [
        (GOOD, "pass", False),
        (replace(GOOD, force=1.03), "FAIL", True),
        (replace(GOOD, force=-1.0), "FAIL", True),
        (replace(GOOD, force=nan), "FAIL", True),
        (replace(GOOD, force=inf), "FAIL", True),
        (replace(GOOD, force_error=nan), "FAIL", False),
        (replace(GOOD, force_error=-0.02), "FAIL", True),
        (replace(GOOD, force=5.0, force_error=0.9), "FAIL", True),
        (replace(GOOD, origin="axisymmetric"), "FAIL", False),
        (Record("", "failed", "did not converge"), "FAIL", False),
    ],
)
def test_verdicts(record, status, wrong):
    result = judge(CELL, record, TRUTH)
    assert (result.status, result.wrong) == (status, wrong)


def test_refusals_need_a_message_and_a_cell_that_expects_them():
    failed = Record("", "failed", "did not converge")
    assert judge(replace(CELL, expect="either"), failed, None).status == "refused"
    assert judge(replace(CELL, expect="refused"), replace(failed, message=""), None).status == "FAIL"
    assert judge(replace(CELL, expect="refused"), GOOD, None).wrong
    unforeseen = replace(failed, message=f"{UNFORESEEN}IndexError: tuple index out of range")
    assert judge(replace(CELL, expect="either"), unforeseen, None).status == "FAIL"


def test_invariances_have_no_bar_to_hide_behind():
    cell, base = replace(CELL, against="base", scale=4.0), replace(GOOD, force=2.0)
    assert judge(cell, replace(GOOD, force=8.0 * (1 + 1e-9)), base).status == "pass"
    assert judge(cell, replace(GOOD, force=8.0 * (1 + 1e-7)), base).wrong


def test_every_cell_of_an_invariance_follows_its_base():
    known = set()
    for cell in cells():
        if cell.against == "truth":
            known.add((cell.row, cell.group, cell.quick))
        else:
            assert (cell.row, cell.group, cell.quick) in known


def test_json_and_table_hold_every_result():
    results = [Result("row", "a", "pass", 1e-3, 2e-3), Result("row", "b", "FAIL", message="WRONG")]
    rows = json.loads(to_json(results))
    assert [row["value"] for row in rows] == ["a", "b"]
    assert rows[1]["error"] is None
    assert isnan(results[1].error)
    assert "WRONG" in table(results)


def test_unknown_rows_are_refused():
    with pytest.raises(ValueError, match="rows are: Poisson's ratio"):
        next(run(MPI.COMM_SELF, ["nonsense"]))


@pytest.mark.skipif(WORLD.size > 1, reason="serial")
def test_a_row_is_told_with_its_verdict(capsys):
    assert stress.main(["gap to the body's edge / a", "--quick"]) == 0
    assert "no wrong numbers" in capsys.readouterr().out
