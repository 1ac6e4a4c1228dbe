"""Forces over time in a dataset, and what reads it: figures, guide, page, comparison."""

import numpy as np
import pytest
import xarray as xr
from mpi4py import MPI

import epsmesh.report.accessor  # noqa: F401
from epsmesh.cli.words import axes_of
from epsmesh.plan.describe import summary
from epsmesh.plan.plan import make_plan
from epsmesh.report.compare import compare
from epsmesh.report.dataset import build, write
from epsmesh.report.figures import choose, figure
from epsmesh.report.guide import guide
from epsmesh.report.page import render
from epsmesh.report.read import read_file
from epsmesh.report.values import at_peak, elastic
from epsmesh.run.execute import compute
from epsmesh.run.outcome import count_states
from epsmesh.run.record import Record
from tests.cases import study
from tests.report.synthetic import dataset

RELAXING = {"young": "10 kPa", "poisson": 0.3, "relaxation": [{"share": 0.4, "time": "2 s"}]}
HISTORY = {"ramp": ["0.5 s", "2 s"], "hold": "10 s"}
MESHES = {"epsilon": ["6 mm", "full"]}


def relaxing(**changes):
    probe = {"history": HISTORY} | changes.pop("probe", {})
    return dataset(material=RELAXING, probe=probe, mesh=MESHES, solve={"exact": True}, **changes)


def test_the_force_is_the_elastic_one_times_a_function_of_time():
    data = relaxing()
    assert data["force"].dims == ("ramp", "epsilon", "time")
    assert data["time"].attrs["units"] == "s"
    assert data["tool_depth"].dims == ("ramp", "time")
    static = dataset(material={"young": "10 kPa", "poisson": 0.3}, mesh=MESHES, solve={"exact": True})
    ramped = data.sel(ramp=2.0)
    xr.testing.assert_allclose(ramped["force_elastic"].drop_vars("ramp"), static["force"].rename("force_elastic"))
    times = ramped["time"].values[ramped["time"] <= 12]
    held = np.maximum(times - 2, 0)
    ratio = 0.6 * np.minimum(times, 2) / 2 + 0.4 * (1 - np.exp(-np.minimum(times, 2) / 2)) * np.exp(-held / 2)
    for epsilon in range(2):
        force = ramped.isel(epsilon=epsilon).sel(time=times)
        assert (force["force"] / force["force_elastic"]).values == pytest.approx(ratio, rel=1e-12)
        bar = float(elastic(data)["force_error"].isel(ramp=1, epsilon=epsilon))
        assert force["force_error"].values == pytest.approx(bar * ratio)
        assert (force["force_vector"].isel(component=2) / force["force"]).values[1:] == pytest.approx(
            float((force["force_vector"].isel(component=2) / force["force"])[1])
        )


def test_ratios_of_meshes_do_not_depend_on_time():
    data = relaxing()
    for name in ("force_ratio", "force_exact_ratio"):
        assert float(data[name].std("time").max()) < 1e-12
    assert np.isnan(data["force"].sel(ramp=0.5).sel(time=data["time"] > 10.5)).all()


def test_several_speeds_and_relaxations_cost_one_solve():
    speeds = study(material=RELAXING, probe={"history": {"ramp": ["0.1 s", "1 s", "10 s"]}})
    assert len(make_plan(speeds).solves) == 1
    assert make_plan(speeds).keys == make_plan(study(material={"young": "10 kPa", "poisson": 0.3})).keys * 3
    tables = [
        {"name": name, "history": {"table": [["0 s", "0 mm"], ["1 s", f"{depth} mm"]]}}
        for name, depth in (("one", 0.1), ("other", -0.3))
    ]
    base = {"shape": "disc", "radius": "2 mm"}
    assert len(make_plan(study(probe=[base | table for table in tables])).solves) == 1


def test_all_numbers_of_a_history_but_a_table_are_swept():
    sine = {"amplitude": ["0.01 mm", "0.02 mm"], "frequency": ["1 Hz", "2 Hz", "3 Hz"], "periods": [2, 3]}
    history = {"ramp": ["1 s", "2 s"], "hold": ["1 s", "2 s", "3 s"], "steps": [5, 10], "sine": sine}
    swept = study(material=RELAXING, probe={"history": history}).shape
    assert swept == (2, 3, 2, 2, 3, 2)


