"""What was found so far, kept from run to run: a list that takes an hour may be gone through in parts."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from benchmarks.mutants.changes import Change
from benchmarks.mutants.tree import ROOT, Told, copied

PATH = ROOT / "results" / "mutants.jsonl"


class Journal:
    """Verdicts by change and code, a line each; those of other code are left alone, and not used."""

    def __init__(self, path: Path = PATH, *, goes_on: bool, root: Path = ROOT):
        """Take what is there if the run ``goes_on``; what is found is added in any case."""
        self._path, self._code = path, _code(root)
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = path.read_text().splitlines() if goes_on and path.exists() else []
        entries = [json.loads(line) for line in lines if line.endswith("}")]  # one may be cut short
        self._known = {entry["what"]: Told(**entry["told"]) for entry in entries if entry["code"] == self._code}

    def get(self, what: str) -> Told | None:
        """Return what was found of this code."""
        return self._known.get(what)

    def put(self, what: str, told: Told) -> None:
        """Keep what was found."""
        self._known[what] = told
        with self._path.open("a") as file:
            file.write(json.dumps({"what": what, "code": self._code, "told": asdict(told)}) + "\n")


def of_change(change: Change) -> str:
    """Return what a change is kept under: another text or other tests are another change."""
    return hashlib.sha256(repr(change).encode()).hexdigest()


def of_tests(tests: tuple[str, ...], ranks: int) -> str:
    """Return what a run without a change is kept under."""
    return f"unchanged, {ranks}: {hashlib.sha256(repr(sorted(tests)).encode()).hexdigest()}"


def _code(root: Path) -> str:
    """Return a digest of all that is copied: code and tests."""
    told = hashlib.sha256()
    for path in copied(root):
        told.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return told.hexdigest()
