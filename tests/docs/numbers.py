"""Numbers of a page that come from another file: below their paragraph or table, a comment quotes the words there.

``<!-- numbers: FILE: WORDS -->``: FILE has these words, and the numbers above are among those of such words.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
RESULTS = "benchmarks/results/"  # tables that campaigns wrote, with machine, commit and date
SOURCES = re.compile(r"<!-- numbers: (\S+): (.+?) -->")
NUMBER = re.compile(r"(?<![\w.])\d*(?:[.,]?\d+)+")


def prose(text: str) -> str:
    """Return what is read of a text: without comments, code, citations, and paths of figures and links."""
    return re.sub(r"<!--.*?-->|`[^`]*`|\[@[^\]]*\]|@\w+|\]\([^)]*\)", "", text, flags=re.DOTALL)


@dataclass(frozen=True)
class Passage:
    """A paragraph or table, and the files and words that its numbers are from."""

    text: str
    sources: tuple[tuple[str, str], ...]

    def faults(self, root: Path = ROOT) -> Iterator[str]:
        """Yield what is wrong, a line each."""
        for file, words in self.sources:
            if words not in " ".join((root / file).read_text(encoding="utf-8").split()):
                yield f"{file} does not say: {words}"
        known = {number for _, words in self.sources for number in NUMBER.findall(words)}
        numbers = set(NUMBER.findall(prose(self.text)))
        if (self.sources or f"{RESULTS}" in self.text) and (unknown := numbers - known):
            yield f"no `<!-- numbers: FILE: WORDS -->` has {', '.join(sorted(unknown))} of: {self.text[:80]}"


def passages(page: str) -> Iterator[Passage]:
    """Yield the paragraphs and tables of a page, without blocks of code."""
    text, sources = "", []
    for part in re.split(r"\n\s*\n", re.sub(r"^```.*?^```", "", page, flags=re.MULTILINE | re.DOTALL)):
        if found := SOURCES.findall(part):
            sources += found
        elif part.strip():
            yield Passage(text, tuple(sources))
            text, sources = part.strip(), []
    yield Passage(text, tuple(sources))
