"""Two studies that say the same, and how their results are related; the table of changes is filled by other modules."""

import copy
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tests.pairs import Study
from tests.same.outcome import Outcome, Value

LAW_KEYS = ("law", "c2", "c3", "terms", "limit", "alpha", "fibres")
TISSUE_KEYS = ("young", "poisson", "density", "relaxation", *LAW_KEYS)
FLAT = ("box", "cylinder")


@dataclass(frozen=True)
class Pair:
    """Two studies that say the same.

    The second may need the results of the first. ``one_mesh``: they should be solved on the same mesh. ``allowed`` is
    the relative difference of the scenes themselves. ``at`` and ``at_first`` are the places along the dimensions of a
    sweep. ``before`` runs first, with the store of the second. ``common``: only variables that both have are compared.
    ``related`` turns the results of the second into what those of the first should be.
    """

    first: Study
    second: Study | Callable[[Outcome], Study]
    one_mesh: bool = True
    allowed: float = 0.0
    at: Mapping[str, int] = field(default_factory=dict)
    at_first: Mapping[str, int] = field(default_factory=dict)
    before: Study | None = None
    common: bool = False
    related: Callable[[Outcome], Outcome] = lambda outcome: outcome


Change = Callable[[Study, random.Random], Pair | None]
CHANGES: dict[str, Change] = {}


def change(name: str) -> Callable[[Change], Change]:
    """Enter a change in the table of all changes."""

    def enter(change: Change) -> Change:
        CHANGES[name] = change
        return change

    return enter


def copied(study: Study, **sections: Mapping[str, Any]) -> Study:
    """Return a copy of a study, with further keys in some of its sections."""
    other = copy.deepcopy(study)
    for name, keys in sections.items():
        other.setdefault(name, {}).update(copy.deepcopy(dict(keys)))
    return other


def has(study: Study, key: str) -> bool:
    """Return whether the body has tables of this key."""
    return bool(study["body"].get(key))


def is_large(study: Study) -> bool:
    """Return whether the material has a law of large displacements."""
    return study["material"].get("law", "linear") != "linear"


def lump_in(study: Study) -> dict[str, Any]:
    """Return a stiff piece of tissue of the law of the study's material."""
    lump = {"name": "lump", "young": "60 kPa", "poisson": 0.3, "density": "1000 kg/m^3"}
    laws = LAW_KEYS if is_large(study) else ()
    return lump | {key: copy.deepcopy(study["material"][key]) for key in laws if key in study["material"]}


def with_values(outcome: Outcome, change: Callable[[str, Value], Value | None]) -> Outcome:
    """Return an outcome with other values; those that become None are left out."""
    values = {name: change(name, value) for name, value in outcome.values.items()}
    return replace(outcome, values={name: value for name, value in values.items() if value is not None})


def times_of(value: Value, factor: float) -> Value:
    """Return a value, with its bar, times a factor."""
    return replace(value, numbers=factor * value.numbers, bars=abs(factor) * value.bars)


def without(*names: str) -> Callable[[Outcome], Outcome]:
    """Return the change of an outcome to one without these variables."""
    return lambda outcome: with_values(outcome, lambda name, value: None if name in names else value)
