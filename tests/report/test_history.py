"""Forces over time in a dataset, and what reads it: figures, guide, page, comparison."""

import numpy as np
import pytest
import xarray as xr

import pipeline.report.accessor  # noqa: F401
from pipeline.plan.plan import make_plan
from pipeline.report.compare import compare
from pipeline.report.dataset import write
from pipeline.report.figures import choose, figure
from pipeline.report.guide import guide
from pipeline.report.page import render
from pipeline.report.read import read_file
from pipeline.report.values import at_peak, elastic
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


def test_a_table_may_pull():
    table = [["0 s", "0 mm"], ["1 s", "0.2 mm"], ["2 s", "-0.1 mm"]]
    data = dataset(material=RELAXING, probe={"depth": None, "history": {"table": table}})
    assert float(data["tool_depth"].min()) == pytest.approx(-1e-4)
    assert float(data["force"].min()) < 0 < float(data["force"].max())
    assert (data["force_error"] >= 0).all()


def test_a_study_without_a_history_has_no_time():
    data = dataset()
    assert "time" not in data.dims
    assert not {"force_elastic", "tool_depth", "dissipated_energy"} & {*data}


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
