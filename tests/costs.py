"""What tests cost, in seconds of the processor, those of their processes too: so other work beside them counts little.

    make test PYTEST_ARGS="-p tests.costs"
    python -m tests.costs

records it in ``results/tests.jsonl`` and prints the tables of ``benchmarks/results/tests.md``. The table of files gives
the order in which ``make test`` runs them (:mod:`tests.suites`).
"""

import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

RECORD = Path(__file__).parents[1] / "results" / "tests.jsonl"
# The cheapest file (s) and the number of tests of the tables.
_FILE, _TESTS = 2.0, 25


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Record what a test costs, with the fixtures that it is the first to ask for."""
    before = _processor()
    yield
    with RECORD.open("a", encoding="utf-8") as file:
        file.write(json.dumps([item.nodeid, round(_processor() - before, 3)]) + "\n")


def _processor() -> float:
    """Return the seconds that this process and those that it has waited for have used."""
    return sum(os.times()[:4])


def table(title: str, rows: Iterable[tuple[str, float]]) -> str:
    """Return a table of seconds."""
    return "\n".join([f"| {title} | seconds |", "|---|---|", *(f"| `{name}` | {time:.0f} |" for name, time in rows)])


def tables(seconds: Counter[str]) -> str:
    """Return the tables of all tests, by folder, by file and by test."""
    files, folders = Counter[str](), Counter[str]()
    for name, time in seconds.items():
        file = Path(name.partition("::")[0])
        files[str(file)] += time
        folders["/".join(file.parent.parts[:2])] += time
    slow = [(name, time) for name, time in files.most_common() if time >= _FILE]
    parts = table("folder", folders.most_common()), table("file", slow), table("test", seconds.most_common(_TESTS))
    return "\n\n".join([f"{sum(seconds.values()):.0f} s in {len(seconds)} tests.", *parts])


if __name__ == "__main__":
    print(tables(Counter(dict(map(json.loads, RECORD.read_text(encoding="utf-8").splitlines())))))
