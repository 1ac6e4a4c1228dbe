"""The inputs of a study with what is known of their uncertainty, and what that does to F."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.report.influence import SPREAD
from epsmesh.report.uncertainty import IMAGE, NAME, bars
from epsmesh.report.values import answer_of, at_peak
from epsmesh.report.words import percent
from epsmesh.shapes.segmented import is_uncertain
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study

_SECTIONS = ("body", "material", "probe", "load")
# Keys that are no measured quantities.
_NAMES = {
    "name",
    "names",
    "shape",
    "file",
    "unit",
    "from",
    "steps",
    "action",
    "direction",
    "axis",
    "table",
    "at",
    "path",
}
_NAMES |= {"spread", "boundary_uncertainty"}  # uncertainties of others
_DIGIT = re.compile(r"\d")
# Of a table of an array of sections: what is swept in all of them has no number.
_NUMBER = re.compile(r"^(\w+)\[\d+\]")
_MOST = 24
# With these, F is not in proportion to the one modulus of a body.
_OTHER_FORCES = {"loads", "terms", "capsule", "given force"}


def inputs(dataset: xr.Dataset, study: Study, cases: Sequence[Case]) -> list[list[str]]:
    """Return the inputs: names with values, what is known of their uncertainty, and what it does to F."""
    sizes = dict.fromkeys((NAME, SPREAD, IMAGE), "not computed") | {one.name: f"F {one.size}" for one in bars(dataset)}
    rows = [[axis.path, swept, change] for axis, swept, change in _swept(dataset, study)]
    found = study.identified
    if found.unknown:
        known = [
            f"{name} {value:.4g}, 95 % from {low:.4g} to {high:.4g}"
            for name, value, low, high in zip(found.unknown, found.estimate, found.low, found.high, strict=True)
        ]
        rows.append(["tissue, identified (SI units)", f"{'; '.join(known)} ({found.file})", sizes[NAME]])
    if spread := dict.fromkeys(str(tissue.spread) for case in cases for tissue in case.tissues if tissue.spread):
        rows.append(["young, from place to place", "; ".join(spread), sizes[SPREAD]])
    if any(is_uncertain(case.body) for case in cases):
        rows.append(["boundary of the body in its image", "given in the study", sizes[IMAGE]])
    rest = [f"{name} = {value}" for name, value in values(study)]
    if rest:
        listed = "; ".join(rest[:_MOST]) + (f"; and {len(rest) - _MOST} more" if len(rest) > _MOST else "")
        rows.append([listed, "none stated", f"not known{_of_young(study, cases, rest)}"])
    return rows


def values(study: Study) -> Iterator[tuple[str, str]]:
    """Yield the quantities of a study that are neither swept nor identified: places in its file, and values there."""
    swept = {axis.path for axis in study.axes if axis.key}
    identified = {*map(repr, study.identified.estimate)}

    def within(place: str, value: Any) -> Iterator[tuple[str, str]]:
        if _NUMBER.sub(r"\1", place) in swept or str(value).partition(" ")[0] in identified:
            return
        if isinstance(value, Mapping):
            for key, inner in value.items():
                if key not in _NAMES:
                    yield from within(f"{place}.{key}", inner)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for number, inner in enumerate(value, start=1):
                yield from within(f"{place}[{number}]", inner)
        elif not isinstance(value, bool) and _DIGIT.search(str(value)):
            yield place, " × ".join(map(str, value)) if isinstance(value, list) else str(value)

    for section in _SECTIONS:
        yield from within(section, study.raw.get(section, {}))


def _swept(dataset: xr.Dataset, study: Study) -> Iterator[tuple[Any, str, str]]:
    """Yield the swept inputs of the scene: axis, its values, and the largest relative change of the answer by it."""
    answer = at_peak(dataset)[answer_of(dataset)]
    for axis in study.axes:
        if axis.section not in _SECTIONS or axis.is_stage or axis.off or axis.name not in answer.dims:
            continue
        ends = [axis.write(axis.labels[0]), axis.write(axis.labels[-1])]
        word = f"swept, {len(axis)} values" if isinstance(axis.labels[0], str) else f"swept, {' to '.join(ends)}"
        low, high = answer.min(axis.name), answer.max(axis.name)
        change = (high - low) / abs(high + low) * 2
        known = change.values[np.isfinite(change.values)]
        of = "F" if answer.name == "force" else "the depth"
        yield axis, word, f"{of} changes by up to {percent(float(known.max()))}" if known.size else "not known"


def _of_young(study: Study, cases: Sequence[Case], rest: Sequence[str]) -> str:
    """Say that F is in proportion to the modulus, if it is and nothing is known of it."""
    alone = not study.is_insertion and all(
        len(case.tissues) == 1 and not _OTHER_FORCES & case.features for case in cases
    )
    return "; F is in proportion to E" if alone and any(line.startswith("material.young") for line in rest) else ""