def test_a_table_may_pull():
    table = [["0 s", "0 mm"], ["1 s", "0.2 mm"], ["2 s", "-0.1 mm"]]
    data = dataset(material=RELAXING, probe={"depth": None, "history": {"table": table}})
    assert float(data["tool_depth"].min()) == pytest.approx(-1e-4)
    assert float(data["force"].min()) < 0 < float(data["force"].max())
    assert (data["force_error"] >= 0).all()


def test_what_reads_a_dataset_reads_one_with_time(tmp_path):
    data = relaxing()
    assert choose(data)[0] == "history"
    for kind in choose(data):
        figure(data, kind)
    write(data, tmp_path / "one.nc")
    again = read_file(tmp_path / "one.nc")
    xr.testing.assert_allclose(again["force"], data["force"])
    assert guide(again, "5 %").sentence == guide(elastic(data), "5 %").sentence
    assert "history" in render(again, "one")
    assert compare(data, again).agrees
    assert not compare(data, again.assign(force=2 * again["force"])).agrees
    assert len(data.epsmesh.to_frame()) == data["force"].size


def test_the_peak_is_that_of_each_case():
    peak = at_peak(relaxing())
    assert "time" not in peak.dims
    assert (peak["force"].sel(ramp=0.5) > peak["force"].sel(ramp=2.0)).all()
    assert (peak["force_elastic"] > peak["force"]).all()


def test_loads_creep_and_their_force_does_not():
    """Loads that have acted for long: the sag is that of tissue with the modulus that is left."""
    load = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
    changes = {"load": load, "probe": {"at": ["0 mm", "0 mm"]}, "mesh": {"epsilon": "full", "fine": "6 mm"}}
    material = {"young": "10 kPa", "poisson": 0.3, "density": "1000 kg/m^3"}
    relaxing = material | {"relaxation": [{"share": 0.4, "time": "2 s"}]}
    found = []
    for tissue, history in (
        (relaxing, {"history": {"ramp": "1 s"}}),
        (material, {}),
        (material | {"young": "6 kPa"}, {}),
    ):
        plan = make_plan(study(**changes | {"material": tissue, "probe": changes["probe"] | history}))
        found.append(build(plan, compute(plan, MPI.COMM_SELF)))
    crept, stiff, soft = found
    for name in ("sag", "load_energy", "load_force"):
        assert float(crept[name]) == pytest.approx(float(soft[name]), rel=1e-6)
    assert float(crept["force_elastic"]) == pytest.approx(float(stiff["force"]), rel=1e-9)
    assert np.isnan(crept["max_strain"])


SPHERE = {"shape": "sphere", "radius": "4 mm", "depth": "0.4 mm", "contact": "unilateral"}


def found(**changes):
    material = {"young": "10 kPa", "poisson": 0.3, "relaxation": [{"share": 0.4, "time": "2 s"}]}
    return dataset(material=material, probe=SPHERE | changes, mesh=MESHES)


def test_stages_of_found_contact_become_time():
    data = found(history={"ramp": ["1 s", "3 s"], "hold": "5 s"})
    assert data["force"].dims == ("ramp", "epsilon", "time")
    assert data["contact_area"].dims == ("ramp", "epsilon", "time")
    assert data["status"].dims == data["time_total"].dims == ("ramp", "epsilon")
    assert "step" not in {*data.dims, *data.coords}
    assert compare(data, data).agrees
    for kind in choose(data):
        figure(data, kind)
    render(data, "found")


