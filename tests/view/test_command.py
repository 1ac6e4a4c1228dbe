"""``epsmesh view`` as a person uses it."""

import re

import pytest

from tests.commands import epsmesh
from tests.studies import small_text

STUDY = small_text(
    probe=[
        {"name": "disc, blunt", "shape": "disc", "radius": "2 mm", "depth": "0.1 mm"},
        {"name": "disc, thin", "shape": "disc", "radius": "1 mm", "depth": "0.1 mm"},
    ],
    mesh={"epsilon": ["2 mm", "4 mm"], "rim": ["0.5 mm", "1e-9 mm"]},
)


@pytest.fixture
def view(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(STUDY)
    folders = ["--output", str(tmp_path / "out"), "--meshes", str(tmp_path / "meshes")]
    return lambda *arguments: epsmesh("view", file, *arguments, *folders)


def test_export_writes_a_file_named_after_the_case(view, tmp_path):
    done = view("probe=disc, thin, epsilon=4 mm, rim=0.5 mm", "--export", "vtu", "--mesh-only")
    assert done.exit_code == 0, done.output
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["small_6.vtu"]
    assert "small_6.vtu" in done.output


def test_page_is_written_with_the_force(view, tmp_path):
    done = view("probe=disc, thin, epsilon=4 mm, rim=0.5 mm")
    assert done.exit_code == 0, done.output
    (page,) = (tmp_path / "out").iterdir()
    assert page.name == "small_6.html"
    text = page.read_text(encoding="utf-8")
    assert "<title>small</title>" in text
    assert "epsilon = 4 mm, rim = 0.5 mm" in text
    assert re.search(r"F = [0-9.]+ ± [0-9.]+ mN", text)


def test_case_that_cannot_be_solved_ends_with_1_and_says_why(view, tmp_path):
    done = view("probe=disc, blunt, epsilon=2 mm, rim=1e-9 mm", "--export", "vtu")
    assert done.exit_code == 1
    assert "failed: this case needs about" in done.output
    assert not list(tmp_path.glob("out/*"))


def test_case_that_is_not_there_is_refused(view):
    done = view("epsilon=5 mm", "--export", "vtu")
    assert done.exit_code == 2
    assert "the study has epsilon = 2 mm, 4 mm" in done.output
    assert view("99", "--export", "vtu").exit_code == 2
    assert view("0", "--export", "stl").exit_code == 2
