"""Which columns of a table are depth, force and time: those that are named, or that are unmistakable."""

from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh_identify.experiment.header import MASSES, factor_of, header_of, is_unit_of, without_mark
from epsmesh_identify.experiment.reading import UNITS, ExperimentError, Reading
from epsmesh_identify.experiment.table import Table
from epsmesh_identify.experiment.words import is_called

# Two columns of one kind are the same but for a constant within this share of their range.
_SAME = 1e-3
_SECTION = "[[measurement]]"
_KINDS = {"m": "a length", "N": "a force", "s": "a time"}


@dataclass(frozen=True)
class Recorded:
    """Depth (m), force (N) and time (s from the first row, or None) as recorded, and the lines they are from.

    ``names`` has the headers of the columns, by what they are. ``notes`` say what was found without being asked for.
    ``began`` is the time of the first row as recorded.
    """

    file: str
    depth: FloatArray
    force: FloatArray
    time: FloatArray | None
    lines: IntArray
    names: dict[str, str]
    notes: tuple[str, ...] = ()
    deflection: FloatArray | None = None
    began: float = 0.0

    @property
    def depth_name(self) -> str:
        """Header of the column of the depth."""
        return self.names.get("depth") or self.names.get("piezo", "")

    @property
    def force_name(self) -> str:
        """Header of the column of the force."""
        return self.names.get("force") or self.names.get("deflection", "")

    def part(self, rows: IntArray | slice | FloatArray) -> "Recorded":
        """Return some of the rows."""
        columns = {name: getattr(self, name) for name in ("depth", "force", "time", "lines", "deflection")}
        return replace(self, **{name: values[rows] for name, values in columns.items() if values is not None})

    def noting(self, *words: str) -> "Recorded":
        """Return it with more that was found."""
        return replace(self, notes=(*self.notes, *words))


def recorded(table: Table, reading: Reading) -> Recorded:
    """Return the columns of a table in SI units, without rows in which a value is missing.

    Raises:
        ExperimentError: if a column is missing, ambiguous, of another kind, without a unit, or has text.
    """
    notes = [*table.notes, *_empty(table)]
    has_spring = "deflection" in reading.columns
    wanted = ("piezo", "deflection") if has_spring else ("depth", "force")
    chosen: dict[str, int] = {}
    for kind in wanted:
        chosen[kind] = _named(table, kind, reading) if kind in reading.columns else _found(table, kind, reading, notes)
    if "time" in reading.columns:
        chosen["time"] = _named(table, "time", reading)
    elif (time := _time(table, set(chosen.values()), reading, notes)) is not None:
        chosen["time"] = time
    _check_distinct(table, chosen)
    values = {kind: _in_si(table, number, kind, reading, notes) for kind, number in chosen.items()}
    names = {kind: table.headers[number].text or f"{number + 1}" for kind, number in chosen.items()}
    way = values["piezo" if has_spring else "depth"]
    force = values["deflection"] * (reading.spring or 1.0) if has_spring else values["force"]
    found = Recorded(
        table.file, way, force, values.get("time"), table.lines, names, tuple(notes), values.get("deflection")
    )
    return _without_missing(found)


def _empty(table: Table) -> list[str]:
    """Say which columns have no value."""
    numbers = np.flatnonzero(np.isnan(table.values).all(axis=0))
    empty = [table.headers[n].text for n in numbers if table.headers[n].text and n not in table.strange]
    return [f"columns without values: {', '.join(empty)}"] if empty else []


def _title(table: Table, number: int) -> str:
    """Return what a message calls a column: its header, else its number."""
    return table.headers[number].text or f"number {number + 1}"


def _listed(table: Table) -> str:
    return ", ".join(f"`{_title(table, number)}`" for number in range(len(table.headers)))


def _unused(table: Table) -> str:
    """Return why the headers of a file are not used; "" if they are."""
    return f"; {table.unused}" if table.unused else ""


