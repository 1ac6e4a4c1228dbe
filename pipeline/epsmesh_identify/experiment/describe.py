"""What is in the file of a force curve, in words, and the part of a study file that reads it."""

import json
from pathlib import Path

import numpy as np

from epsmesh_identify.experiment.columns import Recorded, candidates
from epsmesh_identify.experiment.header import is_unit_of
from epsmesh_identify.experiment.read import read_curve, whole_curve
from epsmesh_identify.experiment.reading import ExperimentError, Reading
from epsmesh_identify.experiment.segments import cycles_of
from epsmesh_identify.experiment.signs import signed, signs_of
from epsmesh_identify.experiment.table import Table, table_of
from epsmesh_identify.experiment.text import read_lines
from epsmesh_identify.experiment.words import is_called

_SEPARATORS = {" ": "spaces", "\t": "tabs", ",": "commas", ";": "semicolons", "|": "bars"}
# Units that people read, from the largest on: the first of which there is one at least.
_READ = {
    "depth": ((1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")),
    "force": ((1.0, "N"), (1e-3, "mN"), (1e-6, "µN"), (1e-9, "nN")),
    "time": ((1.0, "s"), (1e-3, "ms")),
}

# Of columns without a unit, as an example.
_UNITS = {"depth": "mm", "force": "N", "time": "s"}


def describe(path: Path, reading: Reading | None = None) -> str:
    """Return what a file has: its table, columns, segments, what was found, and a ``[[measurement]]`` to paste.

    A curve that cannot be read without the user's choice is described as far as it is known, with the reason.

    Raises:
        ExperimentError: if it has no table of numbers.
    """
    reading = reading or Reading()
    table = table_of(read_lines(path), str(path))
    lines = [_of_table(table, path.name), *_of_columns(table)]
    head = [
        "[[measurement]]",
        f"name = {_text(path.stem)}",
        f"file = {_text(path.resolve().as_posix())} # or its path from the study's folder",
    ]
    whole = None
    try:
        whole = whole_curve(path, reading)
        curve, signs = read_curve(path, reading), signs_of(whole, reading)
    except ExperimentError as error:
        lines += ["", f"not read yet: {error}"]
        block = _block(whole, None) if whole else _to_choose(table)
    else:
        lines += ["", *_of_segments(signed(whole, reading)), *(f"- {note}" for note in curve.notes)]
        block = _block(whole, signs)
    return "\n".join([*lines, "", *head, *block, *_to_add(table)])


def _of_table(table: Table, name: str) -> str:
    separator = _SEPARATORS[table.layout.separator]
    return (
        f"{name}: {len(table.lines)} rows of {table.layout.width} columns in lines {table.lines[0]} to "
        f"{table.lines[-1]}, separated by {separator}, decimal {'commas' if table.layout.decimal == ',' else 'points'}"
    )


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
    """Return a line for each cycle: what its segments are."""
    lines = []
    cycles = cycles_of(found.depth, found.time)
    for number, cycle in enumerate(cycles, start=1):
        parts = []
        for segment in ("approach", "hold", "retract"):
            rows = cycle.rows(segment)
            if rows.stop > rows.start:
                parts.append(f"{segment} {_of_part(found.part(rows))}")
        lines.append(f"{f'cycle {number}: ' if len(cycles) > 1 else ''}{'; '.join(parts)}")
    return lines


def _of_part(found: Recorded) -> str:
    """Say how many rows a part has, and over which depths, forces and times."""
    values = {"depth": found.depth, "force": found.force, "time": found.time}
    extents = []
    for kind, column in values.items():
        if column is not None:
            extent = float(np.ptp(column))
            factor, unit = next((one for one in _READ[kind] if extent >= one[0]), _READ[kind][-1])
            extents.append(f"{extent / factor:.4g} {unit}")
    return f"of {len(found.depth)} rows over {', '.join(extents)}"


def _block(found: Recorded, signs: tuple[int, int] | None) -> list[str]:
    """Return the keys of a study that reads the file so; without ``signs``, these are to be chosen."""
    columns = ", ".join(
        f"{kind} = {header if header.isdecimal() else _text(header)}" for kind, header in found.names.items()
    )
    depth, force = signs or (1, 1)
    sign = f"sign = {{depth = {depth}, force = {force}}}{'' if signs else ' # check'}"
    return [f"columns = {{{columns}}}", *([sign] if signs is None or min(signs) < 0 else [])]


def _to_choose(table: Table) -> list[str]:
    """Return the keys of a study in which columns are to be chosen: the likely ones are written."""
    if spring := _of_spring(table):
        return [f"columns = {{{', '.join(spring)}}} # check"]
    chosen: dict[str, int] = {}
    for place, kind in enumerate(("time", "depth", "force")):
        free = [n for n in candidates(table, kind, Reading()) if n not in {*chosen.values(), *table.strange}]
        if not free and kind != "time" and place < len(table.headers) and not table.headers[place].text:
            free = [place]
        chosen |= {kind: free[0]} if free else {}
    columns = ", ".join(f"{kind} = {_of_column(table, number)}" for kind, number in chosen.items())
    units = [f'{kind} = "{_UNITS[kind]}"' for kind, number in chosen.items() if not table.headers[number].unit]
    lacking = [kind for kind in ("depth", "force") if kind not in chosen]
    hint = f"; no column has the name and unit of {' and '.join(lacking)}" if lacking else ""
    return [
        f"columns = {{{columns}}} # check: header or number of each column{hint}"
        if chosen
        else f"# columns = {{depth = …, force = …}}{hint}",
        *([f"units = {{{', '.join(units)}}} # check"] if units else []),
    ]


def _of_spring(table: Table) -> list[str]:
    """Return the keys of the way of a piezo, and the deflection of a spring; none if the table has no deflection."""
    lengths = [n for n, header in enumerate(table.headers) if is_unit_of(header.unit, "m")]
    bent = [n for n in lengths if is_called(table.headers[n].name, "deflection")]
    ways = [n for n in lengths if n not in bent]
    if not (bent and ways):
        return []
    chosen = {"piezo": ways[0], "deflection": bent[0]}
    return [
        *(f"{kind} = {_of_column(table, number)}" for kind, number in chosen.items()),
        f"spring = {_text(table.spring or '0.05 N/m')}",
    ]


def _of_column(table: Table, number: int) -> str:
    text = table.headers[number].text
    return _text(text) if text else f"{number + 1}"


def _to_add(table: Table) -> list[str]:
    """Return the lines that a machine which yields needs."""
    if table.spring:
        return [f"machine_stiffness = {_text(table.spring)} # of the spring, if the depth is the way of the piezo"]
    return ['# machine_stiffness = "60 N/mm" # of machine and load cell; or a range, or "unknown"; rigid without it']


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
