"""Held-out touches of a real-time model by full solves of the program: groups on one mesh each, kept on file.

A group is one place and one tool, a disc, a blade or a bonded disc, at four of the Poisson's ratios that the model
takes, or at the one. Depths, and moduli, are no touches of their own: force is proportional to both.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from pipeline.export.checks import TOOLS, Check, random_touch, solved
from pipeline.export.full import Solver, Tool
from pipeline.realtime.model import Model

# Seeds of groups; Poisson's ratios of one, each from a quarter of the range.
_SEED, _RATIOS = 5000, 4


def groups_of(path: Path) -> dict[int, list[Check]]:
    """Return the touches on file, by the number of their group."""
    found: dict[int, list[Check]] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            number = kept.pop("group")
            kept |= {"tool": Tool(**kept["tool"]), "vector": tuple(kept["vector"])}
            found.setdefault(number, []).append(Check(**kept))
    return found


def add_groups(path: Path, model: Model, solver: Solver, count: int) -> Iterator[list[Check]]:
    """Yield group after group until so many touches are on file, each written when it is solved."""
    known = groups_of(path)
    held, number = sum(map(len, known.values())), max(known, default=-1) + 1
    while held < count:
        found = _solve(model, solver, number)
        lines = [json.dumps(asdict(check) | {"group": number}) + "\n" for check in found]
        with path.open("a", encoding="utf-8") as file:
            file.write("".join(lines))
        held, number = held + len(found), number + 1
        yield found


def _solve(model: Model, solver: Solver, number: int) -> list[Check]:
    rng = np.random.default_rng(_SEED + number)
    kind = number % len(TOOLS) if len(model.table.tensors) else 0
    low, high = model.table.poisson
    shares = (np.arange(_RATIOS) + rng.uniform(size=_RATIOS)) / _RATIOS
    ratios = (low + (high - low) * shares).tolist() if low < high else None
    return solved(model, solver, random_touch(model, rng, kind), ratios)
