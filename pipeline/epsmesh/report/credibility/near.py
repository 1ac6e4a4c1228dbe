"""What is nearest to a study's scenes among the program's comparisons: with known forces, and with measurements.

``verification.csv`` has those with known forces (`python -m tests.verification --table` writes it), and
:mod:`epsmesh.report.validation` those with measurements and other programs. Each is named with how far it is: words of
the scene that differ, and ratios of numbers.
"""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import inf, log, nan
from pathlib import Path
from typing import Any, Self

import numpy as np
import xarray as xr

from epsmesh.report.validation import Comparison, comparisons
from epsmesh.report.values import at_peak, by_case
from epsmesh.report.words import barred, percent
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.probe import Probe
from epsmesh.study.case import Case
from epsmesh.study.plausible import size_of
from epsmesh.study.sweep import Study
from epsmesh.study.way import LINEAR

Range = tuple[float, float]
Row = Mapping[str, Any]
# What a scene is compared by, and features besides that change the physics.
WORDS = ("law", "contact", "body", "tool")
FURTHER = (
    "layers", "inclusion", "region", "fibres", "varying stiffness", "capsule", "loads", "terms", "unloaded shape",
    "history", "slit", "insertion", "rounded edge", "six motions",
)  # fmt: skip
# Numbers of a scene: symbols, and the units that people read, the largest first.
_PURE = ((1.0, ""),)
_NUMBERS: dict[str, tuple[str, tuple[tuple[float, str], ...]]] = {
    "depth": ("d/a", _PURE),
    "size": ("a/h", _PURE),
    "poisson": ("ν", _PURE),
    "young": ("E", ((1e6, " MPa"), (1e3, " kPa"), (1.0, " Pa"))),
    "force": ("F", ((1.0, " N"), (1e-3, " mN"), (1e-6, " µN"))),
}
# What makes a comparison nearer: numbers without a unit, up to a largest factor. Rounding of ratios.
_NEARER, _FARTHEST, _SAME = ("depth", "size"), 100.0, 1e-6
# Contacts in the words of comparisons.
_CONTACTS = {"unilateral": "frictionless", "unilateral, friction": "friction"}
# Scenes of a study that are looked at; rows that are shown of each kind of scene, and in all; comparisons shown.
_MOST_SCENES, _OF_KIND, _MOST_ROWS, _MEASURED = 200, 4, 8, 4


@dataclass(frozen=True)
class Kind:
    """A kind of scene. A word is "" where a comparison is of elements or of a section."""

    law: str = ""
    contact: str = ""
    body: str = ""
    tool: str = ""
    further: tuple[str, ...] = ()

    @classmethod
    def of(cls, study: Study, case: Case) -> Self:
        """Return the kind of a case; of an insertion, that of the tool that is inserted."""
        tool = study.tool(case)
        has = replace(case, probe=tool).features
        contact = f"{tool.contact}, friction" if tool.friction > 0 else tool.contact
        laws = sorted({tissue.law or LINEAR[0] for tissue in case.tissues})
        return cls("+".join(laws), contact, case.body.shape, tool.shape, tuple(name for name in FURTHER if name in has))

    @classmethod
    def of_row(cls, row: Row) -> Self:
        """Return the kind of a row of the table."""
        law, contact, body, tool = (str(row[word]) for word in WORDS)
        return cls(law, contact, body, tool, tuple(filter(None, row["further"].split("; "))))

    def lacks(self, other: "Kind") -> list[str]:
        """Return the features that another kind has, and this one has not."""
        return [name for name in other.further if name not in self.further]

    def distance(self, other: "Kind") -> tuple[float, int]:
        """Return how many words and features another kind lacks, and how many features it has besides.

        A word that the other kind has none of counts half.
        """
        words = ((getattr(self, word), getattr(other, word)) for word in WORDS)
        differing = sum((1.0 if there else 0.5) for here, there in words if here != there)
        return differing + len(other.lacks(self)), len(self.lacks(other))


def scenes(study: Study) -> list[Case]:
    """Return the first case of each scene of a study, of very many some that are evenly spaced."""
    found = {study.scene(index): index for index in reversed([*study.indices()])}
    cases = [case for index in sorted(found.values()) if not (case := study.case(index)).no_contact]
    chosen = np.linspace(0, len(cases) - 1, min(len(cases), _MOST_SCENES)).round().astype(int)
    return [cases[number] for number in chosen]


