"""Numerical stability as a matrix: extreme values of every input, each compared with a reference: ``make stress``.

    python -m benchmarks.stress [ROW ...] [--quick] [--json]

A word selects all rows whose name contains it, such as ``poisson layer``. A cell passes if its force agrees with the
reference within both error bars, or if it is refused where no answer can be expected. A wrong number with a good status
must never occur. The exit status is 1 if any cell fails.
"""

import json
import shutil
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite, nan
from typing import Any, Literal

from mpi4py import MPI

from benchmarks.campaigns import each, ended_soon, finite
from benchmarks.processor import alone
from benchmarks.scenes import record_of
from benchmarks.stress_cells import Cell, cells
from benchmarks.tables import options
from epsmesh.run.record import UNFORESEEN, Record
from epsmesh.study.problems import StudyError

# Largest relative change under an exact invariance.
INVARIANT = 1e-8
# Largest useful error bar: above it the case should have been refused.
IDLE = 1.0
# Cells are solved in three dimensions, with the mesh given; references of axisymmetric scenes are not.
_WITHOUT = ("axisymmetric",)
_ON_RANKS = 300  # seconds until a cell on ranks of its own counts as failed
_LINE = "{:8} {:30} {:56} {:>12} {:>12} {:>5} {:>8} {:>6}  {}"
_LONGEST = 110  # characters of a message in the table; JSON has all of it


@dataclass(frozen=True)
class Result:
    """Result of a cell; ``error`` and ``bar``, the sum of case's and reference's, are relative to the reference."""

    row: str
    value: str
    status: Literal["pass", "refused", "skipped", "FAIL"]
    error: float = nan
    bar: float = nan
    iterations: int = 0
    dofs: int = 0
    seconds: float = 0.0
    message: str = ""
    wrong: bool = False  # a wrong number with a good status: the failure that counts

    @property
    def is_good(self) -> bool:
        """Whether the cell passed."""
        return self.status != "FAIL"


def judge(cell: Cell, record: Record, reference: Record | None, seconds: float = 0.0) -> Result:
    """Return the verdict on ``record``; ``reference`` is None if it was not needed.

    Forces of ``reference`` are for a ``scale`` of 1.
    """
    found = Result(
        cell.row,
        cell.value,
        "FAIL",
        iterations=record.iterations,
        dofs=record.dofs,
        seconds=seconds,
        message=record.message,
    )
    if record.message.startswith(UNFORESEEN):
        return found
    if record.status != "ok":
        return replace(found, status="refused" if cell.expect != "right" and record.message else "FAIL")
    if cell.expect == "refused":
        return replace(found, wrong=True, message="computed, though it should be refused")
    if not isfinite(record.force):
        return replace(found, wrong=True, message=f"a force of {record.force} N")
    if not (isfinite(record.force_error) and record.force_error >= 0):
        words = f"error bar of {record.force_error:.3g} {record.message}".strip()
        return replace(found, wrong=record.force_error < 0, message=words)
    idle = f"idle error bar of {record.force_error:.0%}" if record.force_error > IDLE else ""
    if reference is None or not (isfinite(reference.force) and reference.force):
        words = f"no reference: {reference.message if reference else 'not computed'}"
        return replace(found, message=f"{idle} {words}".strip())
    if cell.against == "truth" and record.origin == reference.origin == "axisymmetric":
        return replace(found, message="case and reference were computed in the same way: the comparison is void")
    ratio = record.force / cell.scale / reference.force
    bar = INVARIANT if cell.against == "base" else min(1.0, abs(ratio)) * record.force_error + reference.force_error
    found = replace(found, error=ratio - 1, bar=bar)
    if not abs(ratio - 1) <= bar:
        return replace(found, wrong=True, message=f"WRONG by {abs(ratio - 1) / bar:.3g} bars {record.message}".strip())
    if idle:
        return replace(found, wrong=abs(ratio - 1) > 1, message=idle)
    return replace(found, status="pass")


def refused(cell: Cell, message: str) -> Result:
    """Return the verdict on a study that was refused before computing."""
    status: Literal["refused", "FAIL"] = "refused" if cell.expect != "right" and message else "FAIL"
    return Result(cell.row, cell.value, status, message=message)


def run(comm: MPI.Comm, names: Collection[str] | None = None, *, quick: bool = False) -> Iterator[Result]:
    """Yield the results of the rows in ``names``, of all by default, as they are computed; collective.

    ``quick`` keeps one or a few cells of most rows.

    Raises:
        ValueError: as :func:`rows_of` does.
    """
    chosen = cells()
    rows = rows_of(names, tuple(dict.fromkeys(cell.row for cell in chosen)))
    matrix = _Matrix(comm)
    for cell in chosen:
        if cell.row in rows and (cell.quick or not quick):
            yield matrix.result(cell)


def rows_of(names: Collection[str] | None, known: Collection[str]) -> set[str]:
    """Return the ``known`` rows selected by ``names``: the row of that name, or all whose name contains it.

    Raises:
        ValueError: if a name selects none.
    """
    found: dict[str, set[str]] = {}
    for name in names or known:
        found[name] = {name} if name in known else {row for row in known if name.lower() in row.lower()}
    if unknown := sorted(name for name, rows in found.items() if not rows):
        raise ValueError(f"no row {', '.join(unknown)}; rows are: {'; '.join(known)}")
    return set().union(*found.values())


