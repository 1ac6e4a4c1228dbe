"""``[probe.path]``: places one after the other, as numbers."""

import gc
import tracemalloc
from math import pi

import numpy as np
import pytest

from epsmesh.plan.plan import declare, make_plan
from epsmesh.report.dataset import build
from epsmesh.run.outcome import count_states
from epsmesh.study.problems import StudyError
from tests.cases import BLADE, raw, refusal, study
from tests.report.synthetic import dataset

LINE = {"from": ["-10 mm", "0 mm"], "to": ["10 mm", "0 mm"], "steps": 5}
GRID = {"x": ["-5 mm", "5 mm"], "y": {"from": "-6 mm", "to": "6 mm", "steps": 3}}
OFF = {"line": LINE | {"to": ["30 mm", "0 mm"]}, "off": "no contact"}  # at -10, 0, 10, 20 and 30 mm of a box 40 mm wide


def along(path, **changes):
    return study(probe={"path": path}, **changes)


@pytest.mark.parametrize(
    ("path", "places", "lengths"),
    [
        ({"line": LINE}, [(-0.01, 0), (-0.005, 0), (0, 0), (0.005, 0), (0.01, 0)], [0, 0.005, 0.01, 0.015, 0.02]),
        ({"circle": {"centre": ["1 mm", "0 mm"], "radius": "5 mm", "steps": 4}},
         [(0.006, 0), (0.001, 0.005), (-0.004, 0), (0.001, -0.005)], [k * 2.5e-3 * pi for k in range(4)]),
        ({"points": [["0 mm", "0 mm"], ["3 mm", "4 mm"], ["3 mm", "5 mm"]]}, [(0, 0), (0.003, 0.004), (0.003, 0.005)],
         [0, 0.005, 0.006]),
    ],
)  # fmt: skip
def test_a_path_is_a_dimension_of_lengths(path, places, lengths):
    made = along(path)
    (axis,) = made.axes
    assert (axis.name, axis.unit) == ("path", "m")
    assert axis.labels == pytest.approx(lengths, rel=1e-11)
    assert [case.probe.at for case in made.cases()] == places


def test_a_place_of_a_path_is_the_same_case_as_by_itself():
    assert declare(along({"line": LINE})).keys[3:4] == declare(study(probe={"at": ["0.5 cm", "0 mm"]})).keys


def test_a_raster_has_two_dimensions_in_the_order_of_the_file():
    found = dataset(probe={"path": {"raster": GRID}}, material={"poisson": [0.3, 0.4]})
    assert found["force"].dims == ("poisson", "x", "y")
    assert found["x"].values.tolist() == [-0.005, 0.005]
    assert found["y"].attrs["units"] == "m"
    assert {"at_x", "at_y", "at_z"} <= {*found.coords}
    assert found["at_y"].dims == ("x", "y")
    assert float(found["at_y"].sel(x=0.005, y=-0.006)) == -0.006


def test_tools_in_several_tables_go_the_same_path():
    path = {"path": {"line": LINE}}
    tools = [raw()["probe"] | {"name": "needle"} | path, BLADE | {"name": "knife"} | path]
    made = study(probe=tools)
    assert [axis.name for axis in made.axes] == ["probe", "path"]
    assert [(case.probe.shape, case.probe.at[0]) for case in made.cases()][4:6] == [("disc", 0.01), ("blade", -0.01)]
    tools[1] = tools[1] | {"path": {"line": LINE | {"steps": 3}}}
    with pytest.raises(StudyError, match="must be the same in all"):
        study(probe=tools)


