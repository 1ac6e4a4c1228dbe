"""Paths of which some places are solved: the plan, what it refuses, and forces at places that were not solved."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from mpi4py import MPI

from epsmesh.plan.describe import story
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.completion import complete, possible
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.states import FAILED, OK
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse, read_study
from epsmesh.study.toml import to_toml
from tests.cases import study

LINE = {"line": {"from": ["-11 mm", "2 mm"], "to": ["9 mm", "3 mm"], "steps": 41}}
TUMOUR = {"name": "tumour", "at": ["1 mm", "2 mm", "-7 mm"], "radius": "4 mm", "young": "80 kPa", "poisson": 0.3}

BLADE = {"shape": "blade", "radius": None, "length": "6 mm", "width": "0.4 mm"}
CUTTING = BLADE | {"contact": "unilateral", "toughness": "5 J/m^2", "depth": None, "insertion": {"to": "4 mm"}}

NEAR = TUMOUR | {"at": ["1 mm", "1 mm", "-3.5 mm"], "radius": "2 mm"}


def scene(error="1 %", path=LINE, tumour=TUMOUR, **changes):
    """Return a study of a disc along a line over a tumour."""
    box = {"shape": "box", "size": ["50 mm", "40 mm", "20 mm"], "fixed": "bottom", "inclusion": [tumour]}
    disc = {"shape": "disc", "radius": "3 mm", "depth": "0.1 mm", "contact": "frictionless", "path": path}
    sizes = {"epsilon": "6 mm", "fine": "2.5 mm", "coarse": "8 mm", "rim": "0.9 mm", "growth": 0.8}
    content = {
        "title": "map",
        "body": box,
        "material": {"young": "10 kPa", "poisson": 0.3},
        "probe": disc,
        "mesh": sizes,
    }
    content |= {"solve": {"exact": False}, "plan": {"path_error": error} if error else {}}
    for name, found in changes.items():
        merged = found if isinstance(found, list) else content.get(name, {}) | found
        content[name] = merged if isinstance(merged, list) else {k: v for k, v in merged.items() if v is not None}
    return parse(content)


def solved(study, compute_more=lambda plan: compute(plan, MPI.COMM_SELF)):
    """Return the plan of a study and the records of all of its cases."""
    plan = make_plan(study)
    records = compute_more(plan)
    while more := complete(plan, records, lambda keys: {}):
        records |= compute_more(more)
    return plan, records


def synthetic(plan):
    """Return records of a force that depends on the place, and a bar of 0.5 %."""
    found = {}
    for solve in plan.solves:
        x, y, _ = solve.case.frame.point
        force = 0.05 * (1 + 0.3 / (1 + ((x - 1e-3) ** 2 + (y - 2e-3) ** 2) / 8e-3**2) ** 2)
        scale = solve.case.scale
        record = Record(solve.key, OK, young=scale.stress, depth=scale.length, force=force, force_error=5e-3)
        found[solve.key] = record
    return found


def test_forces_at_places_that_are_not_solved_are_within_their_bars():
    """At most 15 of 41 places are solved; F of the others differs from their own solves by less than the bars."""
    plan, records = solved(scene("2 %"))
    mapped = build(plan, records)
    is_solved = mapped["origin"].values == "solved"
    assert 8 <= is_solved.sum() <= 15
    assert set(mapped["origin"].values[~is_solved]) == {"interpolated"}
    assert bool((mapped["status"] == "ok").all())
    assert float(mapped["force"].max() / mapped["force"].min()) > 1.05
    held_out = np.flatnonzero(~is_solved)[1::5]
    places = [
        [f"{float(x)} m", f"{float(y)} m"]
        for x, y in zip(mapped["at_x"].values[held_out], mapped["at_y"].values[held_out], strict=True)
    ]
    truth = build(*solved(scene(error=None, path={"points": places})))
    missed = np.abs(mapped["force"].values[held_out] - truth["force"].values)
    assert (missed < mapped["force_error"].values[held_out]).all()
    bars = (mapped["force_error"] / mapped["force"]).values
    assert 1 + bars[~is_solved].max() <= np.exp(0.02) * (1 + bars[is_solved].max())
    assert np.isnan(mapped["energy"].values[~is_solved]).all()


def test_places_are_solved_until_the_error_is_small_enough_and_tissues_at_the_same_ones():
    """A smaller error needs more places. Two stiffnesses of the tumour share meshes, and so the places."""
    counts = []
    for error in ("3 %", "0.1 %"):
        plan, records = solved(scene(error, tumour=TUMOUR | {"young": ["20 kPa", "80 kPa"]}), synthetic)
        origins = build(plan, records)["origin"]
        of_each = [(origins.sel(tumour_young=value) == "solved").values for value in origins["tumour_young"]]
        np.testing.assert_array_equal(*of_each)
        counts.append(of_each[0].sum())
    assert 8 <= counts[0] < counts[1] < 41


def test_an_interpolated_bar_above_the_accuracy_is_told():
    """The accuracy is that of solved places: interpolation adds to it, within `path_error`."""
    none = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth"))
    for accuracy, is_told in (("0.6 %", True), ("3 %", False)):
        found = build(*solved(scene("1 %", mesh=none | {"accuracy": accuracy}), synthetic))
        within = (found["force_error"] <= float(accuracy[:-2]) / 100 * found["force"]).values
        assert within.all() != is_told
        assert [text != "" for text in found["message"].values] == (~within).tolist()


def test_an_interpolated_force_is_proportional_to_the_depth():
    forces = build(*solved(scene(probe={"depth": ["0.1 mm", "0.2 mm"]}), synthetic))["force"]
    np.testing.assert_allclose(forces.isel(depth=1), 2 * forces.isel(depth=0), rtol=1e-12)


def test_a_place_that_fails_is_not_data_and_stays_failed():
    def with_failure(plan):
        found = synthetic(plan)
        first = next(iter(found))
        return found | {first: Record(first, FAILED, "no mesh")}

    plan, records = solved(scene(), with_failure)
    status = build(plan, records)["status"].values
    assert "failed" in status
    assert set(status) == {"ok", "failed"}


def test_forces_that_are_not_smooth_are_all_solved():
    random = np.random.default_rng(5)

    def rough(plan):
        return {key: replace(one, force=one.force * random.uniform(0.7, 1.3)) for key, one in synthetic(plan).items()}

    plan, records = solved(scene("0.5 %"), rough)
    assert set(build(plan, records)["origin"].values) == {"solved"}


def test_what_is_planned_and_what_may_follow():
    study = scene()
    plan = make_plan(study)
    (skipped,) = (one for one in plan.skipped if one.name == "path")
    assert len(plan.solves) + skipped.count == 41
    assert len(possible(plan, {}).solves) == skipped.count
    assert len(make_plan(study, without=("path",)).solves) == len(make_plan(scene(error=None)).solves) == 41
    (unsolved, *_) = set(plan.keys) - {solve.key for solve in plan.solves}
    assert "interpolated" in story(plan, (plan.keys.index(unsolved),))["steps"][0]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"solve": {"exact": True}}, "F_exact"),
        ({"probe": {"motion": "all", "contact": "bonded"}}, "6 × 6"),
        ({"material": {"density": "1000 kg/m^3"}, "load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}}, "loads"),
        ({"probe": {"depth": None, "force": "20 mN"}}, "given force"),
        ({"probe": {"history": {"ramp": "1 s", "hold": "1 s"}}}, "history"),
        ({"probe": BLADE | {"contact": "bonded", "incision": "1 mm"}}, "slit"),
        ({"probe": CUTTING, "body": {"inclusion": None}}, "slit"),  # that it makes
        ({"body": {"capsule": {"young": "1 MPa", "thickness": "0.1 mm"}}}, "terms"),
        ({"solve": {"influence": True}}, "influence"),
        ({"material": {"spread": {"young": "20 %", "correlation_length": "5 mm"}}}, "influence"),
        ({"output": [{"name": "stress", "region": "tumour", "of": "von_mises"}]}, "outputs"),
    ],
    ids=str,
)
def test_results_that_need_each_solution_have_it_with_the_reason(changes, reason):
    plan = make_plan(scene(**changes))
    assert len({tuple(solve.case.frame.point) for solve in plan.solves if not solve.is_reference}) == 41
    assert any(reason in one.reason for one in plan.skipped if one.name == "path")


def test_the_error_is_for_a_path():
    with pytest.raises(StudyError, match=r"plan.path_error.*\[probe.path\]"):
        study(plan={"path_error": "1 %"})


@pytest.mark.nightly
def test_shards_solve_the_first_places_and_a_run_on_two_ranks_the_rest(epsmesh, spawn, tmp_path):
    """Whole again, the dataset is that of one run."""
    content = {"title": "map", "body": {"shape": "box", "size": ["20 mm", "20 mm", "10 mm"], "inclusion": [NEAR]}}
    content |= {
        "material": {"young": "10 kPa", "poisson": 0.3},
        "solve": {"exact": False},
        "plan": {"path_error": "0.5 %"},
    }
    line = {"line": {"from": ["-5 mm", "1 mm"], "to": ["5 mm", "1.5 mm"], "steps": 15}}
    content |= {"probe": {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "path": line}}
    content |= {
        "mesh": {"epsilon": "4 mm", "fine": "2 mm", "coarse": "4 mm", "rim": "0.9 mm", "growth": 0.9, "degree": 2}
    }
    file, out = tmp_path / "map.toml", tmp_path / "out"
    file.write_text(to_toml(content, "map"))
    for number in (1, 2):
        done = epsmesh("run", file, "--output", out, "--shard", f"{number}/2", "-q")
        assert done.exit_code == 0, done.output
    spawn("run", file, "--output", out, "-q", ranks=2)
    assert epsmesh("status", file, "--output", out).exit_code == 0
    whole = xr.load_dataset(out / "map.nc")
    assert bool((whole["status"] == 0).all())
    origins = xr.load_dataset(out / "map.nc", group="run")["origin"].values
    solved_here, interpolated = (sum(one.startswith(how) for one in origins) for how in ("solved", "interpolated"))
    assert solved_here >= 8
    assert solved_here + interpolated == 15
    alone = build(*solved(read_study(file)))
    np.testing.assert_allclose(whole["force"], alone["force"], rtol=1e-6)
