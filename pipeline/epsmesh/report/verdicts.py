"""Mesh settings judged over the scenes of a dataset: worst error, what limits it, what it costs, which to choose."""

import itertools
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, isinf, nan
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr

from epsmesh.quantities import MESH_DIMENSIONS
from epsmesh.report import laws
from epsmesh.report.laws import Codes, Correction, Forces, Laws, groups_without
from epsmesh.report.sinking import LOADS, PLACES, Sinking, tools
from epsmesh.report.study import DatasetError, Labels, case_at, plain, study_of
from epsmesh.report.values import elastic, has_path, relative
from epsmesh.states import OK, PENDING
from epsmesh.study.sweep import Study

# What is judged: F as it stands, after division by an r taken from other scenes, or by the best law for other tools.
Judged = Literal["force", "ratio", "tools"]
# What F is compared with, by its name: the variable of the dataset.
EXACT, MAX = "F_exact", "F_max"
_VARIABLES = {EXACT: "force_exact", MAX: "force_max"}
# Columns of the cells, and the variables of the dataset that they are.
_NUMBERS = {"force": "force", "share": "force_ratio", "seconds": "time_total", "dofs": "dofs", "cells": "cells"}
# What is known of a mesh: keys of the study file; a rim left to the program is None.
_SIZES = ("fine", "coarse", "rim", "growth", "degree", "element")


@dataclass(frozen=True, eq=False)
class Cells:
    """The cases of a dataset: mesh settings × scenes.

    ``frame`` has a row for each, scene by scene of each setting, with the scene's number as its index: why it cannot be
    judged, "" if it can, and numbers, NaN where there is a reason. ``exact`` is the force that F is compared with, by
    its name ``reference``: "F_exact", or "F_max" of a dataset without it. ``ratio`` is F over it and ``bar`` what the
    error bars of both add to its distance from 1, ``force_bar`` and ``exact_bar`` are those relative bars, 0 beside
    F_max, which has the same elements; ``share`` is F/F_max; ``seconds`` what a case costs alone, ``dofs`` and
    ``cells`` those of the whole body.

    ``settings`` and ``scenes`` are their labels, ``meshes`` the elements of each setting. ``codes`` has the position of
    each scene's label of each parameter, ``sinking`` what is known of each scene's tool. ``tools`` are the parameters
    that make a tool what it is, ``loads`` those that only say how far it moves; ``described`` are the tools in whose
    scenes compliances add.
    """

    frame: pd.DataFrame
    reference: str
    settings: Sequence[Labels]
    meshes: Sequence[Labels]
    scenes: Sequence[Labels]
    codes: Codes
    sinking: pd.DataFrame
    tools: Sequence[str]
    loads: Sequence[str]
    described: Sequence[str]

    @cached_property
    def covered(self) -> pd.DataFrame:
        """The cells of the scenes that some setting can be judged on: claims leave out the others."""
        is_judged = (self.frame["why"] == "").groupby(level=0).transform("any")
        return self.frame[is_judged]

    @cached_property
    def has_full(self) -> bool:
        """Whether F/F_max is known of a case that can be judged."""
        return bool(self.frame["share"].notna().any())

    def verdicts(self, scenes: Collection[int] | None = None) -> "tuple[Verdict, ...]":
        """Judge every setting, on all scenes that are covered or on those of these numbers."""
        rows = self.covered if scenes is None else self.covered[self.covered.index.isin(scenes)]
        count, size = len(self.settings), len(rows) // len(self.settings)
        return tuple(Verdict(self, n, rows.iloc[n * size : (n + 1) * size]) for n in range(count))


