"""Are wrong numbers noticed? Each of a list of changes, and whether the tests that should fail do.

    python -m benchmarks.mutants [--only WORD]... [--check] [--trust] [--continue]

Copies the checkout into a scratch folder, sees that the tests pass there as it is, then makes the changes of
``changes.toml`` one by one and runs the tests that each names, up to the first that fails. Ends with 1 if a change
survives, with 2 if the list does not fit the code. ``--check`` looks at the list alone; ``--trust`` takes it for
granted that the tests pass without a change; ``--only`` chooses changes by a word of their name or file. What is found
is kept in ``results/mutants.jsonl``: ``--continue`` takes from there what was found of the same code and tests.
"""

import argparse
import sys
import time
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.mutants.changes import LIST, Change, read
from benchmarks.mutants.journal import Journal, of_change, of_tests
from benchmarks.mutants.tree import ROOT, Told, Tree, stale
from pipeline.files import cache_folder

_WORDS = {"failed": "killed", "hung": "killed: it hangs", "passed": "SURVIVES", "broken": "TESTS DO NOT RUN"}


def main(arguments: list[str]) -> int:
    """Run; return the exit status."""
    options = _options(arguments)
    changes = read()
    if problems := stale(changes):
        print(f"{LIST} does not fit the code any more:", *problems, sep="\n  ", file=sys.stderr)
        return 2
    chosen = tuple(c for c in changes if not options.only or any(w in f"{c.file} {c.name}" for w in options.only))
    print(f"{len(chosen)} changes, each with tests that are there", flush=True)
    if options.check or not chosen:
        return 0 if chosen else 2
    start = time.monotonic()
    with TemporaryDirectory(prefix="epsmesh-mutants-") as folder:
        tree, journal = Tree(Path(folder), cache_folder()), Journal(goes_on=options.goes_on)
        if not options.trust and not _passes_unchanged(tree, chosen, journal):
            return 2
        lines = [(change, _tried(tree, change, journal)) for change in chosen]
    left = [change for change, told in lines if told.verdict in ("passed", "broken")]
    table = _table(lines, sum(told.seconds for _, told in lines))
    if not options.only:
        (ROOT / "results").mkdir(exist_ok=True)
        (ROOT / "results" / "mutants.md").write_text(table)
    print(f"{time.monotonic() - start:.0f} s")
    print(f"{len(lines) - len(left)} of {len(lines)} killed", *(f"  left: {c.file}: {c.name}" for c in left), sep="\n")
    return int(bool(left))


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--only", action="append", metavar="WORD", help="only changes with this in name or file")
    parser.add_argument("--check", action="store_true", help="only see that the list fits the code")
    parser.add_argument("--trust", action="store_true", help="do not run the tests without a change first")
    parser.add_argument("--continue", dest="goes_on", action="store_true", help="go on where an earlier run was ended")
    return parser.parse_args(arguments)


def _passes_unchanged(tree: Tree, chosen: tuple[Change, ...], journal: Journal) -> bool:
    for ranks, changes in groupby(sorted(chosen, key=lambda c: c.ranks), key=lambda c: c.ranks):
        tests = tuple(dict.fromkeys(test for change in changes for test in change.tests))
        told = journal.get(of_tests(tests, ranks))
        if told is None:
            told = tree.run(tests, ranks, longest=3600)
            journal.put(of_tests(tests, ranks), told)
        print(f"unchanged, {ranks} rank(s): {told.verdict} in {told.seconds:.0f} s {told.first}", flush=True)
        if told.verdict != "passed":
            return False
    return True


def _tried(tree: Tree, change: Change, journal: Journal) -> Told:
    told = journal.get(of_change(change))
    if told is None:
        with tree.changed(change):
            told = tree.run(change.tests, change.ranks)
        journal.put(of_change(change), told)
    print(f"{_WORDS[told.verdict]:8} {told.seconds:5.0f} s  {change.file}: {change.name}  {told.first}", flush=True)
    return told


def _table(lines: list[tuple[Change, Told]], seconds: float) -> str:
    rows = [f"| {c.file} | {c.name} | {_WORDS[t.verdict]} | {t.first.removeprefix('FAILED ')} |" for c, t in lines]
    head = ["| file | change | | by |", "|---|---|---|---|"]
    killed = sum(t.verdict in ("failed", "hung") for _, t in lines)
    return "\n".join([f"{killed} of {len(lines)} changes killed, {seconds:.0f} s", "", *head, *rows, ""])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
