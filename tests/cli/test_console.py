"""How the command line speaks: to people, to files, to scripts, and to nobody."""

import json
import os
import pty
import re
import subprocess
import sys
from math import inf, nan
from pathlib import Path

import pytest
from typer.testing import CliRunner

from epsmesh import __version__
from epsmesh.cli import app
from epsmesh.cli.console import paint, print_json
from epsmesh.report.figures import KINDS
from epsmesh.report.read import read_file
from tests.commands import ENVIRONMENT, ROOT, names, talk
from tests.conftest import SMALL
from tests.studies import small_text


def strict(text: str):
    """Read JSON as other languages do, who know no NaN."""
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


COMMANDS = names()


def on_terminal(*arguments: str, **environment: str) -> str:
    """Return what a command writes to a terminal."""
    leader, follower = pty.openpty()
    settings = {**ENVIRONMENT, "TERM": "xterm", "PYTHONPATH": str(ROOT), **environment}
    process = subprocess.Popen(
        [sys.executable, "-m", "epsmesh", *arguments], stdout=follower, stderr=follower, cwd=ROOT, env=settings
    )
    os.close(follower)
    text = b""
    while True:
        try:
            read = os.read(leader, 4096)
        except OSError:  # the other end is closed
            break
        text += read
    os.close(leader)
    process.wait(timeout=60)
    return text.decode()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(epsmesh, command):
    shown = epsmesh(command, "--help")
    assert shown.exit_code == 0
    assert "Example: " in shown.stdout
    assert f"epsmesh {command}" in shown.stdout


def test_version_and_short_help(epsmesh):
    assert epsmesh("--version").stdout == f"epsmesh {__version__}\n"
    assert {"dolfinx", "petsc", "gmsh"} <= {line.split()[0] for line in epsmesh("--version", "-v").stdout.splitlines()}
    assert json.loads(epsmesh("--version", "--json").stdout)["epsmesh"] == __version__
    assert epsmesh("--verbose", "plan", "x").exit_code == 2
    assert epsmesh("plan", "-h").stdout == epsmesh("plan", "--help").stdout


def test_help_of_report_names_every_figure(epsmesh):
    shown = set(re.findall(r"\w+", epsmesh("report", "--help").stdout))
    assert set(KINDS) - {"nothing"} <= shown


def test_misspelt_commands_options_and_reductions_get_the_nearest(epsmesh, small, tmp_path):
    assert "'plan'" in epsmesh("pln").stderr
    assert "--json" in epsmesh("plan", "x.toml", "--jsn").stderr
    for command in ("plan", "run", "status"):
        absent = epsmesh(command, tmp_path / "smal.toml")
        assert (absent.exit_code, f"did you mean {small}?" in absent.stderr) == (2, True)
    refused = epsmesh("plan", small, "--without", "symetry")
    assert (refused.exit_code, "did you mean `symmetry`?" in refused.stderr) == (2, True)


def test_colour_on_terminals_only_and_not_where_it_is_unwanted(epsmesh, tmp_path, monkeypatch):
    file = tmp_path / "bad.toml"
    file.write_text("[body]\n")
    assert "\033[31m" in on_terminal("plan", str(file))
    assert "\033[" not in epsmesh("plan", file).stderr
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert "\033[31m" in paint("x", "red", sys.stderr)
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as patched:
            patched.setenv(name, value)
            assert paint("x", "red", sys.stderr) == "x"


def test_a_terminal_has_lines_broken_between_words(small):
    text = on_terminal("plan", str(small), COLUMNS="50")
    command = [sys.executable, "-m", "epsmesh", "plan", str(small)]
    whole = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=ENVIRONMENT).stdout
    assert max(map(len, whole.splitlines())) > 80
    assert max(map(len, text.splitlines())) <= 50
    words = re.compile(r"[a-z-]{4,}")  # numbers are those of the moment
    assert words.findall(text) == words.findall(whole)


