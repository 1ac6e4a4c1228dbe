"""What tests cost: from pytest's own list to the tables of ``benchmarks/results/tests.md``.

    make test PYTEST_ARGS=--durations=0 | tee log
    python -m tests.costs log

prints the tables. Their first one by file is the order in which ``make test`` runs files (:mod:`tests.suites`).
"""

import re
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

_LINE = re.compile(r"^\s*([\d.]+)s (?:call|setup|teardown) +(tests/\S+?\.py)::(.+)$", re.MULTILINE)
# The shortest files and tests (s) of the tables.
_FILE, _TESTS = 2.0, 25


def durations(log: str) -> tuple[Counter[str], Counter[str]]:
    """Return the seconds of every file and of every test in a log of ``--durations=0``."""
    files, tests = Counter[str](), Counter[str]()
    for seconds, file, name in _LINE.findall(log):
        files[file] += float(seconds)
        tests[f"{file}::{name}"] += float(seconds)
    return files, tests


def table(title: str, rows: Iterable[tuple[str, float]]) -> str:
    """Return a table of seconds."""
    return "\n".join(
        [f"| {title} | seconds |", "|---|---|", *(f"| `{name}` | {seconds:.0f} |" for name, seconds in rows)]
    )


def folders(files: Mapping[str, float]) -> Counter[str]:
    """Return the seconds of every folder of tests."""
    found = Counter[str]()
    for file, seconds in files.items():
        found["/".join(file.split("/")[:2]) if file.count("/") > 1 else "tests"] += seconds
    return found


def main(log: Path) -> None:
    """Print the tables of a log."""
    files, tests = durations(log.read_text(encoding="utf-8"))
    print(f"{sum(files.values()):.0f} s of set-up and call, of all workers together.\n")
    print(table("folder", folders(files).most_common()), end="\n\n")
    print(table("file", ((name, seconds) for name, seconds in files.most_common() if seconds >= _FILE)), end="\n\n")
    print(table("test", tests.most_common(_TESTS)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