def test_a_history_in_time_steps_is_in_the_dataset_like_any_other():
    """Two speeds on one mesh; at once and after a long time F is that of the moduli at these times."""
    probe = {"depth": "0.3 mm", "history": {"ramp": ["0 s", "1 s"], "hold": "60 s", "steps": 4}}
    material = RELAXING | {"law": "neo-hookean"}
    plan = make_plan(study(material=material, probe=probe))
    data = build(plan, compute(plan, MPI.COMM_SELF))
    assert (len(plan.solves), len(plan.meshes)) == (2, 1)
    assert data["force"].dims == ("ramp", "time")
    assert list(data["status"].values) == ["ok", "ok"]
    elastic_force = data["force_elastic"]
    jump, slow = data["force"].sel(ramp=0.0), data["force"].sel(ramp=1.0)
    assert float(jump[0]) == pytest.approx(float(elastic_force[0]), rel=1e-6)
    for force, end in ((jump, 60.0), (slow, 61.0)):
        assert float(force.sel(time=end)) == pytest.approx(0.6 * float(elastic_force[0]), rel=1e-6)
    assert np.isnan(jump.sel(time=61.0))
    assert (data["force_error"].sel(ramp=1.0, time=61.0) > 0).all()
    heat = data["dissipated_energy"].sel(ramp=1.0)
    assert (heat.diff("time") > -1e-6 * heat.max()).all()
    assert np.isnan(data["max_strain"]).all()
    stiffer = make_plan(study(material=material | {"young": "20 kPa"}, probe=probe))
    assert {one.key for one in stiffer.solves} == {one.key for one in plan.solves}
    twice = build(stiffer, compute(plan, MPI.COMM_SELF))
    assert twice["force"].values == pytest.approx(2 * data["force"].values, rel=1e-12, nan_ok=True)


def test_the_stages_of_a_history_count_as_one_case():
    plan = make_plan(study(probe=SPHERE | {"history": {"ramp": ["1 s", "3 s"]}}, mesh={"epsilon": "8 mm"}))
    assert summary(plan)["cases"] == len(plan.study) == 2
    assert axes_of(plan.study) == " (2 ramp)"
    done = {solve.key: Record(solve.key, "ok") for solve in plan.solves}
    assert count_states(plan, {}) == {"ok": 0, "skipped": 0, "failed": 0, "pending": 2}
    assert count_states(plan, done)["ok"] == 2
    last = plan.solves[-1].key
    assert count_states(plan, done | {last: Record(last, "partial")})["partial"] == 2


def test_a_failed_stage_fails_the_history():
    data = dataset(failed=1, material=RELAXING, probe=SPHERE | {"history": {"ramp": "1 s"}}, mesh={"epsilon": "8 mm"})
    assert data["status"] == "failed"
    assert data["message"] == "it went wrong"
    assert np.isnan(data["force"]).all()


def test_elastic_contact_over_time_is_that_of_the_depths_on_the_way():
    """Of depths that no stage has; area and radius stay while the tool does."""
    scene = {"body": {"shape": "cylinder", "radius": "20 mm", "height": "8 mm"}, "mesh": {"accuracy": "1 %"}}
    scene["mesh"] |= dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
    scene["body"] |= {"size": None}
    sphere = {key: value for key, value in SPHERE.items() if key != "depth"}
    table = {"table": [["0 s", "0 mm"], ["4 s", "0.4 mm"], ["6 s", "0.4 mm"]], "steps": 60}
    plan = make_plan(study(**scene, probe=sphere | {"depth": None, "history": table}))
    data = build(plan, compute(plan, MPI.COMM_SELF))
    scene["mesh"] |= {"accuracy": "0.3 %"}
    static = make_plan(study(**scene, probe=sphere | {"depth": ["0.02 mm", "0.1 mm", "0.3 mm"]}))
    known = build(static, compute(static, MPI.COMM_SELF))
    at = data.sel(time=[0.2, 1.0, 3.0], method="nearest")
    assert data["status"] == "ok"
    assert (abs(at["force"].values - known["force"].values) <= at["force_error"].values).all()
    assert at["force"].values == pytest.approx(known["force"].values, rel=8e-3)
    assert at["contact_radius"].values == pytest.approx(known["contact_radius"].values, rel=0.03)
    for name in ("force", "contact_area", "contact_radius"):
        assert float(data[name].sel(time=slice(4, 6)).std()) == pytest.approx(0, abs=1e-12)
