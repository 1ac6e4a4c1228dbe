"""The command that tests the program itself against known forces."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from epsmesh.cli.console import say
from epsmesh.cli.faults import DONE, SOME_FAILED
from epsmesh.cli.words import Json

if TYPE_CHECKING:
    from mpi4py import MPI

    from epsmesh.verify import Row

_ROW = "{:4} {:58} {:24} {:>12} {:>12} {:>9} {:>9}  {}"


def verify(as_json: Json = False) -> None:
    """Compare ten forces of this installation with known ones: is it right?

    References: closed forms, published tables, and values converged beforehand. A row is "ok" if value and reference
    agree within their error bars, else "OUT". Exit status 1 if a row is OUT.

    Example: epsmesh verify
    """
    from epsmesh.verify import rows
    from epsmesh.workflow import abort_on_exception, ended_soon, load_solvers, world

    comm = world()
    load_solvers()
    with abort_on_exception(comm), ended_soon():
        out = show(comm, rows(comm), as_json=as_json)
    raise typer.Exit(SOME_FAILED if out else DONE)


def show(comm: "MPI.Comm", rows: "Iterable[Row]", *, as_json: bool = False) -> int:
    """Print comparisons as they are made, on the first rank; return how many are out; collective."""
    lists = comm.rank == 0 and not as_json
    if lists:
        print(_ROW.format("", "scene", "path", "reference", "value", "error", "bar", "source"))
    table = []
    for row in rows:
        table.append(row)
        if lists:
            print(_line(row), flush=True)
    out = sum(not row.is_right for row in table)
    if comm.rank == 0:
        verdict = f"{len(table)} rows, {out} out" if out else f"{len(table)} rows, all right"
        say([{**asdict(r), "error": r.error, "right": r.is_right} for r in table], verdict)
    return out


def _line(row: "Row") -> str:
    bar = row.bar + row.reference_bar
    error, bar_text = (f"{100 * row.error:+.4f} %", f"{100 * bar:.4f} %") if row.reference else (f"{row.error:.0e}", "")
    verdict = "ok" if row.is_right else "OUT"
    source = f"{row.source}; {row.message}" if row.message else row.source
    numbers = f"{row.reference:.6g}", f"{row.value:.6g}", error, bar_text
    return _ROW.format(verdict, row.scene, row.path, *numbers, source)