def kinds(study: Study, cases: Sequence[Case]) -> list[Kind]:
    """Return the kinds of some cases, the most frequent first."""
    return [kind for kind, _ in Counter(Kind.of(study, case) for case in cases).most_common()]


def numbers(dataset: xr.Dataset, study: Study, cases: Sequence[Case]) -> dict[str, Range]:
    """Return the ranges of the numbers of scenes, as a comparison has them: d/a, a/h, ν, E (Pa) and F (N).

    a is the radius of contact, half the width or length of a flat or an inserted tool; h is the thickness of the body
    below the tool or its largest distance from the tool's axis, whichever is smaller.
    """
    found: dict[str, list[float]] = {name: [] for name in _NUMBERS}
    for case in cases:
        tool = study.tool(case)
        radius = _radius(dataset, case, tool)
        found["depth"].append(tool.deepest / radius)
        found["size"].append(radius / _extent(case, tool))
        found["poisson"] += [tissue.poisson for tissue in case.tissues]
        found["young"] += [tissue.young for tissue in case.tissues]
    found["force"] = [float(force) for force in abs(dataset["force"]).values.ravel()]
    known = {name: [value for value in values if np.isfinite(value)] for name, values in found.items()}
    return {name: (min(values), max(values)) for name, values in known.items() if values}


def _radius(dataset: xr.Dataset, case: Case, tool: Probe) -> float:
    """Return the radius of contact (m) of a case; NaN if it was to be found and is not known."""
    if tool.is_flat or getattr(tool, "is_inserted", False):
        return size_of(tool)
    if "contact_radius" not in dataset:
        return nan
    index = tuple(number for number, axis in zip(case.index, case.axes, strict=True) if not axis.is_stage)
    return float(by_case(at_peak(dataset), "contact_radius").values[index]) or nan


def _extent(case: Case, tool: Probe) -> float:
    try:
        frame = tool.frame_on(case.body)
        return min(case.body.thickness(frame), case.body.reach(frame))
    except PlaceError:
        return nan


def said(here: Mapping[str, Range]) -> str:
    """Write the numbers of scenes."""
    return ", ".join(f"{_NUMBERS[name][0]} = {_written(name, ends)}" for name, ends in here.items())


# ---- known forces -----------------------------------------------------------------------------------


@cache
def verification() -> tuple[list[str], list[tuple[Kind, Row]]]:
    """Return what made the table of comparisons with known forces, and its rows."""
    lines = (Path(__file__).parent / "verification.csv").read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [line[2:] for line in lines if line.startswith("#")], [(Kind.of_row(row), row) for row in rows]


