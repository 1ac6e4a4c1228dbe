"""Compute the cells, each truth once, and judge them."""

import json
import time
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.run.record import Record
from pipeline.study.load import parse
from pipeline.study.problems import StudyError
from pipeline.verify.stress.cell import Cell, Result, judge, refused
from pipeline.verify.stress.ranks import PATH, compute_on, why_not
from pipeline.verify.stress.rows import cells


def run(comm: MPI.Comm, names: Collection[str] | None = None, *, quick: bool = False) -> Iterator[Result]:
    """Yield the results of the rows in ``names``, of all by default, as they are computed; collective.

    ``quick`` leaves one or a few cells of most rows.

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
    """Return the ``known`` rows that are meant by ``names``: the row of that name, or all whose name holds it.

    Raises:
        ValueError: if there is none of a name.
    """
    found: dict[str, set[str]] = {}
    for name in names or known:
        found[name] = {name} if name in known else {row for row in known if name.lower() in row.lower()}
    if unknown := sorted(name for name, rows in found.items() if not rows):
        raise ValueError(f"no row {', '.join(unknown)}; there are: {'; '.join(known)}")
    return set().union(*found.values())


class _Matrix:
    """Keeps what cells are compared with."""

    def __init__(self, comm: MPI.Comm):
        self._comm = comm
        self._truths: dict[str, Record] = {}
        self._bases: dict[tuple[str, str], Record] = {}

    def result(self, cell: Cell) -> Result:
        """Compute a cell and its reference, and judge it; collective."""
        if cell.ranks and (reason := why_not(self._comm)):
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
            return compute_on(cell.ranks, cell.study)
        return _compute(self._comm, cell.study, without=PATH)

    def _truth(self, cell: Cell) -> Record:
        """Return the force of the cell's scene with an accuracy asked for; a miss leaves a wider bar."""
        sizes = cell.study["mesh"]
        kept = ("epsilon", "outside") if sizes.get("outside", "coarse") != "coarse" else ()
        if sizes["epsilon"] == "full":
            kept = ()
        scene = cell.study | {"mesh": {"accuracy": cell.accuracy, **{key: sizes[key] for key in kept}}}
        scene["solve"] = {"exact": False}
        key = json.dumps(scene, sort_keys=True)
        if key not in self._truths:
            try:
                self._truths[key] = _compute(self._comm, scene)
            except StudyError as error:
                self._truths[key] = Record("", "failed", str(error))
        return self._truths[key]


def _compute(comm: MPI.Comm, scene: dict[str, Any], without: tuple[str, ...] = ()) -> Record:
    """Return the record of a study of one case."""
    (record,) = compute(make_plan(parse(scene), without=without), comm).values()
    return replace(record, message=" ".join(record.message.split()))
