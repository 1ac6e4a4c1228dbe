"""What is in the file of a force curve, in words, and the part of a study file that reads it."""

import json
from pathlib import Path

import numpy as np

from epsmesh_identify.experiment.columns import Choice, Recorded
from epsmesh_identify.experiment.header import written
from epsmesh_identify.experiment.read import read_curve, whole_curve
from epsmesh_identify.experiment.reading import UNITS, ExperimentError, Reading
from epsmesh_identify.experiment.segments import cycles_of
from epsmesh_identify.experiment.signs import signed, signs_of
from epsmesh_identify.experiment.table import Table, table_of
from epsmesh_identify.experiment.text import read_lines

_SEPARATORS = {" ": "spaces", "\t": "tabs", ",": "commas", ";": "semicolons", "|": "bars"}


def describe(path: Path, reading: Reading | None = None) -> str:
    """Return what a file has: its table, columns, segments, what was found, and a ``[[measurement]]`` to paste.

    A curve that cannot be read without the user's choice is described as far as it is known, with the reason.

    Raises:
        ExperimentError: if it has no table of numbers.
    """
    reading = reading or Reading()
    table = table_of(read_lines(path), str(path))
    decimal = "commas" if table.layout.decimal == "," else "points"
    lines = [
        f"{path.name}: {len(table.lines)} rows of {table.layout.width} columns in lines {table.lines[0]} to "
        f"{table.lines[-1]}, separated by {_SEPARATORS[table.layout.separator]}, decimal {decimal}",
        *_of_columns(table),
        "",
    ]
    whole = None
    try:
        whole = whole_curve(path, reading)
        curve, signs = read_curve(path, reading), signs_of(whole, reading)
    except ExperimentError as error:
        lines += [f"not read yet: {error}"]
        keys = [*_columns(whole), "sign = {depth = 1, force = 1} # check"] if whole else Choice(table).to_paste()
    else:
        lines += [*_of_segments(signed(whole, reading)), *(f"- {note}" for note in curve.notes)]
        sign = f"sign = {{depth = {signs[0]}, force = {signs[1]}}}"
        keys = [*_columns(whole), *([sign] if min(signs) < 0 else [])]
    of_machine = (
        '# machine_stiffness = "60 N/mm" # of machine and load cell; or a range, or "unknown"; rigid without it'
    )
    of_spring = f"machine_stiffness = {_text(table.spring)} # of the spring, if the depth is the way of the piezo"
    return "\n".join([
        *lines,
        "",
        "[[measurement]]",
        f"name = {_text(path.stem)}",
        f"file = {_text(path.resolve().as_posix())} # or its path from the study's folder",
        *keys,
        of_spring if table.spring else of_machine,
    ])  # fmt: skip


def _of_columns(table: Table) -> list[str]:
    """Return a line for each column: number, header, and range of values."""
    rows = []
    for number, header in enumerate(table.headers):
        values = table.values[:, number]
        values = values[~np.isnan(values)]
        extent = f"{values.min():.10g} to {values.max():.10g}" if values.size else "no values"
        text = f', and text: "{table.strange[number][1]}"' if number in table.strange else ""
        rows.append((str(number + 1), header.text or "(no header)", f"{extent}{text}"))
    widths = [max(len(row[place]) for row in rows) for place in (0, 1)]
    return [f"  {number:>{widths[0]}}  {header:<{widths[1]}}  {extent}" for number, header, extent in rows]


def _of_segments(found: Recorded) -> list[str]:
    """Return a line for each cycle: how many rows its segments have, and over which depths, forces and times."""
    lines = []
    cycles = cycles_of(found.depth, found.time)
    for number, cycle in enumerate(cycles, start=1):
        parts = []
        for segment in ("approach", "hold", "retract"):
            part = found.part(cycle.rows(segment))
            columns = {"depth": part.depth, "force": part.force, "time": part.time}
            if part.lines.size:
                extents = [written(float(np.ptp(c)), UNITS[k]) for k, c in columns.items() if c is not None]
                parts.append(f"{segment} of {part.lines.size} rows over {', '.join(extents)}")
        lines.append(f"{f'cycle {number}: ' if len(cycles) > 1 else ''}{'; '.join(parts)}")
    return lines


def _columns(found: Recorded) -> list[str]:
    """Return the key of a study that reads the columns so."""
    names = (f"{kind} = {header if header.isdecimal() else _text(header)}" for kind, header in found.names.items())
    return [f"columns = {{{', '.join(names)}}}"]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
