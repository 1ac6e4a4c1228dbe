"""`--json` on every command, whatever comes of it: standard output is JSON alone, and failures are objects."""

import json
import shutil

import pytest

from epsmesh.report.dataset import write
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from tests.commands import ROOT, names
from tests.report.chosen import TEXT, dataset

SCALPEL = TEXT[TEXT.rindex("[[probe]]") : TEXT.index("[mesh]")]
NAMES = names()


def failed(done, status=2):
    """Return the errors of a command that failed, each with all its fields."""
    assert done.exit_code == status, done.output
    told = json.loads(done.stdout)
    assert told["status"] == status
    for error in told["errors"]:
        assert set(error) == {"message", "file", "key", "value", "allowed", "howto"}
    return told["errors"]


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """The file of a dataset of one scene, with F_exact."""
    file = tmp_path_factory.mktemp("known") / "known.nc"
    write(dataset(TEXT.replace("[0.3, 0.4]", "0.3").replace(SCALPEL, "")), file)
    return file


@pytest.fixture
def here(known, tmp_path, monkeypatch):
    """A folder with a small dataset, in which commands are called."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(known, tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_every_command_takes_json_and_words_that_make_no_command_are_told_in_it(epsmesh, name):
    assert "--json" in epsmesh(name, "--help").stdout
    (error,) = failed(epsmesh(name, "--json", "--jsn"))
    assert "--jsn" in error["message"]


def test_unknown_commands_and_missing_words_are_told(epsmesh):
    (error,) = failed(epsmesh("pln", "--json"))
    assert "pln" in error["message"]
    (error,) = failed(epsmesh("plan", "--json"))
    assert error["key"] == "FILE"
    (error,) = failed(epsmesh("export", "a.toml", "--checks", "many", "--json"))
    assert (error["key"], error["value"], bool(error["allowed"])) == ("--checks", "many", True)
    (error,) = failed(epsmesh("plan", "a.toml", "--memory=-1", "--json"))
    assert (error["key"], error["value"], "0.1" in error["allowed"]) == ("--memory", "-1", True)


@pytest.mark.parametrize("command", ["plan", "run", "status", "view", "export"])
def test_a_bad_study_is_told_problem_by_problem(epsmesh, small, command):
    small.write_text(small.read_text().replace('"2 mm"', "2").replace("0.4", "0.9"))
    done = epsmesh(command, small, "--json")
    errors = {error["key"]: error for error in failed(done)}
    assert errors["material.poisson"]["value"] == 0.9
    assert errors["material.poisson"]["allowed"] == "must be at most 0.5"
    assert errors["probe.radius"]["howto"] == "docs/guide/study.md"
    assert {error["file"] for error in errors.values()} == {str(small)}
    assert "material.poisson = 0.9: must be at most 0.5" in done.stderr
    assert done.stderr.splitlines()[-1] == "see docs/guide/study.md"


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("guide known.nc --accuracy 5 --json", "--accuracy"),
        ("report known.nc --figures --kind pie --json", "--kind"),
        ("report absent.nc --json", None),
        ("new ../x --json", "NAME"),
        ("new x --like nothing --json", "--like"),
        ("plan SMALL colour=3 --json", "CASE"),
        ("plan SMALL --without magic --json", "--without"),
        ("run SMALL --shard 9/3 --json", "--shard"),
        ("run SMALL --output known.nc --json", None),
        ("status --store absent --json", None),
        ("status --prune --store known.nc --json", "--store"),
        ("export --json", "FILE"),
        ("touch known.nc --json", None),
        ("export SMALL --accuracy 90% --json", "--accuracy"),
    ],
)
def test_what_else_is_wrong_is_told(epsmesh, small, here, words, key):
    done = epsmesh(*(small if word == "SMALL" else word for word in words.split()))
    errors = failed(done)
    assert [error["key"] for error in errors] == [key]
    assert all(error["message"] in done.stderr for error in errors)
    assert key is not None or all(error["file"] for error in errors)


def test_warnings_of_a_study_are_told(epsmesh, small, tmp_path):
    small.write_text(small.read_text().replace('"0.1 mm"', '"0.5 mm"'))
    (told,) = json.loads(epsmesh("plan", small, "--json").stdout)["warnings"]
    assert "probe.depth" in told
    assert "warnings" not in json.loads(epsmesh("status", small, "--json").stdout)
    run = epsmesh("run", small, "--shard", "200/200", "--output", tmp_path, "--json")
    assert json.loads(run.stdout)["studies"][0]["warnings"] == [told]


def test_an_exception_is_told_and_goes_on(epsmesh, small, monkeypatch):
    monkeypatch.setattr("epsmesh.run.reading.make_plan", lambda *_, **__: 1 / 0)
    done = epsmesh("plan", small, "--json")
    assert failed(done, status=1)[0]["message"] == "ZeroDivisionError: division by zero"
    assert isinstance(done.exception, ZeroDivisionError)


def test_what_is_written_is_told(epsmesh, small, here):
    assert json.loads(epsmesh("new", "mine", "--json").stdout) == {"file": "studies/mine.toml"}
    assert json.loads(epsmesh("report", "known.nc", "--figures", "--kind", "error", "--json").stdout)["files"] != []
    page = json.loads(epsmesh("report", "known.nc", "--json").stdout)["page"]
    assert (here / page).is_file()
    seen = json.loads(epsmesh("view", small, "--mesh-only", "--export", "html", "--output", here, "--json").stdout)
    assert seen["cells"] > 100
    assert all((here / file).is_file() for file in seen["files"])


def test_pruning_says_first_what_would_go(epsmesh, tmp_path):
    path = tmp_path / "cases.sqlite"
    opened = Store(path)
    for number in range(5):
        opened.put(Record(f"k{number}", "failed" if number < 2 else "ok", force=1.0))
    opened.close()
    before = path.read_bytes()
    words = ("status", "--prune", "--store", path, "--failed", "--json")
    told = json.loads(epsmesh(*words).stdout)
    assert (told["remove"], told["records"], told["reasons"], told["done"]) == (2, 5, {"failed": 2}, False)
    assert 500 < told["bytes"] < 10_000
    assert path.read_bytes() == before
    assert json.loads(epsmesh(*words, "--yes").stdout)["done"]
    assert json.loads(epsmesh("status", "--store", path, "--json").stdout)["sound"]
    assert json.loads(epsmesh("status", "--store", path, "--json").stdout)["records"] == 3
    assert "no record to remove, 3 stay" in epsmesh(*words[:-1]).stdout


def test_the_how_to_of_a_refusal_is_a_page(epsmesh, small, here):
    pages = set()
    for words in ("guide known.nc --accuracy x", "plan SMALL --without x", "run SMALL --shard 9/3", "touch known.nc"):
        done = epsmesh(*(small if word == "SMALL" else word for word in words.split()), "--json")
        (error,) = failed(done)
        assert f"see {error['howto']}" in done.stderr
        pages.add(error["howto"])
    assert all((ROOT / page).is_file() for page in pages)
