"""What a guide answers at each depth and for each law: the smallest ε for every value of `outside`."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import groupby, product
from math import inf, isfinite
from typing import Any

import numpy as np

from epsmesh.report.table import Table
from epsmesh.report.verdict import Verdict, choose, judge

# The parameters of a scene that an answer is split by: how deep, and in what; of an insertion, what is judged.
DIMENSIONS = ("depth", "law", "quantity")


@dataclass(frozen=True)
class OfOutside:
    """The answer with one value of ``outside`` ("" if it is not swept): None where no setting suffices.

    ``widest`` is the setting with the largest finite ε that was judged: its F/F_max says how far off it is.
    """

    outside: str
    answer: Verdict | None
    widest: Verdict | None

    @property
    def epsilon(self) -> float:
        """The smallest ε (m) that suffices, infinite if only the full order or nothing does."""
        return self.answer.mesh.get("epsilon", inf) if self.answer else inf


@dataclass(frozen=True)
class Part:
    """Scenes that share depths and laws, ``where``, and their answers."""

    where: dict[str, tuple[Any, ...]]
    answers: tuple[OfOutside, ...]

    @property
    def key(self) -> tuple[float, ...]:
        """The smallest ε (m) of every ``outside``."""
        return tuple(one.epsilon for one in self.answers)


def parts(table: Table, accuracy: float, budget: float) -> tuple[Part, ...]:
    """Return the answers by depth and law; neighbours that have the same ones are one part.

    Empty if no more than one depth and one law are swept, or no ε.
    """
    swept = {name: _labels(table, name) for name in DIMENSIONS if name in table.axes}
    swept = {name: labels for name, labels in swept.items() if len(labels) > 1}
    if not swept or not isfinite(accuracy) or not any("epsilon" in labels for labels in table.settings):
        return ()

    def part(where: dict[str, tuple[Any, ...]]) -> Part:
        return Part(where, _answers(_restricted(table, where), accuracy, budget))

    single = [
        part({name: (label,) for name, label in zip(swept, labels, strict=True)}) for labels in product(*swept.values())
    ]
    for name in reversed(swept):  # laws of one depth first
        single = [part(where) for where in _merged(single, name)]
    return tuple(single)


def _labels(table: Table, name: str) -> list[Any]:
    """Return the different labels of a parameter, in the order of the scenes."""
    return list(dict.fromkeys(scene[name] for scene in table.scenes))


def _restricted(table: Table, where: dict[str, tuple[Any, ...]]) -> Table:
    """Return the table of the scenes that have these labels."""
    use = np.array([all(scene[name] in labels for name, labels in where.items()) for scene in table.scenes])
    arrays = {field.name: getattr(table, field.name) for field in fields(table)}
    columns = {name: value[:, use] for name, value in arrays.items() if _is_matrix(value, table)}
    return replace(
        table,
        scenes=_of(table.scenes, use),
        cases=_of(table.cases, use),
        axes={name: positions[use] for name, positions in table.axes.items()},
        sinking=table.sinking[use].reset_index(drop=True),
        **columns,
    )


def _is_matrix(value: Any, table: Table) -> bool:
    return isinstance(value, np.ndarray) and value.shape == table.force.shape


def _of(values: Sequence[Any], use: np.ndarray) -> tuple[Any, ...]:
    return tuple(value for value, one in zip(values, use, strict=True) if one)


def _answers(table: Table, accuracy: float, budget: float) -> tuple[OfOutside, ...]:
    verdicts = [judge(table, row) for row in range(len(table.settings))]
    swept = dict.fromkeys(v.labels["outside"] for v in verdicts if "outside" in v.labels)
    found = []
    for outside in swept or ("",):
        group = tuple(v for v in verdicts if not outside or outside == v.labels["outside"] or _is_full(v))
        finite = [v for v in group if v.is_judged and not _is_full(v)]
        widest = max(finite, key=lambda v: (v.mesh.get("epsilon", inf), -v.error), default=None)
        found.append(OfOutside(outside, choose(group, accuracy, budget), widest))
    return tuple(found)


def _is_full(verdict: Verdict) -> bool:
    return verdict.mesh.get("epsilon", inf) == inf


def _merged(single: list[Part], name: str) -> list[dict[str, tuple[Any, ...]]]:
    """Return the places of parts, those that differ in ``name`` alone and have the same answers joined."""

    def same(one: Part) -> tuple[Any, ...]:
        return one.key, [labels for other, labels in one.where.items() if other != name]

    joined = []
    for _, group in groupby(single, key=same):
        found = list(group)
        joined.append(found[0].where | {name: tuple(label for one in found for label in one.where[name])})
    return joined
