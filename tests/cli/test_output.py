"""What cannot be written is found before anything is computed; who no longer reads ends nothing."""

import errno
import json
import os
import re
import shlex
import shutil
import sqlite3
import subprocess

import pytest
import typer

from epsmesh.cli import words
from epsmesh.cli.words import or_elsewhere
from epsmesh.study.named import EXAMPLES
from tests.commands import ENVIRONMENT, command, talk
from tests.commands import epsmesh as epsmesh_here
from tests.studies import small_text

# What stands where, and what is said of it.
IN_THE_WAY = {
    "a file for the folder": ("out", "", ("--output", "out"), "out/cases.sqlite: cannot be written: out is a file"),
    "a folder for the dataset": ("out/small.nc", None, ("--output", "out"), "out/small.nc: is a folder"),
    "a folder for the figure": ("out/small.png", None, ("--output", "out"), "out/small.png: is a folder"),
    "a file for the meshes": ("kept", "", ("--meshes", "kept"), "kept is a file, not a folder"),
    "a device for the store": ("x", "", ("--store", "/dev/full"), "/dev/full: is no plain file"),
    "a folder that is a device": ("x", "", ("--output", "/dev/full"), "/dev/full is a file, not a folder"),
    "a folder of the system's": ("x", "", ("--output", "/proc/none"), "cannot be written"),
}


@pytest.mark.parametrize("name", IN_THE_WAY)
def test_what_cannot_be_written_is_found_first(name, epsmesh, tmp_path, monkeypatch):
    place, content, options, message = IN_THE_WAY[name]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(small_text(), encoding="utf-8")
    if content is None:
        (tmp_path / place).mkdir(parents=True)
    else:
        (tmp_path / place).write_text(content)
    done = epsmesh("run", "small.toml", *options)
    assert done.exit_code == 2
    assert message in done.stderr
    assert not done.stdout
    assert not list(tmp_path.rglob("*.npz"))


