"""Which columns of a table are depth, force and time: those that are named, or that are unmistakable."""

import json
from dataclasses import dataclass, field, replace

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh_identify.experiment.header import factor_of, header_of, is_mass, is_unit_of, without_mark
from epsmesh_identify.experiment.reading import UNITS, ExperimentError, Reading
from epsmesh_identify.experiment.table import Table

# Two columns of one kind are the same but for a constant within this share of their range.
_SAME = 1e-3
_KINDS = {"m": "a length", "N": "a force", "s": "a time"}
# Of columns without a unit, as an example.
_EXAMPLES = {"m": "mm", "N": "mN", "s": "s"}


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


@dataclass(frozen=True)
class Choice:
    """The choice of the columns of a table, as a study reads it; ``notes`` say which were found, and what is odd."""

    table: Table
    reading: Reading = field(default_factory=Reading)
    notes: list[str] = field(default_factory=list)

    def recorded(self) -> Recorded:
        """Return the columns in SI units, without rows in which a value is missing.

        Raises:
            ExperimentError: if a column is missing, ambiguous, of another kind, without a unit, or has text.
        """
        table, headers = self.table, self.table.headers
        empty = [header.text for n, header in enumerate(headers) if not (self._is_full(n) or n in table.strange)]
        if empty := list(filter(None, empty)):
            self.notes.append(f"columns without values: {', '.join(empty)}")
        has_spring = "deflection" in self.reading.columns
        wanted = ("piezo", "deflection") if has_spring else ("depth", "force")
        chosen = {kind: self._named(kind) if kind in self.reading.columns else self._found(kind) for kind in wanted}
        time = self._named("time") if "time" in self.reading.columns else self._time(set(chosen.values()))
        chosen |= {} if time is None else {"time": time}
        kinds: dict[int, str] = {}
        for kind, number in chosen.items():
            if other := kinds.get(number):
                raise self._refusal(f"is named for {other} and {kind}", number)
            kinds[number] = kind
        values = {kind: self._in_si(number, kind) for kind, number in chosen.items()}
        names = {kind: headers[number].text or f"{number + 1}" for kind, number in chosen.items()}
        way, force = (values[kind] for kind in wanted)
        found = Recorded(
            table.file,
            way,
            force * (self.reading.spring or 1.0) if has_spring else force,
            values.get("time"),
            table.lines,
            names,
            (*table.notes, *self.notes),
            values.get("deflection"),
        )
        return _without_missing(found)

    def to_paste(self) -> list[str]:
        """Return the lines of a study that choose the columns: the likely ones, for the user to check."""
        columns, units = self._likely()
        lacking = [kind for kind in ("depth", "force") if kind not in columns and "spring" not in columns]
        hint = f"; no column has the name and unit of {' and '.join(lacking)}" if lacking else ""
        if not columns:
            return [f"# columns = {{depth = …, force = …}}{hint}"]
        check = f"# check: header or number of each column{hint}"
        return [f"columns = {_inline(columns)} {check}", *([f"units = {_inline(units)} # check"] if units else [])]

    def _likely(self) -> tuple[dict[str, str], dict[str, str]]:
        """Return the likely columns, and units where headers have none, as a study writes both."""
        headers = self.table.headers
        lengths = [n for n, header in enumerate(headers) if is_unit_of(header.unit, "m")]
        bent = [n for n in lengths if headers[n].is_called("deflection")]
        if bent and (ways := [n for n in lengths if n not in bent]):
            spring = _text(self.table.spring or "0.05 N/m")
            return {"piezo": self._pasted(ways[0]), "deflection": self._pasted(bent[0]), "spring": spring}, {}
        order = ("time", "depth", "force")
        chosen: dict[str, int] = {}
        if not any(header.text for header in headers):  # in this order, as most files have them
            first = max(len(order) - len(headers), 0)
            chosen = {kind: order.index(kind) - first for kind in order[1:]}
        for kind in order if any(header.text for header in headers) else ():
            free = [n for n in self._candidates(kind) if n not in {*chosen.values(), *self.table.strange}]
            chosen |= {kind: free[0]} if free else {}
        rest = [n for n, header in enumerate(headers) if n not in chosen.values() and not header.unit]
        bare = [k for k in order if (not headers[chosen[k]].unit if k in chosen else rest and k != "time")]
        units = {kind: _text(_EXAMPLES[UNITS[kind]]) for kind in bare}
        return {kind: self._pasted(number) for kind, number in chosen.items()}, units

    def _pasted(self, number: int) -> str:
        text = self.table.headers[number].text
        return _text(text) if text else f"{number + 1}"

    def _title(self, number: int) -> str:
        """Return what a message calls a column: its header, else its number."""
        return self.table.headers[number].text or f"number {number + 1}"

    def _refusal(self, why: str, number: int | None = None, line: int | None = None) -> ExperimentError:
        column = "" if number is None else self._title(number)
        return ExperimentError(self.table.file, why, column=column, line=line)

    def _listed(self) -> str:
        return ", ".join(f"`{self._title(number)}`" for number in range(len(self.table.headers)))

    def _named(self, kind: str) -> int:
        """Return the number of the column that the study names, by header or number."""
        wanted, headers = self.reading.columns[kind], self.table.headers
        if isinstance(wanted, int):
            if wanted > len(headers):
                raise self._refusal(f"columns.{kind} = {wanted}: there are {len(headers)} columns")
            return wanted - 1
        wanted = without_mark(wanted)
        found = [number for number, header in enumerate(headers) if _plain(header.text) == _plain(wanted)]
        if not found:  # without the unit, which may be in one of both only
            own = _plain(header_of(wanted).name)
            found = [number for number, header in enumerate(headers) if own == _plain(header.name) != ""]
        if not found:
            unused = f"; {self.table.unused}" if self.table.unused else ""
            raise self._refusal(f'has no column "{wanted}" for {kind}: it has {self._listed()}{unused}')
        if len(found) > 1 and not self._are_equal(found):
            numbers = ", ".join(str(number + 1) for number in found)
            raise self._refusal(f'has several columns "{wanted}": give {kind} by number, one of {numbers}')
        return found[0]

    def _are_equal(self, numbers: list[int], *, but_for_a_constant: bool = False) -> bool:
        """Tell columns with the same values; a constant between them may be left out."""
        values = self.table.values[:, numbers]
        values = values[~np.isnan(values).any(axis=1)]
        if not len(values):
            return False
        first, off = values[:, 0], values - values[:, :1]
        apart = np.ptp(off, axis=0) if but_for_a_constant else np.abs(off).max(axis=0)
        return bool(apart.max() <= _SAME * np.ptp(first))

    def _candidates(self, kind: str) -> list[int]:
        """Return the columns that can be depth, force or time: those called so, else those of such a unit."""
        called, of_kind = [], []
        for number, header in enumerate(self.table.headers):
            unit, is_called = self._unit(number, kind), header.is_called(kind)
            is_of_kind = is_unit_of(unit, UNITS[kind]) and (is_called or not is_mass(unit))
            is_of_kind &= not (kind == "depth" and header.is_called("deflection"))
            if self._is_full(number) and (is_of_kind or (is_called and not unit)):
                of_kind += [number] if is_of_kind else []
                called += [number] if is_called else []
        return sorted(called, key=lambda number: number not in of_kind) or of_kind

    def _found(self, kind: str) -> int:
        """Return the column that is unmistakably depth or force."""
        found = self._candidates(kind)
        titles = [f"`{self._title(number)}`" for number in found]
        if found and self._are_equal(found, but_for_a_constant=kind == "force"):
            same = f"; {', '.join(titles[1:])} differs by no more than a constant" if titles[1:] else ""
            self.notes.append(f"{kind} is column {titles[0]}{same}")
            return found[0]
        what = f"could be {', '.join(titles)}" if found else "is not found"
        columns, units = self._likely()
        columns = columns if "spring" in columns else {"depth": "…", "force": "…"} | columns
        remedy = f"columns = {_inline(columns)}" + (f" and units = {_inline(units)}" if units else "")
        why = "; ".join([f"write in [[measurement]] {remedy}", *self._reasons(kind)])
        raise self._refusal(f"{kind} {what} among {self._listed()}: {why}")

    def _reasons(self, kind: str) -> list[str]:
        """Return why columns that are called so are none: they have text or nothing, or a unit of another kind."""
        reasons = [self.table.unused] if self.table.unused else []
        for number, header in enumerate(self.table.headers):
            title, unit, is_called = self._title(number), self._unit(number, kind), header.is_called(kind)
            if number in self.table.strange:
                line, text = self.table.strange[number]
                reasons.append(f'`{title}` has text, "{text}" in line {line}')
            elif is_called and not self._is_full(number):
                reasons.append(f"`{title}` has no values")
            elif is_called and unit and not is_unit_of(unit, UNITS[kind]):
                reasons.append(f"`{title}` has the unit {unit}, no unit of {_KINDS[UNITS[kind]]}")
        if any(header.is_called("deflection") and is_unit_of(header.unit, "m") for header in self.table.headers):
            reasons.append("if the force is the deflection of a spring, name piezo, deflection and spring")
        return reasons

    def _time(self, taken: set[int]) -> int | None:
        """Return the only column that is called time, or has a unit of time; None if there is none, or several."""
        for number, (line, text) in self.table.strange.items():
            if self.table.headers[number].is_called("time"):
                title = self._title(number)
                self.notes.append(f'column `{title}` has text, "{text}" in line {line}, and is not read as time')
        found = []
        for number in self._candidates("time"):
            if number not in taken and self._unit(number, "time"):
                found.append(number)
            elif number not in taken:
                title = self._title(number)
                self.notes.append(f"column `{title}` has no unit, and is not read as time: give it in units")
        if len(found) > 1:
            titles = ", ".join(map(self._title, found))
            self.notes.append(f"time could be {titles}: not read; name it in columns")
        if len(found) != 1:
            return None
        self.notes.append(f"time is column `{self._title(found[0])}`")
        return found[0]

    def _is_full(self, number: int) -> bool:
        return not bool(np.isnan(self.table.values[:, number]).all())

    def _units(self, number: int, kind: str) -> dict[str, str]:
        """Return the units of a column as text, by where they are: in the header, the study's name of it, `units`."""
        wanted = self.reading.columns.get(kind)
        named = header_of(wanted).unit if isinstance(wanted, str) else ""
        found = {
            "": self.table.headers[number].unit,
            f'columns.{kind} is "{wanted}"': named,
            f'units.{kind} is "{self.reading.units.get(kind)}"': self.reading.units.get(kind, ""),
        }
        return {place: unit for place, unit in found.items() if unit}

    def _unit(self, number: int, kind: str) -> str:
        return next(iter(self._units(number, kind).values()), "")

    def _in_si(self, number: int, kind: str) -> FloatArray:
        """Return a column in SI units."""
        si = UNITS[kind]
        if number in self.table.strange:
            line, text = self.table.strange[number]
            raise self._refusal(f'"{text}" is no number (for {kind}): correct or remove it', number, line)
        if not self._is_full(number):
            raise self._refusal(f"has no values (for {kind})", number)
        units = self._units(number, kind)
        if not units:
            remedy = f'write units = {{{kind} = "{_EXAMPLES[si]}"}} in [[measurement]]'
            raise self._refusal(f"has no unit: {remedy}", number)
        unit = self._unit(number, kind)
        try:
            factor = factor_of(unit, si)
        except ValueError as error:
            message = getattr(error, "message", error.__str__)()
            raise self._refusal(f"cannot be {kind}: {message}", number) from None
        for place, other in units.items():
            if is_unit_of(other, si) and not np.isclose(factor_of(other, si), factor, rtol=1e-9):
                raise self._refusal(f"has the unit {unit}, but {place}: remove the wrong one", number)
        if is_mass(unit):
            self.notes.append(f"{kind} is the weight of a mass: 1 {unit} is {factor:.6g} N")
        return self.table.values[:, number] * factor


def _inline(keys: dict[str, str]) -> str:
    return f"{{{', '.join(f'{key} = {value}' for key, value in keys.items())}}}"


def _plain(text: str) -> str:
    return " ".join(text.casefold().split())


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _without_missing(found: Recorded) -> Recorded:
    """Return the rows that have all values, with times from the first of them on."""
    missing = np.isnan(found.depth) | np.isnan(found.force)
    if found.time is not None:
        missing |= np.isnan(found.time)
    if missing.all():
        raise ExperimentError(found.file, "has no row with depth and force")
    kept = found.part(np.flatnonzero(~missing))
    if kept.time is not None and np.ptp(kept.time) == 0:
        kept = replace(kept, time=None).noting(f"time never changes (column `{kept.names['time']}`): not read")
    if kept.time is not None:
        kept = replace(kept, time=kept.time - kept.time[0], began=float(kept.time[0]))
    if count := int(missing.sum()):
        first = int(found.lines[np.argmax(missing)])
        kept = kept.noting(f"{count} rows without all values, the first in line {first}: left out")
    return kept
