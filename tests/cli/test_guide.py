"""`epsmesh guide` as a person and as a script use it."""

import json

import pytest

from epsmesh.report.dataset import write
from tests.commands import epsmesh
from tests.report.chosen import TEXT, dataset


def call(*arguments: object):
    return epsmesh("guide", *arguments)


@pytest.fixture
def results(tmp_path):
    write(dataset(), tmp_path / "known.nc")
    return tmp_path


def test_answer_from_a_dataset_and_from_its_study(results):
    done = call(results / "known.nc", "--accuracy", "5%")
    assert done.exit_code == 0
    assert "ε = 4 mm, outside coarse is the smallest ε that suffices: F is within 2.5 % of F_exact" in done.stdout
    assert call("anywhere/known.toml", "--accuracy", "5%", "--output", results).stdout == done.stdout
    assert call(results / "known.nc").stdout == done.stdout  # as the report answers


def test_json_is_for_scripts(results):
    content = json.loads(call(results / "known.nc", "--accuracy", "5%", "--budget", "100ms", "--json").stdout)
    assert content["answer"]["epsilon"] == 4e-3
    assert content["accuracy"] == pytest.approx(0.05)
    assert content["answer"]["error"] + 0.0249 == pytest.approx(content["accuracy"], abs=1e-4)
    assert len(content["settings"]) == 7
    assert [setting["epsilon"] for setting in content["settings"]].count("full") == 1


def test_what_no_setting_reaches_ends_with_1(results):
    done = call(results / "known.nc", "--accuracy", "0.4%")
    assert done.exit_code == 1
    assert "No mesh setting keeps F within 0.4 % of F_exact in all 4 scenes" in done.stdout


def test_corrections_are_for_those_who_ask(results):
    short, long = (call(results / "known.nc", "--accuracy", "5%", *more).stdout for more in ((), ("-v",)))
    assert "Correction" not in short
    assert "--verbose" in short
    assert "Correction F_exact ≈ F / r" in long
    assert "ε with F / r" in long


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("known.nc", "--budget", "10"), "--budget = '10': must be a time, such as \"10 ms\"; the unit is missing"),
        (("old.nc", "--accuracy", "5%"), "old.nc: the dataset holds no F_exact"),
    ],
)
def test_bad_input_ends_with_2(results, arguments, message):
    write(dataset(TEXT.replace(', "full"', ""), exact=lambda case: False), results / "old.nc")
    done = call(results / arguments[0], *arguments[1:])
    assert done.exit_code == 2
    assert message in done.stderr
    assert not done.stdout


@pytest.mark.parametrize("command", ["guide", "compare"])
def test_commands_that_answer_for_a_study_that_has_changed_since_say_so(results, command):
    """From one place, and alike; nothing is said where the study is as it was run, or the dataset was named."""
    study, options = results / "known.toml", ["--output", results]
    options += {"guide": ["--accuracy", "5%"], "compare": [results / "known.nc"]}[command]
    study.write_text(TEXT)
    assert "has changed since" not in epsmesh(command, study, *options).stderr
    study.write_text(f"{TEXT}\n# later")
    assert f"{study} has changed since" in epsmesh(command, study, *options).stderr
    assert "has changed since" not in epsmesh(command, results / "known.nc", *options).stderr
