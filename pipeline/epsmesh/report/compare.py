"""Two datasets case by case: do their forces agree within the error bars, and which of them took longer?

Cases are matched by what they are, the values of the study's keys, not by their places in the arrays or the names of
tables. What a case is held to is its scene: bodies, materials, probes, loads, and how much of the body is kept. Element
sizes, degrees and ε, as long as all of the body is there, only tell how well it is computed: these may differ.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf, isfinite, nan
from statistics import median
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.printable import counted
from epsmesh.quantities import quantity_of, write
from epsmesh.report.parameters import Parameters, differing, parameters_of, units_of, varied
from epsmesh.report.study import DatasetError, study_of
from epsmesh.report.values import at_peak
from epsmesh.report.words import barred
from epsmesh.states import OK, PENDING, SKIPPED

# Forces that agree to this share of them agree, whatever their bars: the tolerance of solvers.
SAME = 1e-6
# Keys that a message names where scenes differ.
_MOST_KEYS = 4
# What is compared: each has an error bar.
_JUDGED = ("force", "depth", "load_force", "energy_release")


@dataclass(frozen=True)
class Pair:
    """One case in both datasets.

    ``a`` and ``b`` are the values of ``quantity`` (SI), ``bar_a`` and ``bar_b`` their error bars (same unit), ``times``
    what it took in B over what it took in A. ``state`` is "agree", "differ", or "open" where one cannot tell: ``why``.
    """

    case: str
    quantity: str
    a: float
    b: float
    bar_a: float
    bar_b: float
    times: float
    state: str
    why: str = ""

    @property
    def difference(self) -> float:
        """B less A, relative to A."""
        return (self.b - self.a) / abs(self.a) if self.a else nan

    @property
    def bars(self) -> float:
        """Both error bars together, relative to A."""
        return (self.bar_a + self.bar_b) / abs(self.a) if self.a else nan


@dataclass(frozen=True)
class Comparison:
    """What came of it: all pairs of cases that were compared, and those that were not, by reason.

    ``again_a`` and ``again_b`` count cases that are others again, such as the full order for every outside.
    ``settings`` are the keys that are not of the scene and differ: key, value in A, value in B.
    """

    pairs: tuple[Pair, ...]
    cases: int
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    again_a: int
    again_b: int
    not_compared: tuple[tuple[str, str], ...]
    settings: tuple[tuple[str, Any, Any], ...]

    @property
    def compared(self) -> int:
        """How many cases were compared."""
        return self.cases - len(self.not_compared)

    @property
    def agrees(self) -> bool:
        """Whether every pair that was compared agrees within its error bars."""
        return all(pair.state == "agree" for pair in self.pairs)

    @property
    def apart(self) -> tuple[Pair, ...]:
        """The pairs that do not agree, the worst first."""
        found = [pair for pair in self.pairs if pair.state != "agree"]
        return tuple(sorted(found, key=lambda pair: -abs(pair.difference) if isfinite(pair.difference) else -np.inf))

    @property
    def times(self) -> tuple[float, float, float] | None:
        """Median, smallest and largest of the times in B over those in A; None if there are none."""
        found = [pair.times for pair in self.pairs if pair.quantity == "force" and isfinite(pair.times)]
        return (median(found), min(found), max(found)) if found else None


def compare(a: xr.Dataset, b: xr.Dataset) -> Comparison:
    """Compare the cases that two datasets have in common.

    Raises:
        DatasetError: if they are not of the same scenes, or have no case in common.
    """
    a, b = at_peak(a), at_peak(b)
    alike = a.attrs.get("study") == b.attrs.get("study")
    ours, theirs = _cases(a, "A", alike=alike), _cases(b, "B", alike=alike)
    scene, settings = differing([one.parameters for one in ours], [one.parameters for one in theirs])
    if scene:
        raise DatasetError(
            f"they are of different scenes: {_differences(scene, _units(a) | _units(b))}{_between(a, b)}"
        )
    keys = varied([one.parameters for one in ours], [one.parameters for one in theirs])
    left, right = _by_values(ours, keys), _by_values(theirs, keys)
    common = [values for values in left if values in right]
    if not common:
        raise DatasetError(f"they have no case in common: {_apart(left, right, keys)}")
    found, not_compared = list[Pair](), list[tuple[str, str]]()
    for values in common:
        one, other = left[values], right[values]
        if why := _not_run(a, one.index, b, other.index):
            not_compared.append((one.words, why))
        else:
            found += _pairs(one.words, a, one.index, b, other.index)
    if not found:
        reasons = "; ".join(dict.fromkeys(why for _, why in not_compared))
        raise DatasetError(f"none of the {len(common)} cases that they have in common can be compared: {reasons}")
    return Comparison(
        pairs=tuple(found),
        cases=len(common),
        only_a=tuple(case.words for values, case in left.items() if values not in right),
        only_b=tuple(case.words for values, case in right.items() if values not in left),
        again_a=len(ours) - len(left),
        again_b=len(theirs) - len(right),
        not_compared=tuple(not_compared),
        settings=tuple(settings),
    )


@dataclass(frozen=True)
class _Place:
    """A case of a dataset: what it is, its name, and where its values stand."""

    parameters: Parameters
    words: str
    index: tuple[int, ...]


def _cases(dataset: xr.Dataset, name: str, *, alike: bool) -> list[_Place]:
    """Return the cases of a dataset.

    Of two that are ``alike``, of one study, labels alone tell them apart, even if the study's files are not at hand.
    """
    sizes = {str(dim): length for dim, length in dataset["force"].sizes.items()}
    study = study_of(dataset)
    if study is None and not alike:
        raise DatasetError(f"{name} holds no study that can be read here, which tells what its cases are")
    if study is None:
        labels = {dim: [str(value) for value in dataset[dim].values] for dim in sizes}
        named = [{dim: labels[dim][i] for dim, i in zip(sizes, at, strict=True)} for at in np.ndindex(*sizes.values())]
        places = zip(named, np.ndindex(*sizes.values()), strict=True)
        return [_Place(one, ", ".join(f"{k} = {v}" for k, v in one.items()), index) for one, index in places]
    if {axis.name: len(axis) for axis in study.axes if not axis.is_stage} != sizes:
        raise DatasetError(f"{name} is part of a dataset, or of another study than it says: compare whole ones")
    return [_Place(parameters_of(case, study.tool(case)), case.whole, index) for index, case in study.whole_cases()]


def _between(a: xr.Dataset, b: xr.Dataset) -> str:
    """Return the forces of two datasets of one case each, and their difference, in words; "" of others."""
    if not a["force"].size == b["force"].size == 1:
        return ""
    (one, bar), (other, other_bar) = ([1e3 * each[name].item() for name in ("force", "force_error")] for each in (a, b))
    if not all(map(isfinite, (one, other, bar, other_bar))):
        return ""
    return (
        f". F is {one:.5g} mN in A, {other:.5g} mN in B: B less A is {barred(other - one, bar + other_bar, 'mN')}, "
        "with both error bars"
    )


def _units(dataset: xr.Dataset) -> dict[str, str]:
    """Return the units of the keys of its study; those that differ between studies are in each of its cases."""
    study = study_of(dataset)
    case = next(iter(study.cases())) if study else None
    return units_of(case, study.tool(case)) if study and case else {}


def _differences(scene: list[tuple[str, Any, Any]], units: dict[str, str]) -> str:
    """Return in words where two scenes differ: a few keys, those first that both have."""
    both = sorted(scene, key=lambda row: row[1] is None or row[2] is None)
    shown = [
        f"{key} is {worded(key, one, units.get(key))} in A, {worded(key, other, units.get(key))} in B"
        for key, one, other in both[:_MOST_KEYS]
    ]
    more = len(both) - _MOST_KEYS
    return "; ".join([*shown, *([f"and {counted(more, 'more key')}"] if more > 0 else [])])


def worded(key: str, value: Any, unit: str | None = None) -> str:
    """Write the value of a key as people read it, with its SI ``unit``; "missing" where a study has no such key."""
    if value in (None, ()):
        return "missing"
    name = key.rpartition(".")[2]
    if value == inf and name in ("fine", "coarse"):
        return "chosen by the program"
    if unit and isinstance(value, tuple):
        return ", ".join(worded(key, one, unit) for one in value)
    return write(name, value, unit) if unit or quantity_of(name) else str(value)


def _by_values(cases: list[_Place], keys: list[str]) -> dict[tuple[Any, ...], _Place]:
    """Return cases by their values of ``keys``; the full order, the same for every outside, stands there once."""
    found: dict[tuple[Any, ...], _Place] = {}
    for case in cases:
        found.setdefault(tuple(case.parameters.get(key) for key in keys), case)
    return found


def _apart(left: Iterable[Any], right: Iterable[Any], keys: list[str]) -> str:
    """Say in which keys no value of one is a value of the other."""
    columns = zip(keys, zip(*left, strict=True), zip(*right, strict=True), strict=True)
    found = [key for key, ours, theirs in columns if not set(ours) & set(theirs)]
    return f"no value of {', '.join(found)} is in both" if found else f"they differ in {', '.join(keys)} together"


def _not_run(a: xr.Dataset, i: tuple[int, ...], b: xr.Dataset, j: tuple[int, ...]) -> str:
    """Return why a case has nothing to compare, or nothing."""
    states = [_text(data, "status", at) for data, at in ((a, i), (b, j))]
    for name, state in zip("AB", states, strict=True):
        if state in (PENDING, SKIPPED):
            return f"{state} in {name}"
    return f"{states[0]} in both" if states[0] == states[1] != OK else ""


def _pairs(case: str, a: xr.Dataset, i: tuple[int, ...], b: xr.Dataset, j: tuple[int, ...]) -> Iterator[Pair]:
    """Yield what is compared of one case."""
    for quantity in _JUDGED:
        if not all(quantity in data and f"{quantity}_error" in data for data in (a, b)):
            continue
        (one, bar_a, time_a), (other, bar_b, time_b) = (
            [_number(data, name, at) for name in (quantity, f"{quantity}_error", "time_total")]
            for data, at in ((a, i), (b, j))
        )
        states = [_text(data, "status", at) for data, at in ((a, i), (b, j))]
        state, why = _judge(one, other, bar_a, bar_b, states)
        if quantity != "force" and not (isfinite(one) or isfinite(other)):
            continue  # of cases that have none
        yield Pair(case, quantity, one, other, bar_a, bar_b, time_b / time_a if time_a else nan, state, why)
        if states != ["ok", "ok"]:
            return


def _judge(one: float, other: float, bar_a: float, bar_b: float, states: list[str]) -> tuple[str, str]:
    """Return whether two values agree, and why that is not known."""
    if states != ["ok", "ok"]:
        return "differ", f"{states[0]} in A, {states[1]} in B"
    if not (isfinite(one) and isfinite(other)):
        return "open", f"no value in {'A' if not isfinite(one) else 'B'}"
    if abs(other - one) <= SAME * abs(one):
        return "agree", ""
    if not (bar_a >= 0 and bar_b >= 0):
        return "open", f"no error bar in {'B' if bar_a >= 0 else 'A'}"
    return ("agree", "") if abs(other - one) <= bar_a + bar_b else ("differ", "")


def _number(dataset: xr.Dataset, name: str, at: tuple[int, ...]) -> float:
    return float(dataset[name].values[at]) if name in dataset else nan


def _text(dataset: xr.Dataset, name: str, at: tuple[int, ...]) -> str:
    return str(dataset[name].values[at])
