"""Numbers that pages quote from the tables of campaigns are those of the tables."""

import re

import pytest

from tests.docs.blocks import ROOT, pages
from tests.docs.numbers import RESULTS, passages

TABLES = sorted((ROOT / RESULTS).glob("*.md"))
PAGE = """\
A bar held in 472 of 472 scenes ([table](../../benchmarks/results/table.md)).

<!-- numbers: benchmarks/results/table.md: | discs | 472 of 472 | -->

Nothing is quoted in 3 words.
"""


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_numbers_from_a_table_are_those_of_the_table(page):
    text = page.read_text(encoding="utf-8")
    wrong = [fault for passage in passages(text) for fault in passage.faults()]
    assert not wrong, "\n".join(wrong)
    assert text.count("<!-- numbers:") == sum(len(passage.sources) for passage in passages(text))


@pytest.mark.parametrize(
    ("page", "table", "fault"),
    [
        (PAGE, "| discs | 472 of 472 |", ""),
        (PAGE, "| discs | 471 of 472 |", "does not say: | discs | 472 of 472 |"),
        (PAGE.replace("in 472 of", "in 473 of"), "| discs | 472 of 472 |", "has 473 of: A bar"),
        (re.sub("<!--.*-->", "", PAGE), "| discs | 472 of 472 |", "has 472 of: A bar"),
    ],
)
def test_a_number_that_the_table_does_not_have_is_found(page, table, fault, tmp_path):
    (tmp_path / RESULTS).mkdir(parents=True)
    (tmp_path / RESULTS / "table.md").write_text(table)
    wrong = [line for passage in passages(page) for line in passage.faults(tmp_path)]
    assert len(wrong) == bool(fault)
    assert all(fault in line for line in wrong)


@pytest.mark.parametrize("table", TABLES, ids=lambda path: path.stem)
def test_a_table_says_what_made_it_where_and_when(table):
    text = table.read_text(encoding="utf-8")
    assert "\nMachine: " in text
    for part in text.split("\n## ")[1:]:
        assert re.search(r"^(Made by|From) .*commit [0-9a-f]{8}, 20\d\d-\d\d-\d\d\.$", part, re.MULTILINE), part[:80]


def test_each_table_is_linked_once_or_more():
    linked = "".join(page.read_text(encoding="utf-8") for page in (*pages(), ROOT / "docs" / "decisions.md"))
    assert [table.name for table in TABLES if f"results/{table.name}" not in linked] == []
