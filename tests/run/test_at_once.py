"""Several at once: runs of one study, studies on one store, readers of what is written; and a clock that goes back."""

import subprocess

import numpy as np
import pytest
import xarray as xr

from epsmesh.report.dataset import write
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from tests.commands import ENVIRONMENT, ROOT, command
from tests.compare import assert_same
from tests.report.synthetic import dataset
from tests.studies import small_text

TINY = {"mesh": {"epsilon": ["4 mm", "full"], "degree": 1}, "solve": {"exact": False}}


@pytest.mark.nightly
def test_runs_of_one_study_and_of_another_share_a_store(epsmesh, tmp_path):
    """Three at once: each ends well, the store is sound, and the datasets are those of runs alone."""
    studies = {"one": small_text(**TINY), "two": small_text(material={"poisson": 0.4}, **TINY)}
    for name, text in studies.items():
        (tmp_path / f"{name}.toml").write_text(text)
    words = ("--output", tmp_path / "out", "--meshes", tmp_path / "meshes", "-q")
    processes = [
        subprocess.Popen(
            command("run", tmp_path / f"{name}.toml", *words), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True, cwd=ROOT, env=ENVIRONMENT,
        )
        for name in ("one", "one", "two")
    ]  # fmt: skip
    for process in processes:
        _, errors = process.communicate(timeout=200)
        assert process.returncode == 0, errors
    assert epsmesh("status", "--store", tmp_path / "out" / "cases.sqlite").exit_code == 0
    for name in studies:
        assert epsmesh("run", tmp_path / f"{name}.toml", "--output", tmp_path / "alone", "-q").exit_code == 0
        assert_same(tmp_path / "out" / f"{name}.nc", tmp_path / "alone" / f"{name}.nc", alike=False)
    assert {path.name for path in (tmp_path / "out").iterdir() if not path.name.startswith(".")} == {
        "cases.sqlite", *(f"{name}.{suffix}" for name in studies for suffix in ("nc", "png", "svg"))
    }  # fmt: skip


@pytest.fixture
def versions():
    """Two datasets of one study."""
    first = dataset(mesh={"epsilon": ["5 mm", "full"]})
    return first, first.assign(force=2 * first["force"])


def test_a_dataset_that_a_notebook_holds_open_is_replaced_beside_it(versions, tmp_path):
    path = tmp_path / "study.nc"
    write(versions[0], path)
    with xr.open_dataset(path) as held:
        write(versions[1], path)
        np.testing.assert_array_equal(held["force"], versions[0]["force"])
        np.testing.assert_array_equal(xr.load_dataset(path)["force"], versions[1]["force"])


def test_who_reads_while_it_is_written_gets_the_last_whole_one(versions, tmp_path, monkeypatch):
    path, seen = tmp_path / "study.nc", []
    write(versions[0], path)
    whole = xr.Dataset.to_netcdf

    def torn(self, target, **options):
        whole(self, target, **options)
        content = target.read_bytes()
        target.write_bytes(content[: len(content) // 2])
        seen.append(xr.load_dataset(path)["force"].values)
        raise OSError("the disk is full")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", torn)
    with pytest.raises(OSError, match="full"):
        write(versions[1], path)
    np.testing.assert_array_equal(seen[0], versions[0]["force"])
    np.testing.assert_array_equal(xr.load_dataset(path)["force"], versions[0]["force"])
    assert [file.name for file in tmp_path.iterdir()] == ["study.nc"]


def test_a_clock_that_goes_back_loses_nothing(tmp_path, monkeypatch):
    clock = [2e9]
    monkeypatch.setattr("time.time", lambda: clock[0])
    store = Store(tmp_path / "cases.sqlite")
    store.put(Record("before", "ok", force=1.0))
    store.put(Record("again", "failed", "no memory"))
    clock[0] -= 3600
    store.put(Record("again", "ok", force=2.0))
    store.put(Record("after", "ok", force=3.0))
    assert {key: record.force for key, record in store.get(["before", "again", "after"]).items()} == {
        "before": 1.0, "again": 2.0, "after": 3.0
    }  # fmt: skip
    store.cost_model()
    assert store.prune(older_than=60.0) == 0  # nothing is older than a minute, whatever the clock says
    assert store.prune(older_than=0.0) == 3
