"""The rows of the table with the kinds of their scenes: ``python -m tests.verification --table``.

What `epsmesh report --credibility` names as verification near a scene is this table.
"""

import csv
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from subprocess import run
from typing import Any
from unittest.mock import patch

from mpi4py import MPI

from epsmesh import verify
from epsmesh.plan.work import Plan
from epsmesh.report.credibility.near import WORDS, Kind
from epsmesh.run.provenance import provenance
from epsmesh.study.sweep import Study
from epsmesh.verify import Row
from tests.verification.table import groups

Rows = Iterable[Row]
_FOLDER = Path(__file__).parents[2]
TABLE = _FOLDER / "pipeline" / "epsmesh" / "report" / "credibility" / "verification.csv"
COLUMNS = ("scene", "path", *WORDS, "further", "reference", "value", "bar", "source")
# Rows that solve no scene of a study, by a part of their names, or by their path.
_SHAFT = Kind("neo-hookean", further=("insertion",))
_OTHERS = {
    "strip on a rigid base, wedge": Kind("linear", "unilateral", "box", "wedge"),
    "steel roller on aluminium": Kind("linear", "unilateral", "box", "wedge", ("terms",)),
    "crack in a strip": Kind("linear", "bonded", "box", "blade", ("slit",)),
    "ball with a capsule in a ball": Kind(),
    "plane strain": _SHAFT,
    "round slice": _SHAFT,
}


def with_kinds(rows: Callable[[], Rows]) -> Iterator[tuple[Row, Kind]]:
    """Yield each row with the kind of the scene that was solved last for it, of an insertion that of the whole."""
    with _planned() as studies:
        for row in rows():
            kind = next((one for words, one in _OTHERS.items() if words in f"{row.scene}; {row.path}"), None)
            if kind is None and studies and row.path.startswith(("2D", "3D")):
                study = next((one for one in studies if one.is_insertion), studies[-1])
                kind = Kind.of(study, next(study.cases()))
            yield row, kind or Kind()


def every(comm: MPI.Comm, *, quick: bool = False) -> Iterator[tuple[Row, Kind]]:
    """Yield the rows of `epsmesh verify`, then those of the table, with their kinds; collective."""
    yield from with_kinds(lambda: verify.rows(comm))
    for group in groups(comm, quick=quick):
        yield from with_kinds(lambda group=group: group)


def written(found: Iterable[tuple[Row, Kind]]) -> str:
    """Return the table as text: lines with a # are what made it."""
    commit = run(["git", "rev-parse", "--short=8", "HEAD"], cwd=_FOLDER, capture_output=True, text=True, check=True)
    text = io.StringIO()
    text.write(f"# Made by `python -m tests.verification --table`; commit {commit.stdout.strip()}, {date.today()}.\n")
    text.write(f"# {_versions()}\n")
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    for row, kind in found:
        bar = row.bar + row.reference_bar
        numbers = {"reference": f"{row.reference:.8g}", "value": f"{row.value:.8g}", "bar": f"{bar:.2g}"}
        words = {word: getattr(kind, word) for word in WORDS} | {"further": "; ".join(kind.further)}
        table.writerow({"scene": row.scene, "path": row.path, "source": row.source, **words, **numbers})
    return text.getvalue()


def _versions() -> str:
    known = provenance(ranks=1)
    return "; ".join(f"{name.removeprefix('version_')} {known[name]}" for name in known if name.startswith("version_"))


@contextmanager
def _planned() -> Iterator[list[Study]]:
    """Collect the studies of the plans that are made."""
    made, found = Plan.__init__, list[Study]()

    def noting(self: Plan, *arguments: Any, **named: Any) -> None:
        made(self, *arguments, **named)
        found.append(self.study)

    with patch.object(Plan, "__init__", noting):
        yield found
