"""The case that a report turns round: the answer's where its mesh takes seconds, another one, or none."""

import json
import re
from html import unescape
from pathlib import Path

import pytest

from tests.commands import epsmesh as epsmesh_here
from tests.studies import small_text


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with a study that was run, where no report keeps meshes."""
    folder = tmp_path_factory.mktemp("run")
    text = small_text(mesh={"epsilon": ["3.5 mm", "full"]})
    (folder / "small.toml").write_text(text, encoding="utf-8")
    done = epsmesh_here("run", folder / "small.toml", "--output", folder, "--meshes", folder / "kept")
    assert done.exit_code == 0, done.output
    return folder


def scene(epsmesh, *options):
    """Return the page of the scene within the report of small.nc, "" if there is none."""
    done = epsmesh("report", "small.nc", *options)
    assert done.exit_code == 0, done.output
    found = re.findall('<iframe[^>]* srcdoc="([^"]*)"', Path("small.html").read_text(encoding="utf-8"))
    return unescape(found[0]) if found else ""


def test_it_is_that_of_the_answer(epsmesh, results, monkeypatch):
    monkeypatch.chdir(results)
    shown = scene(epsmesh)
    assert "small" in shown and shown == scene(epsmesh, "--scene", "answer")
    assert shown != scene(epsmesh, "--scene", "epsilon=full")


def test_it_is_left_out_where_it_is_not_wanted_or_would_take_long(epsmesh, results, monkeypatch):
    monkeypatch.chdir(results)
    assert scene(epsmesh, "--scene", "none") == ""
    before = sorted(results.iterdir())
    monkeypatch.setattr("epsmesh.cli.report._MOST_CELLS", 10)
    assert scene(epsmesh) == ""
    assert "--scene answer" in (results / "small.html").read_text(encoding="utf-8")
    assert sorted(results.iterdir()) == before


@pytest.mark.parametrize("name", ["EPSMESH_CACHE", "TMPDIR"])
def test_a_machine_that_cannot_mesh_has_a_report_all_the_same(epsmesh, results, monkeypatch, name):
    monkeypatch.chdir(results)
    monkeypatch.setenv(name, str(results / "small.toml"))
    assert scene(epsmesh) == ""


def test_a_case_that_is_none_is_told_with_its_option(epsmesh, results, monkeypatch):
    monkeypatch.chdir(results)
    done = epsmesh("report", "small.nc", "--scene", "77", "--json")
    assert done.exit_code == 2
    (error,) = json.loads(done.stdout)["errors"]
    assert (error["key"], error["value"]) == ("--scene", "77")
