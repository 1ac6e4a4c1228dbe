"""`epsmesh run` of an insertion: a small box, coarse meshes, three depths."""

import json
import re
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import epsmesh as package
from epsmesh.files import STORE_NAME
from epsmesh.insertion.friction import reaction
from epsmesh.insertion.steps import PHASES
from epsmesh.plan.plan import make_plan
from epsmesh.report.read import read_file
from epsmesh.shapes.probes.blade import Blade
from epsmesh.study.toml import to_toml
from epsmesh.view.frames import frames_of

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
    done = epsmesh("run", file, "--output", folder)
    assert done.exit_code == 0, done.stderr
    return folder, done


def test_the_elastic_force_is_the_change_of_the_stored_energy(ran):
    """The force is that on the tip of the blade, the energy that of the whole body: two results of each solve."""
    folder, _ = ran
    found = read_file(folder / "pad.nc")
    cut = found.isel(depth=np.flatnonzero(found["phase"] == PHASES.index("cutting")))
    depth, force = cut["depth"].values, cut["force_elastic"].values
    work = np.diff(depth) * (force[1:] + force[:-1]) / 2
    error = np.diff(depth) * cut["force_error"].values[1:]
    assert len(depth) >= 2 and np.all(abs(np.diff(cut["energy_stored"].values) - work) < error)
    assert float(abs(cut["energy_balance"]).max()) < 0.02
    assert np.all(cut["force_error"] < 0.1 * cut["force"])


def test_the_intact_body_is_a_little_stiffer_than_a_half_space(ran):
    folder, _ = ran
    found = read_file(folder / "pad.nc")
    own = Blade.model_construct(shape="blade", length=6e-3, width=0.8e-3, depth=1e-3).half_space_stiffness
    assert 1 < float(found["puncture_force"] / found["puncture_depth"]) / (20e3 / (1 - 0.3**2) * own) < 1.3


def test_a_second_run_reads_what_was_solved(ran, epsmesh):
    folder, first = ran
    assert sorted(file.suffix for file in folder.glob("pad.*")) == [".nc", ".png", ".svg", ".toml"]
    depth = 1e3 * float(read_file(folder / "pad.nc")["puncture_depth"])
    (found,) = re.findall(r"puncture at (\S+) ± ", first.stdout)
    assert float(found) == pytest.approx(depth, rel=0.01) and "work is stored energy" in first.stdout
    files = [str(folder / f"pad.{ending}") for ending in ("nc", "png", "svg")]
    before = [Path(file).stat().st_mtime_ns for file in files]
    again = json.loads(epsmesh("run", folder / "pad.toml", "--output", folder, "--json").stdout)["studies"][0]
    assert (again["cases"], again["ok"], again["stored"]) == (1, 1, 1)
    assert again["unchanged"] == files and [Path(file).stat().st_mtime_ns for file in files] == before
    assert f"wrote {', '.join(files)};" in first.stdout
    read = package.read(folder / "pad.toml").run(output=folder)
    assert 1e3 * float(read["puncture_depth"]) == pytest.approx(depth, rel=1e-9)


@pytest.mark.nightly
def test_two_ranks_solve_the_same_states_of_the_path(ran, spawn, tmp_path):
    """Those besides its stages, too, which follow from what was solved before."""
    folder, _ = ran
    done = spawn("run", folder / "pad.toml", "--output", tmp_path, "-q", ranks=2)
    assert done.returncode == 0, done.stderr
    alone, together = (read_file(place / "pad.nc") for place in (folder, tmp_path))
    np.testing.assert_allclose(together["force"], alone["force"], rtol=1e-6)


