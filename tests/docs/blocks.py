"""Code blocks of the documentation, with the comments that say how the tests run them.

``<!-- test: replace A with B -->``, ``<!-- test: status 2 -->`` and ``<!-- test: not run: why -->`` stand directly
above the block; all other blocks run as they are. A TOML block is a whole study, or has
``<!-- test: part of a study: NAME -->``, the study that ``epsmesh new NAME`` writes and into which it is put.
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHELLS, PYTHON = ("sh", "bash", "console"), "python"
_FENCE = re.compile(r"((?:^<!--(?:(?!-->).)*-->\n)*)^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!-- test: (.*?) -->", re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block: ``text`` is what runs, ``expected`` what a console block shows of the output."""

    page: Path
    line: int
    language: str
    text: str
    expected: tuple[str, ...] = ()
    status: int = 0
    why_not: str = ""
    part_of: str = ""

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def pages() -> list[Path]:
    """Return the pages that people write: the others are made from the code."""
    made = ("_build", "reference")
    return [page for page in PAGES if not set(made) & set(page.relative_to(ROOT).parts)]


def blocks(page: Path, languages: tuple[str, ...] = (*SHELLS, PYTHON)) -> list[Block]:
    """Return the blocks of a page, in order: commands and Python, unless other ``languages`` are given."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _FENCE.finditer(text):
        comments, language, code = match.groups()
        if language in languages:
            line = text[: match.start(2)].count("\n") + 1
            found.append(_block(page, line, language, code, _MARK.findall(comments)))
    return found


def _block(page: Path, line: int, language: str, code: str, marks: list[str]) -> Block:
    status, why_not, part_of = 0, "", ""
    for mark in marks:
        if mark.startswith("not run: "):
            why_not = mark.removeprefix("not run: ")
        elif mark.startswith("status "):
            status = int(mark.removeprefix("status "))
        elif mark.startswith("part of a study: "):
            part_of = mark.removeprefix("part of a study: ")
        else:
            old, new = re.fullmatch(r"replace (.+?) with (.+)", mark).groups()  # type: ignore[union-attr]
            assert old in code, f"{page}:{line}: the block below does not hold {old!r}"
            code = code.replace(old, new)
    expected: tuple[str, ...] = ()
    if language == "console":
        lines = code.splitlines()
        code = "\n".join(text.removeprefix("$ ") for text in lines if text.startswith("$ "))
        expected = tuple(text for text in lines if not text.startswith("$ "))
    return Block(page, line, language, code, expected, status, why_not, part_of)


def missing(expected: tuple[str, ...], output: str) -> str:
    """Return the first line of ``expected`` that ``output`` does not hold, in order; … stands for anything."""
    lines = iter(output.splitlines())
    for text in expected:
        pattern = ".*".join(re.escape(part) for part in text.rstrip().split("…"))
        if text.strip() != "…" and not any(re.fullmatch(pattern, line.rstrip()) for line in lines):
            return text
    return ""
