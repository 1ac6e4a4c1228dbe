"""The changes, read from ``changes.toml``: each leaves the program running and makes a number wrong."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

LIST = Path(__file__).with_name("changes.toml")


@dataclass(frozen=True)
class Change:
    """``old`` stands once in ``file``; with ``new`` in its place at least one of the ``tests`` must fail.

    ``tests`` are those that are meant to tell, as pytest takes them, the quickest first; ``ranks`` is 2 where a mistake
    shows on several ranks only.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    ranks: int = 1


def read(path: Path = LIST) -> tuple[Change, ...]:
    """Return the changes of a list."""
    entries = tomllib.loads(path.read_text())["change"]
    return tuple(Change(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries)
