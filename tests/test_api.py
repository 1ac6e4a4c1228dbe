"""The program from Python: the same as the command line, serial and on ranks, with exceptions for what is wrong."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import epsmesh
from epsmesh.plan.plan import Plan
from tests.studies import small_text

WORLD = MPI.COMM_WORLD
TEXT = small_text(
    material={"young": ["10 kPa", "20 kPa"]},
    mesh={"epsilon": ["4 mm", "full"], "fine": "3 mm", "coarse": "5 mm", "outside": "free"},
)


@pytest.fixture
def folder(tmp_path):
    """A folder that all ranks share, with a study in it."""
    shared = WORLD.bcast(tmp_path)
    if WORLD.rank == 0:
        (shared / "small.toml").write_text(TEXT)
    WORLD.barrier()
    yield shared
    WORLD.barrier()


@pytest.mark.mpi
def test_study_runs_and_every_rank_has_the_dataset(folder):
    study = epsmesh.read(folder / "small.toml")
    assert study.shape == {"young": 2, "epsilon": 2}
    data = study.run(WORLD, output=folder / "out", store=folder / "kept.sqlite")
    assert (data["status"] == "ok").all()
    np.testing.assert_allclose(data["force"].sel(young=20e3), 2 * data["force"].sel(young=10e3))
    forces = WORLD.allgather(data["force"].values.tolist())
    assert all(force == forces[0] for force in forces)
    assert int(data.attrs["ranks"]) == WORLD.size
    assert data.epsmesh.guide("50%").answer is not None
    assert (folder / "out" / "small.nc").exists()
    assert not (folder / "out" / "cases.sqlite").exists()
    assert study.run(WORLD, output=folder / "out", store=folder / "kept.sqlite").identical(data)
    again = study.run(WORLD, output=folder / "again", store=folder / "kept.sqlite")
    assert set(np.unique(again["origin"])) == {f"{origin}, stored" for origin in np.unique(data["origin"])}
    np.testing.assert_array_equal(again["force"], data["force"])
    assert not study.plan(store=folder / "kept.sqlite").solves
    opened = epsmesh.open(folder / "small.toml", folder / "out")
    np.testing.assert_array_equal(opened["force"], data["force"])


@pytest.mark.mpi
def test_store_that_cannot_be_used_is_an_exception_on_every_rank(folder):
    with pytest.raises(epsmesh.StoreError, match="cannot be"):
        epsmesh.read(folder / "small.toml").run(WORLD, output=folder, store=folder / "small.toml" / "no.sqlite")


@pytest.mark.mpi
def test_failed_cases_are_counted_in_a_warning(folder):
    if WORLD.rank == 0:
        (folder / "small.toml").write_text(TEXT.replace('"0.5 mm"', '["1e-9 mm", "0.5 mm"]'))
    WORLD.barrier()
    study = epsmesh.read(folder / "small.toml")
    if WORLD.rank == 0:
        with pytest.warns(RuntimeWarning, match=r"4 failed, the first: .*GB of memory"):
            data = study.run(WORLD, output=folder)
    else:
        data = study.run(WORLD, output=folder)
    assert (data["status"].sel(rim=1e-12) == "failed").all()
    assert (data["status"].sel(rim=0.5e-3) == "ok").all()


def test_an_interrupted_run_leaves_what_is_finished(tmp_path, monkeypatch):
    """The signal comes while the second solve is at work."""
    (tmp_path / "small.toml").write_text(TEXT.replace('"4 mm"', '"4 mm", "5 mm"'))
    study, calls = epsmesh.read(tmp_path / "small.toml"), iter(range(9))

    def machine_load():
        if next(calls) == 1:
            signal.raise_signal(signal.SIGINT)
        return 1.0

    monkeypatch.setattr("epsmesh.run.runner.machine_load", machine_load)
    with pytest.raises(KeyboardInterrupt):
        study.run(MPI.COMM_SELF, output=tmp_path)
    left = epsmesh.open(tmp_path / "small.toml", tmp_path)["status"]
    assert 0 < int((left == "ok").sum()) < left.size
    assert (study.run(MPI.COMM_SELF, output=tmp_path)["status"] == "ok").all()


def test_plan_says_what_a_run_would_do(tmp_path):
    (tmp_path / "small.toml").write_text(TEXT)
    study = epsmesh.read(str(tmp_path / "small.toml"))
    assert (study.name, study.title, study.warnings) == ("small", "small", ())
    plan = study.plan()
    assert isinstance(plan, Plan)
    assert {"scaling", "symmetry"} <= {skipped.name for skipped in plan.skipped}
    assert len(study.plan(without=["scaling"]).solves) == 2 * 2 + 1
    assert study.summary(store=tmp_path / "none.sqlite")["solves"] == len(plan.solves) == 3
    assert not (tmp_path / "none.sqlite").exists()
    with pytest.raises(ValueError, match="unknown reduction magic"):
        study.plan(without=["magic"])


@pytest.mark.parametrize("name", [None, 3, "", "a b", "../x", "é" * 101])
def test_a_study_is_called_what_a_file_can_be(name):
    with pytest.raises(ValueError, match="must be letters, digits, - and _, at most 200 bytes"):
        epsmesh.read({}, name=name)


def test_what_is_wrong_is_raised(tmp_path):
    (tmp_path / "bad.toml").write_text(TEXT.replace('"2 mm"', "2"))
    with pytest.raises(epsmesh.StudyError, match=r"probe.radius = 2: must be a number with a unit"):
        epsmesh.read(tmp_path / "bad.toml")
    with pytest.raises(epsmesh.DatasetError, match="make it with `epsmesh run"):
        epsmesh.open(tmp_path / "bad.toml", tmp_path)
    (tmp_path / "bad.nc").write_text("no netCDF")
    with pytest.raises(epsmesh.DatasetError, match=r"bad.nc: cannot be read as netCDF"):
        epsmesh.open(tmp_path / "bad.nc")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        epsmesh.nothing  # noqa: B018


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("pass", {"numpy", "xarray", "pydantic", "mpi4py", "dolfinx", "matplotlib", "gmsh"}),
        ("epsmesh.read('studies/quick.toml').plan()", {"xarray", "mpi4py", "dolfinx", "matplotlib", "gmsh"}),
    ],
)
def test_what_answers_at_once_imports_little(code, heavy):
    command = f"import sys, epsmesh; {code}; print(sorted({heavy} & set(sys.modules)))"
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout.strip() == "[]"