def arrange(dataset: xr.Dataset) -> Cells:
    """Return the cells of ``dataset``.

    Raises:
        DatasetError: if it holds neither F_exact nor F_max.
    """
    dataset = elastic(dataset)
    reference = _reference(dataset)
    dims = [str(dim) for dim in dataset["force"].dims]
    rows, columns = [d for d in dims if d in MESH_DIMENSIONS], [d for d in dims if d not in MESH_DIMENSIONS]
    settings, scenes = _labels(dataset, rows), _labels(dataset, columns)
    keep, study = _distinct(settings), study_of(dataset)

    def column(values: xr.DataArray) -> np.ndarray:
        values = values.broadcast_like(dataset["force"]).transpose(*rows, *columns)
        return np.asarray(values.values.reshape(len(settings), len(scenes))[keep].ravel())

    variables = _NUMBERS | {"exact": _VARIABLES[reference]}
    frame = pd.DataFrame({name: column(dataset[variable]) for name, variable in variables.items()}, dtype=float)
    bar, exact_bar = (column(relative(dataset, f"{name}_error")) for name in ("force", "force_exact"))
    frame["force_bar"], frame["exact_bar"] = (bar, exact_bar) if reference == EXACT else (0.0, 0.0)
    frame["ratio"] = frame["force"] / frame["exact"]
    frame["bar"] = frame["ratio"] * (frame["force_bar"] + frame["exact_bar"])
    status, message = (column(dataset[name]).astype(str) for name in ("status", "message"))
    why = _reasons(status, message, bar, frame["exact"].to_numpy(), reference)
    frame.loc[why != ""] = nan
    frame["why"] = why
    frame.index = np.tile(np.arange(len(scenes)), len(keep))
    counts = np.indices([dataset.sizes[d] for d in columns]).reshape(len(columns), len(scenes))
    cases = [case_at(dataset, study, labels, "mesh") for labels in scenes]
    of_probe = {axis.name for axis in (study.axes if study else ()) if axis.section == "probe"} & {*columns}
    sinking = pd.DataFrame([Sinking.of(case) for case in cases])
    return Cells(
        frame,
        reference,
        [settings[i] for i in keep],
        [_mesh(dataset, study, settings[i]) for i in keep],
        scenes,
        dict(zip(columns, counts, strict=True)),
        sinking,
        tools=sorted(of_probe - LOADS - PLACES),
        loads=sorted(of_probe & LOADS),
        described=tools(case for case, why in zip(cases, sinking["why_not"], strict=True) if case and not why),
    )


@dataclass(frozen=True)
class Spread:
    """Range of F/F_max of one setting over the scenes; ``over`` holds the largest change that one parameter makes."""

    least: float = nan
    most: float = nan
    over: tuple[tuple[str, float], ...] = ()

    @property
    def width(self) -> float:
        """Largest minus smallest."""
        return self.most - self.least

    @property
    def relative(self) -> float:
        """Width over the middle."""
        return 2 * self.width / (self.most + self.least)


