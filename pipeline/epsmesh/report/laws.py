"""Laws that take F of an ε-mesh to F_exact, and how far each is off where its constants were not taken from.

- "ratio": F_exact = F / r.
- "compliance": 1/F_exact = 1/F - c / (E d), see :mod:`epsmesh.report.compliance`.
- "second order": the same with c + g m², m² the mean square distance from the axis of where the tool presses: what
  a cut adds is not quite the same for every point of contact.

Constants are fitted by least squares of the relative error of F_exact, to the scenes that are alike in all but one
parameter of the study (the tool, the thickness, ν, …), leaving out those with one value of it, which are then judged.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np

from epsmesh.report.compliance import beyond

LAWS = ("ratio", "compliance", "second order")
FORMULAS = {
    "ratio": "F_exact ≈ F / r",
    "compliance": "1/F_exact ≈ 1/F - c/(E d)",
    "second order": "1/F_exact ≈ 1/F - (c + g m²)/(E d)",
}
# A law with more constants must be better than a simpler one by this factor.
_WORTH = 0.8
# Of a determinant, over that of columns at right angles: below it the tools left do not tell two constants apart.
_SINGULAR = 1e-6


@dataclass(frozen=True)
class Forces:
    """Of the scenes of one mesh setting: F/F_exact and the relative bars of both, E d / F (1/m), the power of the depth
    that F goes with and the mean square (m²) of where the tool presses.
    """

    ratio: np.ndarray
    force_bar: np.ndarray
    exact_bar: np.ndarray
    whole: np.ndarray
    exponent: np.ndarray
    square: np.ndarray


@dataclass(frozen=True)
class Law:
    """One law for one mesh setting.

    ``least`` and ``most`` are its first constant (r; c in 1/m) over the tissues, fitted to all tools; ``carried`` the
    worst relative error of F_exact, without bars, for each parameter of which a value was left out; ``others`` that for
    the tools that it was not fitted to, ``error`` the same with the error bars of both forces. NaN where there are too
    few scenes to tell.
    """

    name: str
    least: float = nan
    most: float = nan
    carried: tuple[tuple[str, float], ...] = ()
    others: float = nan
    error: float = nan

    @property
    def formula(self) -> str:
        """The law as people write it."""
        return FORMULAS[self.name]


@dataclass(frozen=True)
class Laws:
    """All laws of one mesh setting, and the largest error bar of its forces, that of F_exact included."""

    bar: float = nan
    laws: tuple[Law, ...] = field(default_factory=tuple)

    @property
    def best(self) -> Law | None:
        """The one that is the least off for other tools; of two that are as good the simpler one; None if none is."""
        known = [law for law in self.laws if law.error < inf]
        least = min((law.error for law in known), default=nan)
        return next((law for law in known if _WORTH * law.error <= least), None)


def judge(forces: Forces, axes: Mapping[str, np.ndarray], tools: tuple[str, ...], loads: tuple[str, ...]) -> Laws:
    """Judge all laws.

    ``axes`` holds, for each scene parameter, the position of each scene's value; ``tools`` names those that make a tool
    what it is, ``loads`` those that only move it.
    """
    if not forces.ratio.size:
        return Laws()
    site = _groups([axes[name] for name in axes if name not in (*tools, *loads)], forces.ratio.size)
    tool = _groups([axes[name] for name in tools], forces.ratio.size)
    alone = {name: _groups([axes[n] for n in axes if n != name], forces.ratio.size) for name in axes}
    found = []
    for name in LAWS:
        fitted = _fit(_model(name, forces), site, np.arange(forces.ratio.size), out=False)
        carried = tuple(
            (axis, _worst(np.abs(_predict(name, forces, _fit(_model(name, forces), alone[axis], axes[axis]))[0] - 1)))
            for axis in axes
        )
        predicted, bar = _predict(name, forces, _fit(_model(name, forces), site, tool))
        off = np.abs(predicted - 1)
        constant = 1 / fitted[:, 0] if name == "ratio" else fitted[:, 0]
        found.append(Law(name, _least(constant), _worst(constant), carried, _worst(off), _worst(off + bar)))
    return Laws(_worst(forces.force_bar + forces.exact_bar), tuple(found))


def _model(name: str, forces: Forces) -> tuple[np.ndarray, np.ndarray]:
    """Return columns (n, k) and targets (n,): constants that bring one to the other leave no error of F_exact."""
    if name == "ratio":
        return forces.ratio[:, None], np.ones_like(forces.ratio)
    c, _ = beyond(forces.whole, forces.ratio, forces.exponent, 0.0, 0.0)
    weight = forces.exponent / (forces.whole - c)
    columns = [weight] if name == "compliance" else [weight, forces.square * weight]
    return np.stack(columns, axis=1), c * weight


def _predict(name: str, forces: Forces, constants: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a law makes of F over F_exact, and what the bars of both add to its distance from 1."""
    if name == "ratio":
        predicted = forces.ratio * constants[:, 0]
        return predicted, predicted * (forces.force_bar + forces.exact_bar)
    c = constants[:, 0] + (forces.square * constants[:, 1] if name == "second order" else 0.0)
    left = forces.whole - c
    left = np.where(left <= 0, 0.0, left)  # more than all of it: no law
    with np.errstate(divide="ignore", invalid="ignore"):
        grown = (forces.whole / left) ** forces.exponent
        steeper = 1 + forces.exponent * c / left  # by how much more than F, in per cent, the corrected force is off
        bar = forces.ratio * grown * (np.abs(steeper) * forces.force_bar + forces.exact_bar)
    return forces.ratio * grown, bar


def _fit(model: tuple[np.ndarray, np.ndarray], group: np.ndarray, label: np.ndarray, *, out: bool = True) -> np.ndarray:
    """Return for each scene the constants (n, k) that suit best those of its ``group``, with other ``label`` than its
    own, or with any; NaN where these are too few.
    """
    columns, target = model
    count = columns.shape[1]
    size = np.nanmax(np.abs(columns), axis=0)
    scaled = columns / size
    cell = _groups([group, label], len(target))
    gram, moment = scaled[:, :, None] * scaled[:, None, :], scaled * target[:, None]
    one = np.zeros(len(target))
    one[np.unique(cell, return_index=True)[1]] = 1.0
    total = [_sum(part, group) - (_sum(part, cell) if out else 0.0) for part in (gram, moment)]
    others = _sum(one, group) - (1 if out else 0)
    constants = np.full(scaled.shape, nan)
    diagonal = np.prod(np.diagonal(total[0], axis1=1, axis2=2), axis=1)
    with np.errstate(invalid="ignore"):
        enough = (others >= count) & (np.linalg.det(total[0]) > _SINGULAR * diagonal)
    if enough.any():
        constants[enough] = np.linalg.solve(total[0][enough], total[1][enough][:, :, None])[:, :, 0]
    return constants / size


def _sum(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return for each scene the sum of ``values`` (n, …) over its group."""
    sums = np.zeros((group.max() + 1, *values.shape[1:]))
    np.add.at(sums, group, values)
    return np.asarray(sums[group])


def _groups(labels: list[np.ndarray], count: int) -> np.ndarray:
    """Return the number of the group of each scene: one for each combination of labels."""
    if not labels:
        return np.zeros(count, dtype=int)
    return np.unique(np.stack(labels, axis=1), axis=0, return_inverse=True)[1].ravel()


def _worst(values: np.ndarray) -> float:
    """Return the largest, NaN if one of them is not known."""
    return float(values.max()) if values.size else nan


def _least(values: np.ndarray) -> float:
    return float(values.min()) if values.size else nan
