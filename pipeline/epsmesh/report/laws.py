"""Laws that take F of an ε-mesh to F_exact, and how far each is off where its constants were not taken from.

- "ratio": F_exact = F / r.
- "compliance": 1/F_exact = 1/F - c / (E d), see :mod:`epsmesh.report.compliance`.
- "second order": the same with c + g m², m² the mean square distance from the axis of where the tool presses: what
  a cut adds is not quite the same for every point of contact.

Constants are fitted by least squares of the relative error of F_exact, to the scenes that are alike in all but one
parameter of the study (the tool, the thickness, ν, …), leaving out those with one value of it, which are then judged.
A :class:`Correction` is one r for all scenes, that whose largest residual |F / (r F_exact) - 1| is smallest
(Chebyshev's choice): the middle between the smallest and the largest F/F_exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np

from epsmesh.report.compliance import beyond

# Of each scene parameter, the position of each scene's value.
Codes = Mapping[str, np.ndarray]
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
class Correction:
    """r of a mesh setting and its relative residuals, the largest over the scenes.

    ``residual`` is that of the scenes that r was taken from; ``left_out`` that of each scene by the r of all the
    others, which tells little where scenes have twins (F/F_exact is the same for every Young's modulus); ``unseen``
    that of the scenes with one value of a scene parameter (one ν, one probe, …) by the r of those without it, the worst
    over parameters and values; ``error`` adds the error bars to the worst of these. NaN where there is nothing left to
    take r from.
    """

    r: float = nan
    mean: float = nan
    residual: float = nan
    left_out: float = nan
    unseen: float = nan
    error: float = nan


def correction(ratio: np.ndarray, bar: np.ndarray, codes: Codes) -> Correction:
    """Return the correction of one setting from F/F_exact of its scenes, and what error bars add to each.

    ``codes`` has, for each scene parameter, the position of each scene's value.
    """
    if not ratio.size:
        return Correction()
    r = float(ratio.min() + ratio.max()) / 2
    alone = r_without(ratio, np.arange(ratio.size))
    parameters = [r_without(ratio, labels) for labels in codes.values() if len(np.unique(labels)) > 1]
    return Correction(
        r,
        float(ratio.mean()),
        _worst(np.abs(ratio / r - 1)),
        _worst(np.abs(ratio / alone - 1)),
        max((_worst(np.abs(ratio / others - 1)) for others in parameters), default=nan),
        max(_worst(np.abs(ratio / others - 1) + bar / others) for others in [alone, *parameters]),
    )


def r_without(ratio: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return, for each scene, r of the scenes with other labels than its own; NaN if there are none."""
    names, group = np.unique(labels, return_inverse=True)
    if len(names) < 2:
        return np.full(ratio.shape, nan)
    total = np.zeros(len(names))
    for extreme, end in ((np.minimum, inf), (np.maximum, -inf)):
        own = np.full(len(names), end)
        extreme.at(own, group, ratio)
        # The extreme of the others is the extreme of all, but for the group that has it: there it is the runner-up.
        first = int(own.argmin() if end > 0 else own.argmax())
        total += np.where(np.arange(len(names)) == first, extreme.reduce(np.delete(own, first)), own[first])
    return np.asarray(total[group] / 2)


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

    @property
    def constants(self) -> str:
        """The range of its first constant over the tissues."""
        name, unit = ("r", "") if self.name == "ratio" else ("c", " 1/m")
        if f"{self.least:.3g}" == f"{self.most:.3g}":
            return f"{name} = {self.most:.3g}{unit}"
        return f"{name} = {self.least:.3g} … {self.most:.3g}{unit}, depending on the tissue"


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


def judge(forces: Forces, codes: Codes, tools: Sequence[str], loads: Sequence[str]) -> Laws:
    """Judge all laws.

    ``codes`` has, for each scene parameter, the position of each scene's value; ``tools`` names those that make a tool
    what it is, ``loads`` those that only move it.
    """
    if not forces.ratio.size:
        return Laws()
    count = forces.ratio.size
    site = groups([labels for name, labels in codes.items() if name not in (*tools, *loads)], count)
    tool = groups([codes[name] for name in tools], count)
    alone = {name: groups_without(codes, name, count) for name in codes}
    found = []
    for name in LAWS:
        model = _model(name, forces)
        constant = _fit(model, site, np.arange(count), out=False)[:, 0]
        constant = 1 / constant if name == "ratio" else constant
        carried = tuple(
            (axis, _worst(np.abs(_predict(name, forces, _fit(model, group, codes[axis]))[0] - 1)))
            for axis, group in alone.items()
        )
        predicted, bar = _predict(name, forces, _fit(model, site, tool))
        off = np.abs(predicted - 1)
        found.append(Law(name, float(constant.min()), _worst(constant), carried, _worst(off), _worst(off + bar)))
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
    cell = groups([group, label], len(target))
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


def groups(labels: Sequence[np.ndarray], count: int) -> np.ndarray:
    """Return the number of the group of each scene: one for each combination of labels."""
    if not labels:
        return np.zeros(count, dtype=int)
    return np.unique(np.stack(labels, axis=1), axis=0, return_inverse=True)[1].ravel()


def groups_without(codes: Codes, name: str, count: int) -> np.ndarray:
    """Return the number of the group of each scene: of those that are alike in all but one parameter."""
    return groups([labels for other, labels in codes.items() if other != name], count)


def _worst(values: np.ndarray) -> float:
    """Return the largest, NaN if one of them is not known."""
    return float(values.max()) if values.size else nan
