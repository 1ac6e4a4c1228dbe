"""What people and scripts read: numbers with their nouns, and letters as they are."""

import json
import re

import pytest

from epsmesh.printable import counted, printable_json
from tests.studies import small_text

ONE_CASE = {"material": {"poisson": 0.3}, "mesh": {"epsilon": "full"}}


@pytest.mark.parametrize(
    ("number", "noun", "words"),
    [
        (0, "case", "0 cases"),
        (1, "case", "1 case"),
        (2, "case", "2 cases"),
        (1, "mesh", "1 mesh"),
        (2, "mesh", "2 meshes"),
    ],
)
def test_a_number_has_its_noun(number, noun, words):
    assert counted(number, noun) == words


@pytest.mark.parametrize("command", [("plan",), ("plan", "--quiet"), ("run", "--verbose"), ("status",)])
def test_one_case_is_no_cases(command, tmp_path, epsmesh):
    file = tmp_path / "one.toml"
    file.write_text(small_text(**ONE_CASE))
    word, *options = command
    where = () if word == "plan" else ("--output", tmp_path)
    done = epsmesh(word, file, *options, *where)
    assert done.exit_code == 0, done.output
    assert not re.findall(r"\b1 (?:cases|meshes|steps|solves|values|ranks|scenes)\b", done.output)


def test_a_unit_of_other_letters_is_written_as_it_is(tmp_path, epsmesh):
    file = tmp_path / "small.toml"
    file.write_text(small_text(**ONE_CASE, probe={"depth": "100 µm"}))
    done = epsmesh("plan", file, "--json")
    assert json.loads(done.stdout)
    assert "\\u00b5" not in done.stdout
    file.write_text(small_text(**ONE_CASE, probe={"depth": "100 µN"}))
    refused = epsmesh("plan", file)
    assert '"100 µN"' in refused.output


def test_signs_that_nobody_sees_are_escaped():
    assert printable_json('"µ\u202e"') == '"µ\\u202e"'