def test_a_full_standard_output_is_told(tmp_path):
    (tmp_path / "small.toml").write_text(small_text(), encoding="utf-8")
    with open("/dev/full", "w") as full:  # noqa: PTH123
        done = subprocess.run(
            command("plan", tmp_path / "small.toml"),
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (2, "standard output: No space left on device\n")


def test_a_reader_that_goes_away_ends_nothing(tmp_path):
    (tmp_path / "small.toml").write_text(small_text(mesh={"epsilon": "full"}, solve={"exact": False}), encoding="utf-8")
    reading, writing = os.pipe()
    os.close(reading)
    arguments = ("run", "small.toml", "--verbose", "--output", "out")
    done = subprocess.run(command(*arguments), stdout=writing, stderr=writing, cwd=tmp_path, check=False)
    os.close(writing)
    assert done.returncode == 0
    assert (tmp_path / "out" / "small.nc").is_file()


def test_a_disk_that_fills_while_results_are_written_loses_no_record(epsmesh, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    file = tmp_path / "small.toml"
    file.write_text(small_text(mesh={"epsilon": "full"}, solve={"exact": False}), encoding="utf-8")
    options = ("--output", tmp_path / "out", "--meshes", tmp_path / "meshes")
    with monkeypatch.context() as patched:
        patched.setattr("epsmesh.report.dataset.write", full)
        done = epsmesh("run", file, *options)
    assert done.exit_code == 2
    (line,) = [line for line in done.stderr.splitlines() if "cannot be written" in line]
    assert "No space left on device" in line
    assert "(1 from the store)" in epsmesh("run", file, *options).stdout


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with two studies that were run: small.toml, out/small.nc and out/cases.sqlite; swept.toml likewise."""
    folder, options = tmp_path_factory.mktemp("run"), {"mesh": {"epsilon": "full"}, "solve": {"exact": False}}
    files = [folder / "small.toml", folder / "swept.toml"]
    for file, depth in zip(files, ("0.1 mm", ["0.1 mm", "0.2 mm"]), strict=True):
        file.write_text(small_text(**options, probe={"depth": depth}), encoding="utf-8")
    done = epsmesh_here("run", *files, "--output", folder / "out", "--meshes", folder / "meshes")
    assert done.exit_code == 0, done.output
    return folder


# What stands in the way of which command, of those that write other files than `run` does.
COMMANDS = {
    "figures": ("out/swept.svg", ("report", "out/swept.nc", "--figures")),
    "report": ("out/small.html", ("report", "out/small.nc")),
    "report of a scene": ("out/small.html", ("report", "out/small.nc", "--scene", "0")),
    "view as a page": ("more/small_0.html", ("view", "small.toml", "0", "--export", "html", "--output", "more")),
    "view for ParaView": ("more/small_0.vtu", ("view", "small.toml", "0", "--export", "vtu", "--output", "more")),
    "touch": ("more/page.html", ("touch", "page.epsm", "--output", "more")),
    "export": ("more/small.epsm", ("export", "small.toml", "--output", "more")),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_finds_first_what_it_cannot_write(name, epsmesh, results, tmp_path, monkeypatch):
    place, arguments = COMMANDS[name]
    shutil.copytree(results, tmp_path, dirs_exist_ok=True)
    (tmp_path / place).unlink(missing_ok=True)
    (tmp_path / place).mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    done = epsmesh(*arguments)
    assert done.exit_code == 2, done.output
    assert done.stderr == f"{place}: is a folder, and a file of that name is to be written\n"
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("arguments", [("new", "small.toml/x.toml"), ("export", "--evaluator", "small.toml/x")])
def test_a_file_in_the_place_of_a_folder_is_told(epsmesh, results, monkeypatch, arguments):
    monkeypatch.chdir(results)
    done = epsmesh(*arguments)
    assert done.exit_code == 2
    assert re.match(r"small.toml/x[^:]*: (Not a directory|cannot be written: small.toml is a file)", done.stderr)


def test_a_disk_that_fills_while_a_page_is_written_is_told(epsmesh, results, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/small.html")

    monkeypatch.chdir(results)
    monkeypatch.setattr("epsmesh.report.page.write_page", full)
    done = epsmesh("report", "out/small.nc", "--json")
    assert (done.exit_code, done.stderr) == (2, "out/small.html: cannot be written: No space left on device\n")
    assert json.loads(done.stdout)["errors"][0]["file"] == "out/small.html"


@pytest.mark.parametrize("name", ["EPSMESH_CACHE", "TMPDIR"])
def test_a_folder_that_the_system_needs_is_looked_at_first(epsmesh, results, tmp_path, monkeypatch, name):
    (tmp_path / "file").touch()
    monkeypatch.setenv(name, str(tmp_path / "file"))
    monkeypatch.chdir(results)
    done = epsmesh("run", "small.toml", "--fresh", "--output", tmp_path / "out")
    assert done.exit_code == 2
    assert f"file is a file, not a folder; set the environment variable {name} to another" in done.stderr


def test_a_store_that_cannot_be_changed_is_told(epsmesh, results, tmp_path, monkeypatch):
    """As on a read-only disk; who may do everything is refused by SQLite alone."""
    path = tmp_path / "cases.sqlite"
    shutil.copy(results / "out" / "cases.sqlite", path)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE records SET record = ''")
    monkeypatch.setattr("epsmesh.run.store._open", lambda path: sqlite3.connect(f"file:{path}?mode=ro", uri=True))
    assert epsmesh("status", "--prune", "--store", path).exit_code == 0
    done = epsmesh("status", "--prune", "--store", path, "--yes")
    assert done.exit_code == 2
    assert "readonly" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("plan", "small.toml", "--json"),
        pytest.param(("--version", "--verbose"), marks=pytest.mark.nightly),
        pytest.param(("view", EXAMPLES / "../meshes/patient.nii.gz"), marks=pytest.mark.nightly),
    ],
)
def test_a_command_whose_reader_went_away_ends_with_0(results, words):
    """Some load PETSc, which takes the signal for a crash."""
    reading, writing = os.pipe()
    os.close(reading)
    words = command(*words)
    done = subprocess.run(words, stdout=writing, stderr=subprocess.PIPE, text=True, cwd=results, check=False)
    os.close(writing)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)


@pytest.mark.nightly
def test_streams_that_are_closed_are_none_of_a_commands_files(results, tmp_path):
    """What libraries print would else go into the case store, or into what takes its number next."""
    shutil.copy(results / "small.toml", tmp_path)
    run = shlex.join(command("run", "small.toml", "--output", "out"))
    done = subprocess.run(f"{run} <&- >&- 2>&-", shell=True, cwd=tmp_path, env=ENVIRONMENT, check=False)
    assert done.returncode == 0
    assert (tmp_path / "out" / "small.nc").is_file()
    assert epsmesh_here("status", "--store", tmp_path / "out" / "cases.sqlite").exit_code == 0


@pytest.mark.parametrize("command", ["plan", "report", "touch"])
def test_a_name_that_no_file_can_have_is_told_without_a_word_of_writing(epsmesh, command):
    done = epsmesh(command, f"{'a' * 300}.nc")
    assert done.exit_code == 2
    # Since Python 3.14 a file of such a name is one that is not there.
    assert "File name too long" in done.stderr or "no such dataset" in done.stderr
    assert "written" not in done.stderr


@pytest.mark.parametrize("words", [["run", "l\udce9.toml"], ["plan", "small.toml", "--output", "l\udce9", "--json"]])
def test_a_word_that_is_no_utf8_is_refused_before_a_library_meets_it(results, monkeypatch, words):
    """Bytes of another encoding, as names of files may have them."""
    monkeypatch.chdir(results)
    status, said, errors = talk(*words)
    assert status == 2
    assert errors.count("\n") == 1 and r"l\udce9" in errors and "UTF-8" in errors
    assert "--json" not in words or json.loads(said)["errors"][0]["value"].startswith(r"l\udce9")


def test_a_folder_whose_name_is_no_utf8_is_refused_before_anything_is_computed(epsmesh, tmp_path, monkeypatch):
    folder = tmp_path / "l\udce9"
    folder.mkdir()
    (folder / "small.toml").write_text(small_text())
    monkeypatch.chdir(folder)
    done = epsmesh("run", "small.toml")
    assert done.exit_code == 2
    assert "cannot be written" in done.stderr and "UTF-8" in done.stderr


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.ENOSPC])
def test_a_closed_folder_names_the_option_for_another(number):
    """Another folder on a full disk would be of no use."""
    why = f"out/small.nc: cannot be written: {os.strerror(number)}"
    assert ("`--output FOLDER` writes elsewhere" in or_elsewhere(why)) == (number != errno.ENOSPC)


def test_a_case_store_that_cannot_be_written_names_its_own_option(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(words, "why_not_writable", lambda path: f"{path}: {os.strerror(errno.EROFS)}")
    for store, option in ((tmp_path / "a.sqlite", "--store FILE"), (None, "--output FOLDER")):
        with pytest.raises(typer.Exit):
            words.store_to_write(store, tmp_path)
        assert f"`{option}` writes elsewhere" in capsys.readouterr().err