class Verdict:
    """What a mesh setting is worth over the scenes.

    ``deviation`` is the worst |F/F_exact - 1|, ``error`` the worst with the error bars; ``limit`` the scene that has
    it, its ``force`` and ``exact`` in N. There ``error`` is the sum of ``distance`` from F_exact, ``force_bar`` and
    ``exact_bar``, all shares of F_exact. ``seconds``, ``dofs`` and ``cells`` are the largest over the scenes, ``usual``
    is the median of the seconds. A setting with ``missing`` scenes is not judged: its errors are those of the rest.
    """

    def __init__(self, cells: Cells, number: int, rows: pd.DataFrame):
        use = (rows["why"] == "").to_numpy()
        self._all, self._scenes = cells, rows.index.to_numpy()[use]
        self._known = known = {str(name): rows[name].to_numpy()[use] for name in rows if name != "why"}
        self.labels, self.mesh, self.missing = cells.settings[number], cells.meshes[number], int((~use).sum())
        self.limit: Labels | None = None
        self.deviation = self.distance = self.error = self.force = self.exact = self.force_bar = self.exact_bar = nan
        self.seconds = self.usual = self.dofs = self.cells = nan
        if not use.any():
            return
        off = np.abs(known["ratio"] - 1)
        worst = int((off + known["bar"]).argmax())
        at = {name: float(values[worst]) for name, values in known.items()}
        self.limit, self.deviation = cells.scenes[self._scenes[worst]], float(off.max())
        self.distance, self.error = float(off[worst]), float(off[worst]) + at["bar"]
        self.force, self.exact = at["force"], at["exact"]
        self.force_bar, self.exact_bar = (at["ratio"] * at[name] for name in ("force_bar", "exact_bar"))
        self.seconds, self.dofs, self.cells = (float(known[name].max()) for name in ("seconds", "dofs", "cells"))
        self.usual = float(np.median(known["seconds"]))

    @property
    def is_judged(self) -> bool:
        """Whether every scene was computed with it."""
        return not self.missing and isfinite(self.error)

    @cached_property
    def spread(self) -> Spread:
        """The range of F/F_max over scenes, of F/F_exact if no F_max is known; by parameter, the others held."""
        share = self._known["share" if self._all.has_full else "ratio"]
        if not share.size or not np.isfinite(share).all():
            return Spread()
        over = tuple((name, _alone(share, groups_without(self._codes, name, share.size))) for name in self._codes)
        return Spread(float(share.min()), float(share.max()), over)

    @cached_property
    def correction(self) -> Correction:
        """One r for all scenes."""
        return laws.correction(self._known["ratio"], self._known["bar"], self._codes)

    @cached_property
    def laws(self) -> Laws:
        """The laws that take F to F_exact."""
        return self._laws("ratio")

    @cached_property
    def laws_of_full(self) -> Laws:
        """Those that take F to F_max, without bars: what they leave is of ε alone, and not of the mesh's elements."""
        return self._laws("share")

    def error_of(self, judged: Judged) -> float:
        """Return the worst error, error bars included; NaN where too few scenes tell."""
        if judged == "tools":
            return self.laws.best.error if self.laws.best else nan
        return self.correction.error if judged == "ratio" else self.error

    @property
    def _codes(self) -> Codes:
        return {name: codes[self._scenes] for name, codes in self._all.codes.items()}

    def _laws(self, of: str) -> Laws:
        """Judge the laws on the scenes whose compliances add."""
        sinking = self._all.sinking.iloc[self._scenes]
        adds = (sinking["why_not"] == "").to_numpy()
        known = {name: values[adds] for name, values in self._known.items()}
        if not np.isfinite(known[of]).all():
            return Laws()
        scale, exponent, square = sinking[["scale", "exponent", "square"]].to_numpy()[adds].T
        bar, exact_bar = ((0.0 if of == "share" else 1.0) * known[name] for name in ("force_bar", "exact_bar"))
        codes = {name: values[adds] for name, values in self._codes.items()}
        forces = Forces(known[of], bar, exact_bar, scale / known["force"], exponent, square)
        return laws.judge(forces, codes, self._all.tools, self._all.loads)


def _alone(share: np.ndarray, group: np.ndarray) -> float:
    """Return the largest range of ``share`` within a group of scenes."""
    low, high = np.full(group.max() + 1, inf), np.full(group.max() + 1, -inf)
    np.minimum.at(low, group, share)
    np.maximum.at(high, group, share)
    return float((high - low).max())


def choose(
    verdicts: Iterable[Verdict], accuracy: float, budget: float = inf, judged: Judged = "force"
) -> Verdict | None:
    """Return the setting to use: with the smallest ε, then the fewest unknowns; for a budget alone, the best."""
    verdicts = tuple(verdicts)
    if not isfinite(accuracy):
        return most_accurate(verdicts, budget, judged)
    keeping = [v for v in verdicts if keeps(v, verdicts, accuracy, judged) and v.seconds <= budget]
    return min(keeping, key=lambda v: (v.mesh.get("epsilon", inf), v.dofs), default=None)


def most_accurate(verdicts: Iterable[Verdict], budget: float = inf, judged: Judged = "force") -> Verdict | None:
    """Return the judged setting with the smallest worst error whose every case takes no longer than ``budget`` s."""
    within = [v for v in verdicts if v.is_judged and v.seconds <= budget and isfinite(v.error_of(judged))]
    return min(within, key=lambda v: (v.error_of(judged), v.dofs), default=None)