def test_states_that_were_not_solved_leave_the_case_pending(epsmesh, tmp_path, ran):
    """A killed run has some stages: the next one goes on from them."""
    folder, _ = ran
    shutil.copy(folder / "pad.toml", tmp_path)
    shutil.copy(folder / STORE_NAME, tmp_path)
    with sqlite3.connect(tmp_path / STORE_NAME) as store:
        study = package.read(folder / "pad.toml").declared
        (lost,) = [key for key, case in zip(make_plan(study).keys, study.cases(), strict=True) if case.index == (2,)]
        assert store.execute("DELETE FROM records WHERE key = ?", (lost,)).rowcount == 1
    counted = json.loads(epsmesh("status", tmp_path / "pad.toml", "--output", tmp_path, "--json").stdout)
    assert (counted["ok"], counted["pending"]) == (0, 1)
    planned = json.loads(epsmesh("plan", tmp_path / "pad.toml", "--output", tmp_path, "--json").stdout)
    assert planned["solves"] == 1


def test_plan_tells_what_the_path_costs(epsmesh, tmp_path):
    file = tmp_path / "pad.toml"
    file.write_text(to_toml(STUDY, str(file)))
    found = json.loads(epsmesh("plan", file, "--output", tmp_path, "--json").stdout)
    assert (found["cases"], found["solves"]) == (1, 4) and found["seconds"] > 0


def test_drag_presses_the_flanks_as_those_of_a_slit_that_sticks(tmp_path):
    """κ is twice the ratio of two stiffnesses of a bonded slit: between opening and drag, and along the drag."""
    blade = {key: STUDY["probe"][key] for key in ("shape", "length", "width")}
    slit = {"contact": "bonded", "incision": "2.8 mm", "ahead": "0.8 mm", "depth": ["0.02 mm", "0.4 mm"]}
    study = STUDY | {"probe": blade | slit, "solve": {"exact": False}}
    force = package.read(study).run(output=tmp_path)["force"]
    along = float(force.diff("depth").item() / force["depth"].diff("depth").item())
    opened = float(force[0]) - along * 0.02e-3
    assert 2 * opened / (0.8e-3 * along) == pytest.approx(reaction(2e-3, 6e-3), rel=0.1)


def test_view_writes_a_film_of_the_path(ran, epsmesh):
    """Its frames are the steps, and both sides of the puncture; the last one stays."""
    folder, _ = ran
    done = epsmesh("view", folder / "pad.toml", "--output", folder)
    assert done.exit_code == 0, done.stderr
    with Image.open(folder / "pad_0_path.gif") as film:
        assert film.n_frames >= 5
        film.seek(3)
        drawn = np.asarray(film.convert("L"))
    assert drawn.std() > 20
    read = read_file(folder / "pad.nc")
    phases = [frame.phase for frame in frames_of(read)]
    assert phases == ["indentation", "puncture", "cutting", "cutting", "cutting"]


def test_two_layers_have_two_punctures_and_a_withdrawal_by_solves(tmp_path):
    """The lower one is tougher. Above the interface, the withdrawal's force is the change of the solved energies."""
    layer = {"name": "soft", "thickness": "2 mm", "young": "12 kPa", "poisson": 0.3, "toughness": "1.5 J/m^2"}
    insertion = {"to": "4 mm", "steps": 8, "withdraw": True}
    scene = {"body": STUDY["body"] | {"layer": [layer]}, "probe": STUDY["probe"] | {"insertion": insertion}}
    scene["probe"] |= {"toughness": "6 J/m^2"}
    found = package.read(STUDY | scene).run(output=tmp_path)
    depths, forces = (found[f"puncture_{name}"].values for name in ("depth", "force"))
    assert depths[0] < 2e-3 < depths[1] and forces[1] > 1.5 * forces[0]
    assert float(abs(found["energy_balance"]).max()) < 0.02
    above = found.sel(stroke="withdrawal").isel(depth=slice(0, 3))
    mean = (above["force_elastic"].values[1:] + above["force_elastic"].values[:-1]) / 2
    change = np.diff(above["energy_stored"]) / np.diff(above["depth"])
    assert np.all(abs(change - mean) < above["force_error"].values[1:])
