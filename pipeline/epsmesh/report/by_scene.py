"""What a guide answers at each depth and for each law: the smallest ε for every value of `outside`."""

from dataclasses import dataclass
from itertools import groupby, product
from math import inf, isfinite
from typing import Any

from epsmesh.report.verdicts import Cells, Verdict, by_outside, choose, is_full

# The parameters of a scene that an answer is split by: how deep, and in what; of an insertion, what is judged.
DIMENSIONS = ("depth", "law", "quantity")
Where = dict[str, tuple[Any, ...]]


@dataclass(frozen=True)
class OfOutside:
    """The answer with one value of ``outside`` ("epsilon" if it is not swept): None where no setting suffices.

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

    where: Where
    answers: tuple[OfOutside, ...]

    @property
    def key(self) -> tuple[float, ...]:
        """The smallest ε (m) of every ``outside``."""
        return tuple(one.epsilon for one in self.answers)

    def as_data(self) -> dict[str, Any]:
        """Return the answers as plain data: ε (m) by outside, infinite where only the full order suffices."""
        widest = {one.outside: one.widest for one in self.answers if one.widest}
        return {
            **self.where,
            "epsilon": {one.outside: one.epsilon for one in self.answers},
            "widest": {
                name: {"epsilon": v.mesh["epsilon"], "ratio_min": v.spread.least, "ratio_max": v.spread.most}
                for name, v in widest.items()
            },
        }


def parts(cells: Cells, accuracy: float, budget: float) -> tuple[Part, ...]:
    """Return the answers by depth and law; neighbours that have the same ones are one part.

    Empty if no more than one depth and one law are swept, or no ε.
    """
    names = [name for name in DIMENSIONS if name in cells.codes]
    swept = {name: dict.fromkeys(scene[name] for scene in cells.scenes) for name in names}
    swept = {name: labels for name, labels in swept.items() if len(labels) > 1}
    if not swept or not isfinite(accuracy) or not any("epsilon" in labels for labels in cells.settings):
        return ()

    def part(where: Where) -> Part:
        scenes = [n for n, scene in enumerate(cells.scenes) if all(scene[k] in labels for k, labels in where.items())]
        verdicts = cells.verdicts(scenes)
        groups = by_outside(verdicts) or {"epsilon": verdicts}
        return Part(where, tuple(_answer(name, group, accuracy, budget) for name, group in groups.items()))

    single = [part({k: (v,) for k, v in zip(swept, labels, strict=True)}) for labels in product(*swept.values())]
    for name in reversed(swept):  # laws of one depth first
        single = [part(where) for where in _merged(single, name)]
    return tuple(single)


def _answer(name: str, group: tuple[Verdict, ...], accuracy: float, budget: float) -> OfOutside:
    finite = [v for v in group if v.is_judged and not is_full(v)]
    widest = max(finite, key=lambda v: (v.mesh.get("epsilon", inf), -v.error), default=None)
    return OfOutside(name, choose(group, accuracy, budget), widest)


def _merged(single: list[Part], name: str) -> list[Where]:
    """Return the places of parts, those that differ in ``name`` alone and have the same answers joined."""

    def same(one: Part) -> tuple[Any, ...]:
        return one.key, [labels for other, labels in one.where.items() if other != name]

    groups = ([one.where for one in group] for _, group in groupby(single, key=same))
    return [found[0] | {name: tuple(label for where in found for label in where[name])} for found in groups]