def keeps(verdict: Verdict, verdicts: Iterable[Verdict], accuracy: float, judged: Judged) -> bool:
    """Tell whether a setting keeps the accuracy, and every larger ε that was judged with it: not by chance."""
    if not verdict.is_judged or not verdict.error_of(judged) <= accuracy:
        return False
    larger = (v for v in verdicts if v.is_judged and _is_larger(v, verdict))
    return all(v.error_of(judged) <= accuracy for v in larger)


def _is_larger(other: Verdict, verdict: Verdict) -> bool:
    """Tell whether two settings differ in a larger ε only; at full order, whatever is outside."""
    if "epsilon" not in verdict.labels or not other.labels["epsilon"] > verdict.labels["epsilon"]:
        return False
    aside = {"epsilon", "outside"} if other.labels["epsilon"] == inf else {"epsilon"}
    return all(other.labels[name] == value for name, value in verdict.labels.items() if name not in aside)


def by_outside(verdicts: Iterable[Verdict]) -> dict[str, tuple[Verdict, ...]]:
    """Return the verdicts for each swept value of outside, the full order in all of them."""
    verdicts = tuple(verdicts)
    names = dict.fromkeys(v.labels["outside"] for v in verdicts if "outside" in v.labels)
    return {name: tuple(v for v in verdicts if name == v.labels["outside"] or is_full(v)) for name in names}


def is_full(verdict: Verdict) -> bool:
    """Tell whether a setting is the full order."""
    return bool(verdict.mesh.get("epsilon", inf) == inf)


def _labels(dataset: xr.Dataset, dims: list[str]) -> list[Labels]:
    values = ([plain(value) for value in dataset[dim].values] for dim in dims)
    return [dict(zip(dims, labels, strict=True)) for labels in itertools.product(*values)]


def _distinct(settings: list[Labels]) -> list[int]:
    """Return which settings to keep: at full order nothing is outside, so that one value of it stands for all."""
    seen, keep = list[Labels](), []
    for number, labels in enumerate(settings):
        same = {k: v for k, v in labels.items() if k != "outside"} if isinf(labels.get("epsilon", 0)) else labels
        if same not in seen:
            seen.append(same)
            keep.append(number)
    return keep


def _reference(dataset: xr.Dataset) -> str:
    """Return the first force that is known of those which F may be compared with."""
    for name, variable in _VARIABLES.items():
        if variable in dataset and bool(np.isfinite(dataset[variable]).any()):
            return name
    exact = "" if has_path(dataset) else "`exact = true` in [solve], or with "
    raise DatasetError(
        "the dataset holds no F_exact or F_max, against which a guide compares each mesh: "
        f'run its study with {exact}"full" and another ε in epsilon'
    )


def _reasons(status: np.ndarray, message: np.ndarray, bar: np.ndarray, exact: np.ndarray, reference: str) -> np.ndarray:
    """Return, cell by cell, why a case cannot be judged; "" if it can."""
    states = np.where(status == PENDING, "not yet run", status)
    found = np.where(status != OK, states, np.where(bar >= 0, "", "no error bar")).astype(object)
    why = found + np.where((message == "") | (found == ""), "", ": " + message.astype(object))
    return np.where((why == "") & ~np.isfinite(exact), f"{reference} is not known", why)


def _mesh(dataset: xr.Dataset, study: Study | None, labels: Labels) -> Labels:
    """Return ε, outside, element sizes (m) and elements of a setting, as far as they are known."""
    scene = {axis.name: axis.labels[0] for axis in study.axes if axis.section != "mesh"} if study else {}
    case = case_at(dataset, study, scene | labels)
    if case is None:
        return dict(labels)
    mesh, found = case.mesh, dict[str, Any]()
    if mesh.accuracy is not None:
        found = {"accuracy": mesh.accuracy}
    if mesh.accuracy is None or "epsilon" in labels:
        found["epsilon"] = mesh.epsilon
    if mesh.accuracy is not None or not isinf(mesh.epsilon):
        found["outside"] = mesh.outside
    return found if mesh.accuracy is not None else found | {name: getattr(mesh, name) for name in _SIZES}
