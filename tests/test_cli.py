"""The command line as a person uses it: end to end, in a process of its own."""

import json
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from epsmesh.report.read import read_file
from epsmesh.run.reading import open_to_read
from tests.commands import ENVIRONMENT, MPIRUN, ROOT, command
from tests.compare import assert_same
from tests.conftest import SMALL


@pytest.fixture(scope="module")
def whole(epsmesh, tmp_path_factory):
    """The folder that a run of the small study has written, undisturbed: dataset, figure and store."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "small.toml").write_text(SMALL)
    done = epsmesh("run", folder / "small.toml", "--output", folder / "out")
    assert done.exit_code == 0, done.stderr
    return folder / "out"


def test_a_run_writes_a_dataset_its_figure_and_its_store(whole):
    assert {"small.nc", "small.png", "small.svg", "cases.sqlite"} <= {path.name for path in whole.iterdir()}
    with xr.open_dataset(whole / "small.nc") as data:
        assert data["force"].dims == ("poisson", "epsilon", "outside")
        assert (data["status"] == 0).all()
        assert data["status"].attrs["flag_meanings"].split()[0] == "ok"
        assert (data["force"] > 0).all()
        assert data["force"].attrs["units"] == "N"
        free = data["force_ratio"].sel(outside="free")
        assert (free.diff("epsilon") > 0).all()
        assert (data["force_ratio"].sel(outside="coarse") >= 0.98).all()
        np.testing.assert_allclose(data["force_ratio"].sel(epsilon=np.inf), 1.0)
        np.testing.assert_allclose(data["speedup"].sel(epsilon=np.inf), 1.0)
        assert {
            "study",
            "study_hash",
            "version_dolfinx",
            "version_petsc",
            "version_gmsh",
            "host",
            "ranks",
            "start",
        } <= set(data.attrs)


def test_second_run_reads_back(epsmesh, small, whole, tmp_path):
    shutil.copytree(whole, tmp_path / "a")
    again = epsmesh("run", small, "--output", tmp_path / "a")
    assert again.exit_code == 0
    assert "Stored cases are read, not computed again." in again.stdout
    one = read_file(tmp_path / "a" / "small.nc")
    assert {name.rpartition(", ")[::2] for name in np.unique(one["origin"])} == {("symmetric", "stored")}


def test_results_are_written_again_if_one_is_not_there_or_shows_something_else(epsmesh, small, whole, tmp_path):
    """Not if they have the same numbers: one that is replaced is another file."""
    shutil.copytree(whole, tmp_path / "out")
    files = [tmp_path / "out" / f"small.{suffix}" for suffix in ("nc", "png", "svg")]

    def replaced() -> bool:
        before = [file.stat().st_ino if file.exists() else 0 for file in files]
        assert epsmesh("run", small, "--output", tmp_path / "out", "--quiet").exit_code == 0
        after = [file.stat().st_ino for file in files]
        assert len({one == other for one, other in zip(before, after, strict=True)}) == 1
        return before != after

    assert replaced()  # the study was at another place
    assert not replaced()
    files[2].unlink()
    assert replaced()
    assert not replaced()
    files[1].write_bytes(files[1].read_bytes()[:100])
    assert replaced()
    small.write_text(SMALL.replace('title = "small"', 'title = "another"'))
    assert replaced()
    assert "another" in files[2].read_text()


def test_bad_study_ends_with_2_and_writes_nothing(spawn, small, tmp_path):
    small.write_text(SMALL.replace('"2 mm"', "2").replace("0.4", "0.9"))
    done = spawn("run", small, "--output", tmp_path / "out", ranks=2)
    assert done.returncode == 2
    assert "probe.radius = 2" in done.stderr
    assert "material.poisson = 0.9" in done.stderr
    assert done.stderr.count("probe.radius") == 1
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_rank_that_alone_knows_a_reason_tells_it(small, tmp_path):
    """A rank that leaves with a bad status takes the others with it: none may do so before somebody has spoken."""
    bad = tmp_path / "bad.toml"
    bad.write_text(SMALL.replace('"2 mm"', "2"))
    script = (
        'file=$1; shift; if [ "${OMPI_COMM_WORLD_RANK:-$PMI_RANK}" = 0 ]; then file=$1; sleep 2; fi; shift; '
        'exec "$@" "$file"'
    )
    run = [sys.executable, "-m", "epsmesh", "run", "--output", str(tmp_path / "out")]
    ranks = [*MPIRUN, "2", "sh", "-c", script, "sh", str(bad), str(small), *run]
    done = subprocess.run(ranks, capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=100, cwd=ROOT)
    assert done.returncode == 2
    assert done.stderr.count("probe.radius = 2") == 1


def test_interrupted_run_leaves_what_is_done_and_goes_on(epsmesh, small, whole, tmp_path):
    """By SIGTERM; a parallel one, below, by SIGINT."""
    process = subprocess.Popen(
        command("run", small, "--output", tmp_path / "a"),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    assert process.stderr is not None
    while "[solve 2/" not in process.stderr.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "continues" in errors
    partial = read_file(tmp_path / "a" / "small.nc")
    assert 0 < int((partial["status"] == "ok").sum()) < partial["status"].size
    assert epsmesh("run", small, "--output", tmp_path / "a").exit_code == 0
    resumed, undisturbed = (read_file(folder / "small.nc") for folder in (tmp_path / "a", whole))
    for name in ("force", "force_vector", "energy", "dofs", "cells", "force_ratio", "status"):
        xr.testing.assert_allclose(resumed[name], undisturbed[name], rtol=1e-9)


def test_interrupted_parallel_run_writes_what_is_done_and_two_ranks_agree_with_one(spawn, small, whole, tmp_path):
    process = subprocess.Popen(
        command("run", small, "--output", tmp_path, ranks=2),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True, cwd=ROOT, env=ENVIRONMENT,
    )  # fmt: skip
    assert process.stderr is not None
    while "[solve 2/" not in process.stderr.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode != 0
    with open_to_read(tmp_path / "cases.sqlite") as records:
        assert len(records.rows()) >= 2  # F_exact of scenes among them
    again = spawn("run", small, "--output", tmp_path, ranks=2)
    assert again.returncode == 0, again.stderr
    assert again.stdout.count("small.nc") == 1  # of one rank; all may have been finished before the signal was heard
    one, two = (read_file(folder / "small.nc") for folder in (whole, tmp_path))
    assert (two["status"] == "ok").all()
    np.testing.assert_allclose(two["force"], one["force"], rtol=1e-8)


@pytest.mark.nightly
def test_run_killed_at_random_moments_yields_the_same_dataset(epsmesh, small, whole, tmp_path):
    """SIGKILL, again and again, at any moment: nothing finished is lost, and in the end nothing tells it happened.

    Of the cases that were under way some may have failed in the run after it, and are tried again by the next.

    `make faults` does so a hundred times, with other signals, phases and ranks.
    """
    random = np.random.default_rng(1)
    words = command("run", small, "--output", tmp_path / "killed", "--meshes", tmp_path / "meshes")
    done = 0
    for _ in range(4):
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT)
        try:
            process.wait(timeout=random.uniform(1.0, 5.0))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        status = json.loads(epsmesh("status", small, "--output", tmp_path / "killed", "--json").stdout)
        assert status["ok"] >= done
        done = status["ok"]
    last = epsmesh("run", small, "--output", tmp_path / "killed")
    if "an earlier run was killed" in last.stderr:
        last = epsmesh("run", small, "--output", tmp_path / "killed")
    assert last.exit_code == 0, last.stderr
    assert epsmesh("status", "--store", tmp_path / "killed" / "cases.sqlite").exit_code == 0
    assert_same(*(folder / "small.nc" for folder in (tmp_path / "killed", whole)), alike=False)


def test_plan_story_and_store(epsmesh, small, whole, tmp_path):
    planned = json.loads(epsmesh("plan", small, "--output", tmp_path, "--json").stdout)
    assert planned["cases"] == 12
    assert {"full", "symmetry", "shared-mesh"} <= {skipped["name"] for skipped in planned["skipped"]}
    assert "Body, support and probe" in epsmesh("plan", small, "--output", tmp_path).stdout
    without = json.loads(epsmesh("plan", small, "--output", tmp_path, "--without", "all", "--json").stdout)
    assert without["solves"] > planned["solves"]
    assert epsmesh("plan", small, "--without", "everything").exit_code == 2
    shutil.copy(whole / "cases.sqlite", tmp_path)
    assert epsmesh("run", small, "--output", tmp_path, "-q").exit_code == 0
    assert json.loads(epsmesh("plan", small, "--output", tmp_path, "--json").stdout)["solves"] == 0
    told = epsmesh("plan", small, "poisson=0.3, epsilon=full", "--output", tmp_path).stdout
    assert "epsilon = full" in told
    assert "origin: symmetric" in told
    assert "proportional" in told
    assert epsmesh("plan", small, "poisson=0.31", "--output", tmp_path).exit_code == 2
    store = tmp_path / "cases.sqlite"
    listed = json.loads(epsmesh("status", "--store", store, "--json").stdout)
    assert (listed["records"], listed["sound"]) == (planned["solves"], True)


def test_plans_status_and_figures(epsmesh, small, tmp_path):
    assert ": 12 cases (2 poisson × 3 epsilon × 2 outside)\n" in epsmesh("plan", small, "--output", tmp_path).stdout
    other = tmp_path / "other.toml"
    other.write_text(small.read_text())
    both = epsmesh("plan", small, other, "--output", tmp_path)
    assert [line.partition("; ")[0] for line in both.stdout.splitlines()] == [f"{x}: 12 cases" for x in (small, other)]
    found = json.loads(epsmesh("plan", small, other, "--output", tmp_path, "--json").stdout)
    assert [one["cases"] for one in found] == [12, 12]
    other.write_text(small.read_text().replace("0.1 mm", "-0.1 mm"))
    wrong = epsmesh("plan", small, other, "--output", tmp_path)
    assert (wrong.exit_code, wrong.stdout, str(other) in wrong.stderr) == (2, "", True)
    assert "12 pending" in epsmesh("status", small, "--output", tmp_path).stdout
    assert epsmesh("report", small, "--figures", "--output", tmp_path).exit_code == 2