def near(found: Sequence[Kind]) -> list[tuple[Kind, Kind, Row]]:
    """Return the rows nearest to kinds of scenes, the nearest of each kind first: kind, that of the row, row."""
    each = max(1, min(_OF_KIND, _MOST_ROWS // max(1, len(found))))
    of_scenes = [row for row in verification()[1] if row[0].law]
    nearest = []
    for kind in found[:_MOST_ROWS]:
        of_kind = sorted(of_scenes, key=partial(_distance, kind))[:each]
        nearest += [(kind, *row) for row in of_kind]
    return nearest


def _distance(kind: Kind, row: tuple[Kind, Row]) -> tuple[float, int]:
    return kind.distance(row[0])


def verified(found: Sequence[Kind]) -> list[list[str]]:
    """Return the rows nearest to kinds of scenes in words: scene, in what it differs, error, bar, source."""
    lines = dict[str, list[str]]()
    for kind, other, row in near(found):
        reference, value = float(row["reference"]), float(row["value"])
        error = abs(value / reference - 1) if reference else abs(value)
        scene = f"{row['scene']} ({row['path']})"
        cells = [scene, differs(kind, other), percent(error), percent(float(row["bar"])), row["source"]]
        lines.setdefault(scene, cells)
    return [*lines.values()]


def differs(kind: Kind, other: Kind) -> str:
    """Say in what another kind differs from a kind of scene."""
    unlike = (word for word in WORDS if getattr(kind, word) != getattr(other, word))
    words = [f"{word}: {there}" if (there := getattr(other, word)) else f"no {word}" for word in unlike]
    words += [f"without {name}" for name in other.lacks(kind)] + [f"with {name}" for name in kind.lacks(other)]
    return "; ".join(words) or "nothing"


# ---- other programs and measurements -------------------------------------------------------------------


def compared() -> list[Comparison]:
    """Return the comparisons with measurements and other programs; those with theory are in the table above."""
    return [one for one in comparisons() if one.kind != "theory"]


def factor(here: Range, there: Range) -> float:
    """Return by which factor the farther end of a range is outside another one; 1 if it is within."""
    if there[0] <= here[0] and here[1] <= there[1]:
        return 1.0
    return max(here[1] / there[1], there[0] / here[0]) if here[0] > 0 and there[1] > 0 else inf


def distance(kind: Kind, here: Mapping[str, Range], one: Comparison) -> float:
    """Return how far a comparison is: 1 for each word or feature that differs, and logarithms of ratios of numbers."""
    there = _there(one)
    known = (min(factor(here[name], there[name]), _FARTHEST) for name in _NEARER if name in here)
    return len(_unlike(kind, one)) + len(kind.further) + sum(map(log, known))


def measured(kind: Kind, here: Mapping[str, Range]) -> list[Comparison]:
    """Return the comparisons that are nearest to a kind of scene with these numbers."""
    return sorted(compared(), key=lambda one: distance(kind, here, one))[:_MEASURED]


def far(kind: Kind, here: Mapping[str, Range], one: Comparison) -> str:
    """Say how far a comparison is from scenes: words that differ, then numbers there with their ratios."""
    words = [*_unlike(kind, one), *(f"without {name}" for name in kind.further)]
    for name, ends in _there(one).items():
        if name in here:
            words.append(f"{_NUMBERS[name][0]} there {_written(name, ends)} ({_ratio(name, here[name], ends)})")
    return "; ".join(words)


def result(one: Comparison) -> str:
    """Say what a comparison found."""
    ours, reference = (barred(*pair) for pair in ((one.ours, one.ours_bar), (one.reference, one.reference_bar)))
    verdict = "agree within their bars" if one.agrees else f"differ by more than their bars. {one.note}"
    more = "more" if one.difference > 0 else "less"
    return f"{one.compared}: {ours}, source {reference} ({percent(abs(one.difference))} {more}); {verdict}"


def evidence(one: Comparison) -> str:
    """Say what kind of evidence a comparison is, and where it is from."""
    kinds = {"experiment": f"bench test; calibrated: {one.calibrated}", "benchmark": "another program"}
    return f"{kinds[one.kind]}; {one.source}"


def _unlike(kind: Kind, one: Comparison) -> list[str]:
    there = {"law": one.scene.law, "contact": one.scene.contact, "tool": one.scene.tool}
    own = {"law": kind.law, "contact": _CONTACTS.get(kind.contact, kind.contact), "tool": kind.tool}
    return [f"{name}: {word}" for name, word in there.items() if word != own[name]]


def _there(one: Comparison) -> dict[str, Range]:
    """Return the numbers of a comparison that are known."""
    scene, given = one.scene, one.given
    found = {"depth": (scene.depth,) * 2, "size": (scene.size,) * 2, "poisson": (scene.poisson,) * 2}
    if "young" in given:
        found["young"] = given["young"] - given["young_bar"], given["young"] + given["young_bar"]
        found["force"] = given["low"], given["high"]
    return found


def _ratio(name: str, here: Range, there: Range) -> str:
    if name == "poisson":
        off = max(here[1] - there[1], there[0] - here[0])
        return f"off by {off:.2g}" if off > _SAME else "the same"
    ratio = factor(here, there)
    if ratio < 1 + _SAME:
        return "within"
    digits = 3 if ratio < 2 else 2
    return f"off by a factor of {float(f'{ratio:.{digits}g}'):g}" if ratio < inf else "a half-space"


def _written(name: str, ends: Range) -> str:
    units = _NUMBERS[name][1]
    scale, unit = next((one for one in units if ends[1] >= one[0]), units[-1])
    return f"{' to '.join(dict.fromkeys(f'{end / scale:.3g}' for end in ends))}{unit}"
