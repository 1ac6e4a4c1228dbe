"""A package that has never been heard of adds to this one, by what the docstring of `epsmesh.extensions` says alone."""

import json

import pytest
import xarray as xr

import epsmesh as package
from epsmesh import extensions
from epsmesh.report.read import check_kind
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.starter import starter
from tests.cases import raw

SOURCE = '''
"""Notes on studies."""

from typing import Annotated

import typer
import xarray as xr

from epsmesh.extensions import Forecast, Kind, Sections
from epsmesh.shapes.section import Section, Words


class Note(Section):
    """A remark."""

    text: Annotated[str, Words("What to remember.", '"wet"')]


def read(study):
    if study.given["note"]["text"] == "bad":
        study.problems.error("note.text", "bad", "must be good")
    return {"note": Note.model_validate(study.given["note"]).text}


def note(word: str) -> None:
    """Print a note."""
    typer.echo(f"noted: {word}")


def noted(study, end="."):
    return study.declared.extra["note"] + end


def opened(path):
    return xr.Dataset({"note": len(path.read_text())})


def draw(dataset, stem):
    path = stem.with_suffix(".png")
    path.write_bytes(b"")
    return [path]


def write_page(dataset, path):
    path.write_text("a note")
    return path


SECTIONS = Sections(
    models={"note": Note}, texts={"note": "Remarks on a study."}, read=read, pages={"note": "guide/results"},
    left_out=lambda study: "its note is not run",
    forecast=lambda study, cost: [Forecast({"of": "note"}, "  a note: no work")],
)
KIND = Kind("a note", "note", lambda dataset: "note" in dataset, write_page, draw)
'''
DECLARED = """
[console_scripts]
note = notes:main

[epsmesh.commands]
guide.note = notes:note
note.last = notes:note

[epsmesh.sections]
note = notes:SECTIONS

[epsmesh.datasets]
note = notes:KIND

[epsmesh.files]
note = notes:opened

[epsmesh.methods]
noted = notes:noted
"""


@pytest.fixture
def _notes(tmp_path, monkeypatch):
    """Install the package."""
    place = tmp_path / "site"
    (place / "notes-1.0.dist-info").mkdir(parents=True)
    (place / "notes-1.0.dist-info" / "entry_points.txt").write_text(DECLARED)
    (place / "notes.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(place)
    extensions._declared.cache_clear()
    yield
    extensions._declared.cache_clear()


@pytest.fixture
def _alone(monkeypatch):
    """Let nothing be installed beside this package."""
    monkeypatch.setattr(extensions, "_declared", dict)


@pytest.mark.usefixtures("_notes")
def test_a_command_is_listed_at_its_place_and_runs(epsmesh):
    names = (line.split() for line in epsmesh("--help").stdout.partition("Commands:")[2].splitlines())
    listed = [name for name, *_ in filter(None, names) if name in ("guide", "note", "last", "compare")]
    assert listed == ["guide", "note", "last", "compare"]
    assert epsmesh("note", "wet").stdout == "noted: wet\n"
    assert epsmesh("note").exit_code == 2
    assert "Did you mean 'note'" in epsmesh("noet").output


@pytest.mark.usefixtures("_notes")
def test_a_section_is_read_explained_and_told(epsmesh, tmp_path):
    study = package.read(raw() | {"note": {"text": "wet"}}, "wet")
    assert study.declared.extra == {"note": "wet"}
    assert study.noted(end="!") == "wet!"
    assert "# Remarks on a study.\n# [note]\n# What to remember." in starter("x")
    with pytest.raises(StudyError, match=r"note\.text.*must be good") as wrong:
        parse(raw() | {"note": {"text": "bad"}})
    assert wrong.value.problems[0].howto == "docs/guide/results.md"
    file = tmp_path / "wet.toml"
    file.write_text(study.declared.text)
    planned = epsmesh("plan", file, "--output", tmp_path, "--json")
    assert json.loads(planned.stdout)["forecasts"][0] == {"of": "note"}
    assert "  a note: no work" in epsmesh("plan", file, "--output", tmp_path).stdout


@pytest.mark.usefixtures("_notes")
def test_a_kind_of_dataset_has_its_page_and_is_not_replaced(epsmesh, tmp_path):
    path = tmp_path / "wet.nc"
    xr.Dataset({"note": 1}).to_netcdf(path)
    assert epsmesh("report", path).exit_code == 0
    assert (tmp_path / "wet.html").read_text() == "a note"
    assert epsmesh("report", path, "--figures").stdout.strip() == str(tmp_path / "wet.png")
    check_kind(path, "note")
    for other in ("", "identification"):
        with pytest.raises(FileExistsError, match="is the note, and is not replaced"):
            check_kind(path, other)
    (tmp_path / "wet.note").write_text("wet")
    assert package.open(tmp_path / "wet.note")["note"] == 3
    assert "is a note, not a study's dataset" in epsmesh("guide", path, "--accuracy", "5%").stderr


@pytest.mark.usefixtures("_alone")
def test_without_other_packages_a_study_has_its_own_sections_alone(epsmesh):
    with pytest.raises(StudyError, match=r"measurement: unknown section"):
        parse(raw() | {"measurement": [{"file": "a.csv"}]})
    assert not hasattr(package.read(raw(), "plain"), "identify")
    assert "  identify " not in epsmesh("--help").stdout
    assert "No such command" in epsmesh("identify").stderr
    assert "measurement" not in starter("x")
