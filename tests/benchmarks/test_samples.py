"""Every benchmark runs: its smallest sample, and what its row says of the scene."""

import json

import pytest

from benchmarks import contact, one_run, organs, solvers
from benchmarks.processor import by_turns
from benchmarks.scenes import BOX, DISC, graded, study


@pytest.mark.parametrize("method", ["direct", "iterative"])
@pytest.mark.parametrize(("element", "degree"), [("displacement", 1), ("displacement", 2), ("mixed", 2)])
def test_a_solver_is_told_in_applications_of_the_operator(element, degree, method, capsys):
    solvers.measure(element, degree, 0.45, (12, 4), method, repeats=1)
    row = json.loads(capsys.readouterr().out)
    assert (row["element"], row["degree"], row["method"]) == (element, degree, method)
    assert (row["iterations"] == 1) == (method == "direct")
    assert row["total"] == row["setup"] + row["solve"] > 0


def test_found_contact_is_told_in_linear_solves():
    row = contact.in_linear_solves(0.3, rim="1 mm", repeats=1)
    assert row["element"] == "displacement"
    assert set(row["seconds"]) == {f"{a}, {b}" for a in ("found", "prescribed") for b in ("force", "force and bar")}


def test_a_run_says_what_it_gave_and_what_its_bar_took():
    found = one_run.measure(study(BOX, 0.3, DISC, graded("6 mm", "8 mm", "0.8 mm", 0.6, degree=2)))
    assert (found["cases"], found["solved"], found["message"]) == (1, 1, "")
    assert 0 < found["bar"] < found["processor"]
    assert found["force"] > 0


def test_a_place_of_an_organ_has_a_mesh_and_parts(tmp_path, monkeypatch):
    body, _, probe, places = organs.SCENES["kidney, disc"]
    monkeypatch.setitem(organs.SCENES, "kidney, disc", (body, [0.3], probe, places))
    (row,) = organs.measure("kidney, disc", tmp_path)
    assert row["status"] == "ok"
    assert row["meshes"] >= 1
    assert min(row[part] for part in organs.PARTS) > 0
    assert row["rest"] < 0.3 * row["seconds"]


def test_ways_take_turns():
    seen = []
    found = by_turns({"a": lambda: seen.append("a"), "b": lambda: seen.append("b")}, 2)
    assert seen == ["a", "b", "a", "b"]
    assert found == {"a": [None, None], "b": [None, None]}
