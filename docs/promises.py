"""Sentences of the documentation that promise something, and the tests that hold them: ``docs/promises.toml``.

A sentence with a word of ``WORDS`` has a row: the tests that fail when it is false, or why it needs none. The check
fails for a sentence without a row, a row without its sentence, and a test that does not exist. After a change of the
pages, ``python docs/promises.py --update`` writes the table anew. It keeps the rows of sentences that stayed, and marks
new and changed ones with "?": replace the mark, and what follows it, by an answer.
"""

import ast
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs" / "promises.toml"
PAGES = ("README.md", "CONTRIBUTING.md", "docs/*.md", "docs/guide/*.md", "docs/why/*.md")
# "each", "any", "no" and "only" are left out: most of their sentences describe a rule, few of them guarantee one.
WORDS = ("always", "never", "every", "everywhere", "all", "whole", "at most", "within", "nothing")
# Answers other than tests, for what promises nothing. "measured by" names the file that prints or makes its figures.
REASONS = ("definition", "heading", "instruction", "advice", "scope", "literature", "measured once", "measured by ")
UNANSWERED = "?"
Rows = dict[str, dict[str, str | list[str]]]

_PROMISE = re.compile(rf"\b({'|'.join(WORDS)})\b", re.IGNORECASE)
# Of a sentence; initials of names have a point, too.
_END = re.compile(r"(?<!\b[A-Z]\.)(?<=[.!?])\s+(?=[^a-z0-9.])|(?<=[.!?]\))\s+")
_HEAD = """\
# Sentences with "always", "never", "every", "all", "whole", "at most", "within" or "nothing": the tests that hold each,
# or why it needs none: "definition", "heading", "instruction", "advice", "scope" (what is not computed), "literature",
# "measured once", or "measured by" a file. `python docs/promises.py` checks this table, `python docs/promises.py
# --update` writes it anew: answer the rows that it marks with "?".
"""


def promises(root: Path = ROOT) -> dict[str, list[str]]:
    """Return the sentences with one of ``WORDS``, by page: without code blocks, comments and the targets of links."""
    pages = [page for pattern in PAGES for page in sorted(root.glob(pattern))]
    found = {str(page.relative_to(root)): _of_page(page.read_text(encoding="utf-8")) for page in pages}
    return {page: sentences for page, sentences in found.items() if sentences}


def _of_page(text: str) -> list[str]:
    sentences = [(row, sentence) for row, part in _parts(text) for sentence in _END.split(part)]
    return list(dict.fromkeys(row + sentence for row, sentence in sentences if _PROMISE.search(sentence)))


def _parts(text: str) -> Iterator[tuple[str, str]]:
    """Yield the text of each paragraph, heading, item and cell; before that of a cell, the first one of its row."""
    row, before = "", ""
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        if token.type in ("tr_open", "tr_close"):
            row = ""
        elif token.type == "inline" and before != "th_open":
            yield row, _plain(token)
            row = row or (f"{_plain(token)} | " if before == "td_open" else "")
        before = token.type


def _plain(token: Token) -> str:
    """Return the text as it is read; of code, in quotes that tell it apart."""
    parts = {"softbreak": " ", "hardbreak": " ", "image": "", "html_inline": ""}
    text = "".join(
        parts.get(part.type, f"`{part.content}`" if part.type == "code_inline" else part.content)
        for part in token.children or ()
    )
    return " ".join(text.split())


def faults(table: Rows, found: dict[str, list[str]], root: Path = ROOT) -> Iterator[str]:
    """Yield what is wrong with the table: a line each, with page, sentence and remedy."""
    for page, sentences in found.items():
        for sentence in sentences:
            answer = table.get(page, {}).get(sentence, UNANSWERED)
            if why := _why_not(answer, root):
                yield f"{page}: {sentence!r}\n  {why}"
    for page, rows in table.items():
        for sentence in rows.keys() - set(found.get(page, ())):
            yield f"{page}: {sentence!r}\n  is in the table, not on the page: python docs/promises.py --update"


def _why_not(answer: str | list[str], root: Path) -> str:
    """Return what is wrong with an answer, or nothing."""
    if isinstance(answer, list):
        absent = [name for name in answer if not _exists(name, root)]
        return f"no such test: {', '.join(absent) or 'the list is empty'}" if absent or not answer else ""
    if answer.startswith(UNANSWERED):
        return "has no test: python docs/promises.py --update, then answer its row in docs/promises.toml; or reword it"
    if not answer.startswith(REASONS):
        return f"{answer!r}: give a list of tests, or one of {', '.join(REASONS)}FILE"
    _, measured, file = answer.partition("measured by ")
    return f"no such file: {file}" if measured and not (root / file).is_file() else ""


def _exists(name: str, root: Path) -> bool:
    file, _, test = name.partition("::")
    return bool(test) and test in _tests(root / file)


@cache
def _tests(file: Path) -> frozenset[str]:
    if not file.is_file():
        return frozenset()
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return frozenset(node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def updated(table: Rows, found: dict[str, list[str]]) -> Rows:
    """Return the table of the sentences that are there; a new one has the answer of the one most like it."""
    known = {sentence: answer for rows in table.values() for sentence, answer in rows.items()}
    return {
        page: {sentence: table.get(page, {}).get(sentence) or _guess(sentence, known) for sentence in sentences}
        for page, sentences in found.items()
    }


def _guess(sentence: str, known: dict[str, str | list[str]]) -> str | list[str]:
    if sentence in known:  # it has moved to another page
        return known[sentence]
    like = get_close_matches(sentence, known, n=1, cutoff=0.7)
    answer = known[like[0]] if like else ""
    return f"{UNANSWERED} {answer if isinstance(answer, str) else ', '.join(answer)}".strip()


def text_of(table: Rows) -> str:
    """Return the table as TOML: a section a page, a line a sentence. JSON's strings and lists are TOML's, too."""
    pages = (
        f"\n[{json.dumps(page)}]\n"
        + "".join(f"{_toml(sentence)} = {_toml(answer)}\n" for sentence, answer in rows.items())
        for page, rows in table.items()
    )
    return _HEAD + "".join(pages)


def _toml(value: str | list[str]) -> str:
    return json.dumps(value, ensure_ascii=False)


def read(file: Path = TABLE) -> Rows:
    """Return the table: by page and sentence, a list of tests or a reason."""
    return tomllib.loads(file.read_text(encoding="utf-8")) if file.exists() else {}


def main(arguments: list[str]) -> int:
    """Check the table, after writing it anew with ``--update``; return the status."""
    if arguments not in ([], ["--update"]):
        print("usage: python docs/promises.py [--update]", file=sys.stderr)
        return 2
    if arguments:
        TABLE.write_text(text_of(updated(read(), promises())), encoding="utf-8")
    wrong = list(faults(read(), promises()))
    print("\n".join(wrong) or f"{sum(map(len, read().values()))} sentences, all answered")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
