"""`epsmesh insertion` on solved states: a small box, coarse meshes, three depths."""

import json

import numpy as np
import pytest
import xarray as xr

import pipeline
from pipeline.insertion.steps import PHASES
from pipeline.study.toml import to_toml

STUDY = {
    "title": "A blade through a pad",
    "body": {"shape": "box", "size": ["24 mm", "24 mm", "12 mm"], "fixed": "bottom"},
    "material": {"young": "20 kPa", "poisson": 0.3},
    "probe": {
        "shape": "blade",
        "length": "6 mm",
        "width": "0.8 mm",
        "contact": "unilateral",
        "friction": 0.3,
        "toughness": "2 J/m^2",
        "insertion": {"to": "3 mm", "steps": 3},
    },
    "mesh": {"accuracy": "10 %"},
}


@pytest.fixture(scope="module")
def ran(epsmesh, tmp_path_factory):
    folder = tmp_path_factory.mktemp("insertion")
    file = folder / "pad.toml"
    file.write_text(to_toml(STUDY, str(file)))
    done = epsmesh("insertion", file, "--output", folder, "--json")
    assert done.exit_code == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_the_elastic_force_is_the_change_of_the_stored_energy(ran):
    """The force is that on the tip of the blade, the energy that of the whole body: two results of each solve."""
    folder, _ = ran
    with xr.open_dataset(folder / "pad_insertion.nc") as found:
        cut = found.isel(depth=np.flatnonzero(found["phase"] == PHASES.index("cutting"))).load()
    depth, force = cut["depth"].values[1:], cut["force_elastic"].values[1:]
    work = np.diff(depth) * (force[1:] + force[:-1]) / 2
    error = np.diff(depth) * cut["force_error"].values[2:]
    assert np.all(abs(np.diff(cut["energy_stored"].values[1:]) - work) < error)
    assert float(abs(cut["balance"]).max()) < 0.02
    assert np.all(cut["force_error"] < 0.1 * cut["force"])


def test_a_second_run_reads_what_was_solved(ran, epsmesh):
    folder, first = ran
    assert sorted(file.suffix for file in folder.glob("pad_insertion.*")) == [".nc", ".png", ".svg"]
    again = epsmesh("insertion", folder / "pad.toml", "--output", folder)
    assert again.exit_code == 0, again.stderr
    depth = round(1e3 * first["insertion"]["puncture_depth"], 5)
    assert f"puncture at {depth:g} mm" in again.stdout
    assert "work is stored energy" in again.stdout
    read = pipeline.read(folder / "pad.toml").insertion(output=folder)
    assert float(read["puncture_depth"]) == first["insertion"]["puncture_depth"]


def test_a_study_without_an_insertion_is_refused(epsmesh, tmp_path):
    probe = {key: value for key, value in STUDY["probe"].items() if key not in ("insertion", "toughness")}
    file = tmp_path / "press.toml"
    file.write_text(to_toml(STUDY | {"probe": probe | {"depth": "0.1 mm"}}, str(file)))
    done = epsmesh("insertion", file, "--output", tmp_path)
    assert done.exit_code == 2
    assert "probe.insertion: is required for `epsmesh insertion`" in done.stderr


def test_plan_tells_what_the_path_costs(epsmesh, tmp_path):
    file = tmp_path / "pad.toml"
    file.write_text(to_toml(STUDY, str(file)))
    found = json.loads(epsmesh("plan", file, "--output", tmp_path, "--json").stdout)
    (told,) = found["forecasts"]
    assert (told["command"], told["most"]) == ("insertion", 5) and told["most_seconds"] > 0
