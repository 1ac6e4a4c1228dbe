"""The paper has the sections that its journal asks for; its numbers, figures and references exist."""

import re
from pathlib import Path

import pytest

from tests.docs.numbers import NUMBER, SOURCES, prose

ROOT = Path(__file__).parents[1]
PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^# (.+?)\n(.*?)(?=^# |\Z)", PAPER, re.MULTILINE | re.DOTALL))
# Of the Journal of Open Source Software.
ASKED = ("Summary", "Statement of need", "State of the field", "Software design", "Research impact statement")
ASKED += ("AI usage disclosure", "Acknowledgements", "References")


def test_sections_and_length_are_those_that_the_journal_asks_for():
    assert [name for name in SECTIONS if name in ASKED] == [*ASKED]
    assert 750 <= len(prose("".join(SECTIONS.values())).split()) <= 1750


@pytest.mark.parametrize("name", SECTIONS)
def test_numbers_are_those_of_the_documentation(name):
    found = SOURCES.findall(SECTIONS[name])
    assert len(found) == SECTIONS[name].count("<!--")
    for page, words in found:
        assert words in " ".join((ROOT / page).read_text(encoding="utf-8").split()), f"{page} does not say: {words}"
    known = {number for _, words in found for number in NUMBER.findall(words)}
    assert set(NUMBER.findall(prose(SECTIONS[name]))) <= known


def test_figures_exist_and_tell_what_draws_them():
    figures = re.findall(r"^!\[(.*?)\]\((\S+)\)", PAPER, re.MULTILINE | re.DOTALL)
    assert len(figures) == PAPER.count("![") > 1
    for caption, path in figures:
        assert (ROOT / "paper" / path).is_file(), path
        command = re.search(r"Drawn by `(?:make (\w+)|python (\S+) (\w+))`", caption)
        assert command, caption
        target, script, figure = command.groups()
        if target:
            assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
        else:
            assert f'"{figure}": (' in (ROOT / script).read_text(encoding="utf-8")


def test_references_are_cited_and_can_be_found():
    entries = dict(re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", BIBLIOGRAPHY, re.MULTILINE | re.DOTALL))
    assert len(entries) == BIBLIOGRAPHY.count("\n@") + 1
    assert set(re.findall(r"@(\w+)", "".join(SECTIONS.values()))) == entries.keys()
    for name, entry in entries.items():
        keys = set(re.findall(r"^  (\w+) +=", entry, re.MULTILINE))
        assert keys & {"doi", "url"} or "note" in keys, f"{name} has neither DOI nor address, nor a note that says why"