def test_json_of_a_run_is_one_object_with_what_failed_and_why(epsmesh, tmp_path):
    file = tmp_path / "small.toml"
    small = SMALL.replace('["coarse", "free"]', '"coarse"').replace('"0.5 mm"', '["1e-9 mm", "0.5 mm"]')
    small = small.replace('"4 mm", ', "")
    file.write_text(f"{small.replace('[0.3, 0.4]', '0.3')}[solve]\nexact = false\n")
    done = epsmesh("run", file, "--output", tmp_path, "--meshes", tmp_path / "meshes", "--json")
    found = json.loads(done.stdout)
    assert found["status"] == done.exit_code == 1
    (study,) = found["studies"]
    assert (study["cases"], study["ok"], study["failed"], study["pending"]) == (4, 2, 2, 0)
    assert {"GB of memory" in failure["message"] for failure in study["failures"]} == {True}
    assert all(Path(name).exists() for name in study["files"])
    assert study["seconds"] > 0
    states = read_file(tmp_path / "small.nc")["status"]
    assert (states.sel(rim=1e-12) == "failed").all() and (states.sel(rim=0.5e-3) == "ok").all()
    status = json.loads(epsmesh("status", file, "--output", tmp_path, "--json").stdout)
    assert (status["ok"], status["failed"], status["pending"]) == (2, 2, 0)
    told = read_file(tmp_path / "small.nc")["message"].values.tolist()
    again = epsmesh("run", file, "--output", tmp_path, "--meshes", tmp_path / "meshes")
    line = again.stdout.splitlines()[-1]
    assert "2 ok, 2 failed (" in line
    # Failed cases are tried again; their message has the memory that is free, which may have changed.
    is_same = read_file(tmp_path / "small.nc")["message"].values.tolist() == told
    assert f"(2 from the store); {'unchanged' if is_same else 'wrote'}" in line
    assert "GB of memory" in line


@pytest.mark.parametrize(
    ("value", "written"),
    [
        ({"epsilon": inf, "seconds": inf}, {"epsilon": "full", "seconds": None}),
        ({"epsilon": [4e-3, inf]}, {"epsilon": [4e-3, "full"]}),
        (
            [{"mesh": {"epsilon": inf, "fine": 1e-3}}, nan, -inf],
            [{"mesh": {"epsilon": "full", "fine": 1e-3}}, None, None],
        ),
    ],
)
def test_json_has_no_numbers_that_are_none(value, written, capsys):
    print_json(value)
    assert strict(capsys.readouterr().out) == written


def test_quiet_and_verbose_plans(epsmesh):
    shown = [epsmesh("plan", ROOT / "studies" / "figure3.toml", *more).stdout for more in (["-q"], [], ["-v"])]
    quiet, usual, verbose = (len(text.splitlines()) for text in shown)
    assert quiet == 1
    assert usual < verbose
    assert "smaller steps" in shown[1]
    assert "smaller steps" not in shown[2]


def test_shell_completes_commands_and_names_and_leaves_files_to_the_shell():
    def completed(*words: str) -> list[str]:
        environment = {"_EPSMESH_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(("epsmesh", *words)),
                       "COMP_CWORD": str(len(words))}  # fmt: skip
        return CliRunner().invoke(app, prog_name="epsmesh", env=environment).stdout.split()

    assert completed("com") == ["compare"]
    assert "symmetry" in completed("plan", "--without", "sy")
    assert "figure3" in completed("new", "mine", "--like", "fig")
    assert completed("run", "stud") == []


def test_fish_gets_a_tab_between_a_command_and_its_help(monkeypatch):
    asked = {
        "_EPSMESH_COMPLETE": "complete_fish",
        "_TYPER_COMPLETE_ARGS": "epsmesh pla",
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    assert talk()[1].startswith("plan\tCheck studies")


def test_what_is_no_store_is_left_alone(epsmesh, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    letter = tmp_path / "letter.txt"
    letter.write_text("Dear reader")
    for command in (["status"], ["status", "--prune"], ["status", "studies/quick.toml"]):
        refused = epsmesh(*command, "--store", letter)
        assert refused.exit_code == 2
        assert "is not a case store" in refused.stderr
    assert letter.read_text() == "Dear reader"
    assert epsmesh("report", letter.rename(tmp_path / "letter.nc"), "--figures").exit_code == 2


def test_several_ranks_have_one_voice_for_words_that_make_no_command(spawn):
    done = spawn("run", "studies/quick.toml", "--nonsense", ranks=2)
    assert done.returncode != 0
    assert done.stderr.count("No such option: --nonsense") == 1


def test_one_of_a_thing_is_called_so_and_letters_that_are_seen_are_written_as_they_are(epsmesh, tmp_path):
    """No "1 cases", and no escape for a µ, in what people or scripts get."""
    file = tmp_path / "µm.toml"
    one = {"mesh": {"epsilon": "4000 µm"}, "solve": {"exact": False}}
    file.write_text(small_text(title="Breadth in µm", **one))
    plans = ("plan", "-q", file), ("plan", file), ("plan", file, "--json")
    for words in (*plans, ("run", "--verbose", file), ("status", file)):
        done = epsmesh(*words, "--output", tmp_path / "out")
        told = done.stdout + done.stderr
        assert done.exit_code == 0, told
        assert "µm" in told
        assert not re.search(r"\\u00|(?<![\d.])1 (cases|solves|meshes|systems|steps|ranks|places)\b", told), told