def _named(table: Table, kind: str, reading: Reading) -> int:
    """Return the number of the column that the study names, by header or number."""
    wanted = reading.columns[kind]
    if isinstance(wanted, int):
        if wanted > len(table.headers):
            raise ExperimentError(table.file, f"columns.{kind} = {wanted}: there are {len(table.headers)} columns")
        return wanted - 1
    wanted = without_mark(wanted)
    plain = [_plain(header.text) for header in table.headers]
    found = [number for number, text in enumerate(plain) if text == _plain(wanted)]
    if not found:  # without the unit, which may be in one of both only
        own = _plain(header_of(wanted).name)
        found = [number for number, header in enumerate(table.headers) if header.name and _plain(header.name) == own]
    if not found:
        raise ExperimentError(
            table.file, f'has no column "{wanted}" for {kind}: it has {_listed(table)}{_unused(table)}'
        )
    if len(found) > 1 and not _are_equal(table, found):
        numbers = ", ".join(str(number + 1) for number in found)
        raise ExperimentError(table.file, f'has several columns "{wanted}": give {kind} by number, one of {numbers}')
    return found[0]


def _plain(text: str) -> str:
    return " ".join(text.casefold().split())


def _are_equal(table: Table, numbers: list[int], *, but_for_a_constant: bool = False) -> bool:
    """Tell columns with the same values; a constant between them may be left out."""
    first, *others = (table.values[:, number] for number in numbers)
    spread = float(np.ptp(first[~np.isnan(first)])) if not np.isnan(first).all() else 0.0
    for other in others:
        difference = (other - first)[~np.isnan(other - first)]
        if not difference.size:
            return False
        off = np.ptp(difference) if but_for_a_constant else np.abs(difference).max()
        if off > _SAME * spread:
            return False
    return True


def candidates(table: Table, kind: str, reading: Reading) -> list[int]:
    """Return the columns that can be depth, force or time: those that are called so, else those of such a unit."""
    units = [_unit(table, number, reading, kind) for number in range(len(table.headers))]
    names = [header.name for header in table.headers]
    full = [n for n in range(len(names)) if _has_values(table, n)]
    of_kind = [n for n in full if is_unit_of(units[n], UNITS[kind])]
    of_kind = [n for n in of_kind if units[n] not in MASSES or is_called(names[n], kind)]
    of_kind = [n for n in of_kind if kind != "depth" or not is_called(names[n], "deflection")]
    called = [n for n in full if (n in of_kind or not units[n]) and is_called(names[n], kind)]
    return sorted(called, key=lambda n: n not in of_kind) or of_kind


def _found(table: Table, kind: str, reading: Reading, notes: list[str]) -> int:
    """Return the column that is unmistakably depth or force."""
    found = candidates(table, kind, reading)
    titles = [f"`{_title(table, number)}`" for number in found]
    if found and _are_equal(table, found, but_for_a_constant=kind == "force"):
        same = f"; {', '.join(titles[1:])} differs by no more than a constant" if titles[1:] else ""
        notes.append(f"{kind} is column {titles[0]}{same}")
        return found[0]
    what = f"could be {', '.join(titles)}" if found else "is not found"
    raise ExperimentError(
        table.file,
        f"{kind} {what} among {_listed(table)}: name it by header or number in columns of {_SECTION}, and its unit in "
        f"units if the header has none{_if_bent(table)}{_why_not(table, kind, reading)}{_unused(table)}",
    )


def _why_not(table: Table, kind: str, reading: Reading) -> str:
    """Return why columns that are called so are none: they have text or nothing, or a unit of another kind."""
    reasons = []
    for number, header in enumerate(table.headers):
        title, unit = _title(table, number), _unit(table, number, reading, kind)
        if number in table.strange:
            line, text = table.strange[number]
            reasons.append(f'`{title}` has text, "{text}" in line {line}')
        elif is_called(header.name, kind) and not _has_values(table, number):
            reasons.append(f"`{title}` has no values")
        elif is_called(header.name, kind) and unit and not is_unit_of(unit, UNITS[kind]):
            reasons.append(f"`{title}` has the unit {unit}, no unit of {_KINDS[UNITS[kind]]}")
    return "".join(f"; {reason}" for reason in reasons)


def _if_bent(table: Table) -> str:
    """Return what to do if a spring's deflection is the only force."""
    is_bent = any(is_called(header.name, "deflection") and is_unit_of(header.unit, "m") for header in table.headers)
    return "; if the force is the deflection of a spring, name piezo, deflection and spring" if is_bent else ""


