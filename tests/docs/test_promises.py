"""What the pages promise has a test each: ``docs/promises.toml`` names it."""

import importlib.util
import re
import subprocess

import pytest

from tests.docs.blocks import ROOT

_SPEC = importlib.util.spec_from_file_location("promises", ROOT / "docs" / "promises.py")
promises = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(promises)

PAGE = """\
# A heading

Every force has a bar
([how](x.md)). `tests` never fail. Most hold. A comment is no sentence: <!-- always -->

| row | holds |
|---|---|
| F | always within 1 % of [a table](y.md) |

```sh
all of this is code
```
"""
SENTENCES = ["Every force has a bar (how).", "`tests` never fail.", "F | always within 1 % of a table"]


@pytest.fixture
def root(tmp_path):
    """A project with a page, and a test."""
    (tmp_path / "docs" / "guide").mkdir(parents=True)
    (tmp_path / "README.md").write_text(PAGE)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_it.py").write_text("def test_it():\n    pass\n")
    return tmp_path


def test_every_promise_has_a_test_or_a_reason_for_none():
    wrong = list(promises.faults(promises.read(), promises.promises()))
    assert not wrong, "\n".join(wrong)


def test_sentences_are_those_that_a_reader_sees(root):
    assert promises.promises(root) == {"README.md": SENTENCES}


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        ((["tests/test_it.py::test_it"], "definition", "measured by README.md"), ""),
        ((["tests/test_it.py::test_it"], "definition"), "always within 1 % of a table'\n  has no test"),
        (("definition", "definition", "? definition"), "always within 1 % of a table'\n  has no test"),
        ((["tests/test_it.py::test_that"], "scope", "scope"), "no such test: tests/test_it.py::test_that"),
        ((["tests/test_is.py::test_it"], "scope", "scope"), "no such test: tests/test_is.py::test_it"),
        (([], "scope", "scope"), "no such test"),
        (("true", "scope", "scope"), "'true': give a list of tests, or one of definition"),
        (("measured by x.py", "scope", "scope"), "no such file: x.py"),
    ],
)
def test_what_is_wrong_with_a_row_is_told_with_page_and_sentence(root, answers, told):
    table = {"README.md": dict(zip(SENTENCES, answers, strict=False))}
    wrong = list(promises.faults(table, promises.promises(root), root))
    assert len(wrong) == bool(told)
    assert all(text.startswith("README.md: '") and told in text for text in wrong)


def test_a_sentence_that_is_gone_is_told(root):
    table = {"README.md": dict.fromkeys([*SENTENCES, "All is well."], "scope")}
    (wrong,) = promises.faults(table, promises.promises(root), root)
    assert "All is well." in wrong and "--update" in wrong


def test_an_update_keeps_known_rows_and_marks_new_ones(root):
    """Also of a sentence that moved to another page; one that changed a little has the old answer behind its mark."""
    old = {
        "docs/a.md": {SENTENCES[0]: ["tests/test_it.py::test_it"], "All is well.": "scope"},
        "README.md": {"F | always within 2 % of a table": "literature"},
    }
    found = promises.promises(root)
    made = promises.updated(old, found)
    answers = ["tests/test_it.py::test_it"], "?", "? literature"
    assert made == {"README.md": dict(zip(SENTENCES, answers, strict=True))}
    (root / "promises.toml").write_text(promises.text_of(made))
    assert promises.read(root / "promises.toml") == made
    assert promises.updated(made, found) == made


def test_make_lists_all_targets():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (names,) = re.findall(r"^\.PHONY: (.*)$", text, re.MULTILINE)
    listed = subprocess.run(["make", "help"], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert set(names.split()) == set(re.findall(r"^ +make (\S+)", listed, re.MULTILINE))
