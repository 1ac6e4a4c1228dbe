"""What runs by day and by night."""

import ast

import pytest

from tests import suites


@pytest.mark.parametrize("place", suites.NIGHTLY)
def test_what_runs_by_night_is_there(place):
    path, _, name = place.partition("::")
    file = suites.ROOT / path
    assert file.exists()
    if name:
        functions = {node.name for node in ast.parse(file.read_text()).body if isinstance(node, ast.FunctionDef)}
        assert name in functions


def test_a_test_is_nightly_by_its_folder_its_name_or_a_browser():
    assert suites.is_nightly("tests/benchmarks/test_drag.py::test_one[2]")
    assert suites.is_nightly("tests/docs/test_blocks.py::test_blocks_of_a_page_run[docs/x.md]")
    assert not suites.is_nightly("tests/docs/test_blocks.py::test_blocks_of_a_page_run_well")
    assert suites.is_nightly("tests/view/test_page.py::test_one", ["tmp_path", "browser"])


def test_the_slowest_files_are_known_and_there():
    found = suites.costs()
    assert found
    assert all((suites.ROOT / file).exists() for file in found)


@pytest.mark.parametrize(
    ("file", "left_out"),
    [
        ("docs/tutorial.md", ["identification", "real time"]),
        ("pipeline/epsmesh_identify/new.py", ["real time"]),
        ("tests/export/studies/one.toml", ["identification"]),
        ("pipeline/epsmesh/extensions.py", []),  # both packages import it
        ("tests/identifications.py", ["real time"]),  # an aid of tests of identification
        ("pyproject.toml", []),
    ],
)
def test_suites_are_left_out_that_no_change_concerns(monkeypatch, file, left_out):
    monkeypatch.setattr(suites, "changed", lambda: {file})
    assert list(suites.left_out()) == left_out


def test_where_git_cannot_tell_no_suite_is_left_out(monkeypatch):
    monkeypatch.setattr(suites, "_git", lambda *_: None)
    assert list(suites.left_out()) == []