def _time(table: Table, taken: set[int], reading: Reading, notes: list[str]) -> int | None:
    """Return the only column that is called time, or has a unit of time; None if there is none, or several."""
    for number, (line, text) in table.strange.items():
        if is_called(table.headers[number].name, "time"):
            notes.append(f'column `{_title(table, number)}` has text, "{text}" in line {line}, and is not read as time')
    found = [n for n in candidates(table, "time", reading) if n not in taken]
    without = [n for n in found if not _unit(table, n, reading, "time")]
    notes += [f"column `{_title(table, n)}` has no unit, and is not read as time: give it in units" for n in without]
    found = [n for n in found if n not in without]
    if len(found) > 1:
        notes.append(f"time could be {', '.join(_title(table, n) for n in found)}: not read; name it in columns")
    if len(found) != 1:
        return None
    notes.append(f"time is column `{_title(table, found[0])}`")
    return found[0]


def _has_values(table: Table, number: int) -> bool:
    return not bool(np.isnan(table.values[:, number]).all())


def _unit(table: Table, number: int, reading: Reading, kind: str) -> str:
    """Return the unit of a column as text: the header's, that in the study's name of it, or that of `units`."""
    header = table.headers[number].unit
    wanted = reading.columns.get(kind)
    in_name = header_of(wanted).unit if isinstance(wanted, str) else ""
    return header or in_name or reading.units.get(kind, "")


def _in_si(table: Table, number: int, kind: str, reading: Reading, notes: list[str]) -> FloatArray:
    """Return a column in SI units."""
    title, si = _title(table, number), UNITS[kind]
    if number in table.strange:
        line, text = table.strange[number]
        raise ExperimentError(
            table.file, f'"{text}" is no number (for {kind}): correct or remove it', column=title, line=line
        )
    if not _has_values(table, number):
        raise ExperimentError(table.file, f"has no values (for {kind})", column=title)
    unit = _unit(table, number, reading, kind)
    if not unit:
        example = {"m": "mm", "N": "mN", "s": "s"}[si]
        raise ExperimentError(
            table.file, f'has no unit: write units = {{{kind} = "{example}"}} in {_SECTION}', column=title
        )
    try:
        factor = factor_of(unit, si)
    except ValueError as error:
        raise ExperimentError(table.file, f"cannot be {kind}: {_message(error)}", column=title) from None
    given = reading.units.get(kind)
    if given is not None and not np.isclose(factor_of(given, si), factor, rtol=1e-9):
        raise ExperimentError(
            table.file, f'has the unit {unit}, but units.{kind} is "{given}": remove the wrong one', column=title
        )
    wanted = reading.columns.get(kind)
    named = header_of(wanted).unit if isinstance(wanted, str) else ""
    if named and is_unit_of(named, si) and not np.isclose(factor_of(named, si), factor, rtol=1e-9):
        raise ExperimentError(table.file, f'has the unit {unit}, but columns.{kind} is "{wanted}"', column=title)
    if unit in MASSES:
        notes.append(f"{kind} is the weight of a mass: 1 {unit} is {factor:.6g} N")
    return table.values[:, number] * factor


def _message(error: ValueError) -> str:
    message = getattr(error, "message", None)
    return str(message()) if callable(message) else str(error)


def _check_distinct(table: Table, chosen: dict[str, int]) -> None:
    """Report a column that is named for two things."""
    kinds: dict[int, str] = {}
    for kind, number in chosen.items():
        if number in kinds:
            raise ExperimentError(table.file, f"is named for {kinds[number]} and {kind}", column=_title(table, number))
        kinds[number] = kind


def _without_missing(found: Recorded) -> Recorded:
    """Return the rows that have all values, with times from the first of them on."""
    missing = np.isnan(found.depth) | np.isnan(found.force)
    if found.time is not None:
        missing |= np.isnan(found.time)
    rows = np.flatnonzero(~missing)
    if not rows.size:
        raise ExperimentError(found.file, "has no row with depth and force")
    kept = found.part(rows)
    if kept.time is not None and np.ptp(kept.time) == 0:
        kept = replace(kept, time=None).noting(f"time never changes (column `{kept.names['time']}`): not read")
    if kept.time is not None:
        kept = replace(kept, time=kept.time - kept.time[0], began=float(kept.time[0]))
    count = int(missing.sum())
    if count:
        first = int(found.lines[np.flatnonzero(missing)[0]])
        kept = kept.noting(f"{count} rows without all values, the first in line {first}: left out")
    return kept
