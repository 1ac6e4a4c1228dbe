"""Mesh settings judged: the worst error over the scenes, what limits it, what it costs, and which to choose."""

from dataclasses import dataclass, field
from math import inf, isfinite, nan
from typing import Literal

import numpy as np

from epsmesh.report import correction, laws
from epsmesh.report.correction import Correction
from epsmesh.report.laws import Forces, Laws
from epsmesh.report.table import Labels, Table

# What is judged: F as it stands, after division by an r taken from other scenes, or by the best law for other tools.
Judged = Literal["force", "ratio", "tools"]


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


@dataclass(frozen=True)
class Verdict:
    """What a mesh setting is worth over the scenes.

    ``deviation`` is the worst |F/F_exact - 1|, ``error`` the worst with the error bars; ``limit`` the scene that has
    it, its ``force`` and ``exact`` in N. There ``error`` is the sum of ``distance`` from F_exact, ``force_bar`` and
    ``exact_bar``, all shares of F_exact. ``seconds``, ``dofs`` and ``cells`` are the largest over the scenes, ``usual``
    is the median of the seconds. ``laws`` are those that take F to F_exact, ``laws_of_full`` those that take it to
    F_max, without bars: what they leave is of ε alone, and not of the mesh's elements. A setting with ``missing``
    scenes is not judged: its errors are those of the rest.
    """

    labels: Labels
    mesh: Labels
    missing: int
    deviation: float = nan
    error: float = nan
    limit: Labels | None = None
    force: float = nan
    exact: float = nan
    distance: float = nan
    force_bar: float = nan
    exact_bar: float = nan
    seconds: float = nan
    usual: float = nan
    dofs: float = nan
    cells: float = nan
    spread: Spread = field(default_factory=Spread)
    correction: Correction = field(default_factory=Correction)
    laws: Laws = field(default_factory=Laws)
    laws_of_full: Laws = field(default_factory=Laws)

    @property
    def is_judged(self) -> bool:
        """Whether every scene was computed with it."""
        return not self.missing and isfinite(self.error)

    def error_of(self, judged: Judged) -> float:
        """Return the worst error, error bars included; NaN where too few scenes tell."""
        if judged == "tools":
            return self.laws.best.error if self.laws.best else nan
        return self.correction.error if judged == "ratio" else self.error


def judge(table: Table, row: int) -> Verdict:
    """Judge the setting of one row on the scenes that are covered."""
    use = table.is_judged[row] & ~table.uncovered
    labels, mesh, missing = table.settings[row], table.meshes[row], int(table.missing[row])
    if not use.any():
        return Verdict(labels, mesh, missing)
    ratio, bar = table.ratio[row, use], table.bar[row, use]
    deviation = np.abs(ratio - 1)
    worst = int((deviation + bar).argmax())
    scene = int(np.flatnonzero(use)[worst])
    axes = {name: positions[use] for name, positions in table.axes.items()}
    share = table.share if np.isfinite(table.share).any() else table.ratio
    return Verdict(
        labels,
        mesh,
        missing,
        deviation=float(deviation.max()),
        error=float(deviation[worst] + bar[worst]),
        limit=table.scenes[scene],
        force=float(table.force[row, scene]),
        exact=float(table.exact[row, scene]),
        distance=float(deviation[worst]),
        force_bar=float(table.ratio[row, scene] * table.force_bar[row, scene]),
        exact_bar=float(table.ratio[row, scene] * table.exact_bar[row, scene]),
        seconds=float(table.seconds[row, use].max()),
        usual=float(np.median(table.seconds[row, use])),
        dofs=float(table.dofs[row, use].max()),
        cells=float(table.cells[row, use].max()),
        spread=spread(share[row, use], axes),
        correction=correction.fit(ratio, bar, axes),
        laws=_laws(table, row, use),
        laws_of_full=_laws(table, row, use, of_full=True),
    )


def _laws(table: Table, row: int, use: np.ndarray, *, of_full: bool = False) -> Laws:
    """Judge the laws of one row on the scenes in ``use`` whose compliances add."""
    use = use & (table.sinking["why_not"] == "").to_numpy()
    ratio = table.share[row, use] if of_full else table.ratio[row, use]
    if not np.isfinite(ratio).all():
        return Laws()
    bar, exact_bar = (0.0 * ratio if of_full else part[row, use] for part in (table.force_bar, table.exact_bar))
    scale, exponent, square = table.sinking.loc[use, ["scale", "exponent", "square"]].to_numpy().T
    forces = Forces(ratio, bar, exact_bar, scale / table.force[row, use], exponent, square)
    axes = {name: positions[use] for name, positions in table.axes.items()}
    return laws.judge(forces, axes, table.tools, table.loads)


def spread(share: np.ndarray, axes: dict[str, np.ndarray]) -> Spread:
    """Return the range of F/F_max over scenes, and how much of it each parameter makes with the others held."""
    if not np.isfinite(share).all():
        return Spread()
    return Spread(float(share.min()), float(share.max()), tuple((name, _alone(share, axes, name)) for name in axes))


def _alone(share: np.ndarray, axes: dict[str, np.ndarray], name: str) -> float:
    """Return the largest range of ``share`` over scenes that differ in the parameter ``name`` only."""
    others = [positions for other, positions in axes.items() if other != name]
    group = np.unique(np.stack(others, axis=1), axis=0, return_inverse=True)[1].ravel() if others else 0 * axes[name]
    low, high = np.full(group.max() + 1, inf), np.full(group.max() + 1, -inf)
    np.minimum.at(low, group, share)
    np.maximum.at(high, group, share)
    return float((high - low).max())


def choose(
    verdicts: tuple[Verdict, ...], accuracy: float, budget: float = inf, judged: Judged = "force"
) -> Verdict | None:
    """Return the setting to use: with the smallest ε, then the fewest unknowns; for a budget alone, the best."""
    if not isfinite(accuracy):
        return most_accurate(verdicts, budget, judged)
    keeping = [v for v in verdicts if keeps(v, verdicts, accuracy, judged) and v.seconds <= budget]
    return min(keeping, key=lambda v: (v.mesh.get("epsilon", inf), v.dofs), default=None)


def most_accurate(verdicts: tuple[Verdict, ...], budget: float = inf, judged: Judged = "force") -> Verdict | None:
    """Return the judged setting with the smallest worst error whose every case takes no longer than ``budget`` s."""
    within = [v for v in verdicts if v.is_judged and v.seconds <= budget and isfinite(v.error_of(judged))]
    return min(within, key=lambda v: (v.error_of(judged), v.dofs), default=None)


def keeps(verdict: Verdict, verdicts: tuple[Verdict, ...], accuracy: float, judged: Judged) -> bool:
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