WRONG = {
    "no table": ([1], ["probe.path = [1]", "must be a table"]),
    "no form": ({"off": "no contact"}, ["probe.path", "give one of line, circle, raster, points"]),
    "two forms": ({"line": LINE, "raster": GRID}, ["has line and raster"]),
    "unknown form": ({"lines": LINE}, ["probe.path.lines", "did you mean `line`?"]),
    "unknown key": ({"line": LINE | {"step": 3}}, ["probe.path.line.step = 3", "did you mean `steps`?"]),
    "missing key": ({"line": {"from": ["0 mm", "0 mm"], "steps": 3}}, ["probe.path.line.to", "required"]),
    "one step": ({"line": LINE | {"steps": 1}}, ["probe.path.line.steps = 1", "at least 2"]),
    "half a step": ({"line": LINE | {"steps": 2.5}}, ["probe.path.line.steps = 2.5", "whole number"]),
    "no unit": ({"line": LINE | {"to": ["10 mm", 0]}}, ["probe.path.line.to[2] = 0", "number with a unit"]),
    "no length": ({"circle": {"centre": ["0 mm", "0 mm"], "radius": "5 kPa", "steps": 4}}, ["radius", "a length"]),
    "one coordinate": ({"points": [["0 mm", "0 mm"], ["1 mm"]]}, ["probe.path.points[2]", "2 or 3"]),
    "unlike": ({"points": [["0 mm", "0 mm"], ["1 mm", "0 mm", "0 mm"]]}, ["two coordinates at all places"]),
    "one place": ({"points": [["0 mm", "0 mm"]]}, ["probe.path.points", "for one place, use `at`"]),
    "twice": ({"points": [["1 mm", "0 mm"], ["2 mm", "0 mm"], ["1 mm", "0 mm"]]}, ["1 mm", "more than once"]),
    "no length at all": ({"line": LINE | {"to": LINE["from"]}}, ["probe.path.line", "more than once"]),
    "falling": ({"raster": GRID | {"x": ["5 mm", "-5 mm"]}}, ["probe.path.raster.x", "must rise"]),
    "a raster's list": ({"raster": GRID | {"x": "5 mm"}}, ['probe.path.raster.x = "5 mm"', "two lengths"]),
    "off the body": (OFF | {"off": "refuse"}, ["probe.path", "30 mm", "inside the top face", 'off = "no contact"']),
    "wrong word": ({"line": LINE, "off": "void"}, ['probe.path.off = "void"', "'refuse' or 'no contact'"]),
    "never on the body": ({"line": {"from": ["50 mm", "0 mm"], "to": ["60 mm", "0 mm"], "steps": 2},
                           "off": "no contact"},
                          ["probe.path", "misses the body"]),
}  # fmt: skip


@pytest.mark.parametrize(("path", "words"), WRONG.values(), ids=WRONG)
def test_what_is_no_path_is_refused(path, words):
    said = refusal(raw(probe={"path": path}))
    assert all(word in said for word in words), said


def test_a_path_stands_in_place_of_at():
    with pytest.raises(StudyError, match="excludes `at`"):
        study(probe={"at": ["0 mm", "0 mm"], "path": {"line": LINE}})


def test_where_the_tool_is_clear_of_the_body_there_is_no_force_and_over_the_edge_none_is_known():
    made = make_plan(along(OFF))
    assert len(made.solves) == 2  # those at -10 and 10 mm are images
    assert any("does not touch" in skipped.reason for skipped in made.skipped)
    found = dataset(probe={"path": OFF})
    assert found["status"].values.tolist() == ["ok", "ok", "ok", "skipped", "no contact"]
    assert np.isfinite(found["force"][:3]).all()
    assert np.isnan(found["force"][3])
    assert found["force"].values[4] == 0
    assert "inside the top face" in str(found["message"].values[3])
    assert np.isnan(found["at_x"].values[3:]).all()
    assert count_states(made, {}) == {"ok": 0, "skipped": 1, "failed": 0, "pending": 3, "no contact": 1}
    assert build(made, {})["status"].values[0] == "pending"


@pytest.mark.parametrize(("y", "state"), [("31 mm", "skipped"), ("34 mm", "no contact")])
def test_beside_an_ellipsoid_contact_is_lost_once_all_of_the_tool_is_beside_it(y, state):
    body = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
    path = {"points": [["0 mm", "0 mm"], ["0 mm", y]], "off": "no contact"}
    found = build(make_plan(study(body=body, probe={"path": path}, mesh={"degree": 2})), {})
    assert found["status"].values.tolist() == ["pending", state]


def test_what_is_kept_of_places_that_are_refused_is_small():
    """What was computed until then is not kept with them: of ten thousand places, that was gigabytes."""
    grid = {axis: {"from": "-5 mm", "to": "5 mm", "steps": 10} for axis in ("x", "y")}
    body = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-5 mm"}}
    tracemalloc.start()
    for number in range(2):  # the first time, modules are loaded
        before = tracemalloc.get_traced_memory()[0]
        with pytest.raises(StudyError, match="path"):
            study(body=body, probe={"radius": f"{80 + number} mm", "path": {"raster": grid}})
        gc.collect()
        kept = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert kept < 100 * 10_000