class _Matrix:
    """Cache of the references of cells."""

    def __init__(self, comm: MPI.Comm):
        self._comm = comm
        self._truths: dict[str, Record] = {}
        self._bases: dict[tuple[str, str], Record] = {}

    def result(self, cell: Cell) -> Result:
        """Compute a cell and its reference, and return the verdict; collective."""
        if cell.ranks and (reason := _why_not(self._comm)):
            return Result(cell.row, cell.value, "skipped", message=reason)
        start = time.perf_counter()
        try:
            record = self._record(cell)
        except StudyError as error:
            return refused(cell, "; ".join(str(problem) for problem in error.problems))
        seconds = time.perf_counter() - start
        if cell.against == "truth":
            self._bases.setdefault((cell.row, cell.group), record)
        reference = None
        if record.status == "ok" and cell.expect != "refused":
            reference = self._truth(cell) if cell.against == "truth" else self._bases.get((cell.row, cell.group))
        return judge(cell, record, reference, seconds)

    def _record(self, cell: Cell) -> Record:
        if cell.ranks:
            return _on_ranks(cell.ranks, cell.study)
        return record_of(cell.study, _WITHOUT, self._comm)

    def _truth(self, cell: Cell) -> Record:
        """Return the force of the cell's scene at a required accuracy; if it is not reached, the bar is wider."""
        sizes = cell.study["mesh"]
        kept = ("epsilon", "outside") if sizes.get("outside", "coarse") != "coarse" else ()
        if sizes["epsilon"] == "full":
            kept = ()
        scene = cell.study | {"mesh": {"accuracy": cell.accuracy, **{key: sizes[key] for key in kept}}}
        scene["solve"] = {"exact": False}
        key = json.dumps(scene, sort_keys=True)
        if key not in self._truths:
            try:
                self._truths[key] = record_of(scene, comm=self._comm)
            except StudyError as error:
                self._truths[key] = Record("", "failed", str(error))
        return self._truths[key]


def _why_not(comm: MPI.Comm) -> str:
    """Return why ranks cannot be started from here, or an empty text."""
    if comm.size > 1:
        return "under mpirun already"
    return "" if shutil.which("mpirun") else "there is no mpirun"


def _on_ranks(ranks: int, scene: dict[str, Any]) -> Record:
    """Return the record of a study of one case, computed on separate ranks."""
    try:
        found = alone(scene, ranks, longest=_ON_RANKS, without=_WITHOUT)
    except RuntimeError as error:
        return Record("", "failed", f"{error}"[-300:])
    return Record.from_json(found["record"])


def heading() -> str:
    """Return the names of the columns."""
    return _LINE.format("", "row", "value", "error", "bar", "its", "dofs", "s", "").rstrip()


def line(result: Result) -> str:
    """Return one line of the table."""
    message = result.message if len(result.message) <= _LONGEST else result.message[: _LONGEST - 1] + "…"
    return _LINE.format(
        result.status,
        result.row,
        result.value,
        _relative(result.error, "+"),
        _relative(result.bar),
        result.iterations,
        result.dofs,
        f"{result.seconds:.1f}",
        message,
    ).rstrip()


def _relative(value: float, sign: str = "") -> str:
    if not isfinite(value):
        return ""
    return f"{100 * value:{sign}.4f} %" if abs(value) >= 1e-6 or value == 0 else f"{value:{sign}.0e}"


def summary(results: Sequence[Result]) -> str:
    """Return the counts, and the number of wrong numbers among the failures."""
    counts = {s: sum(r.status == s for r in results) for s in ("pass", "refused", "skipped", "FAIL")}
    wrong = sum(r.wrong for r in results)
    words = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    return f"{len(results)} cells: {words}; {wrong or 'no'} wrong number{'' if wrong == 1 else 's'} with a good status"


def table(results: Iterable[Result]) -> str:
    """Return the whole table."""
    found = list(results)
    return "\n".join([heading(), *map(line, found), summary(found)])


def to_json(results: Iterable[Result]) -> str:
    """Return a JSON list with an object for each result; NaN becomes null."""
    return json.dumps([finite(asdict(result)) for result in results], indent=2, ensure_ascii=False)


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = options(__doc__, writes=False)
    parser.add_argument("names", nargs="*", metavar="ROW")
    parser.add_argument("--quick", action="store_true", help="a few rows of each kind")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args(arguments)
    comm = MPI.COMM_WORLD
    speaks = comm.rank == 0
    if speaks and not asked.json:
        print(heading())
    try:
        with ended_soon():
            found = run(comm, asked.names or None, quick=asked.quick)
            results = list(each(found, line if speaks and not asked.json else None))
    except ValueError as wrong:
        parser.error(str(wrong))
    if speaks:
        print(to_json(results) if asked.json else summary(results))
    return int(not all(result.is_good for result in results))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
