"""Held-out touches of a real-time model, by full solves of the program: groups on one mesh each, stored in a file.

A group is one place and one flat tool, a disc, a blade or a bonded disc, at four of the Poisson's ratios of the model,
or at its single one. Depths and moduli are not varied: force is proportional to both. Balls and cones, in unilateral
contact, are groups of one touch each, in a separate file.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from math import atanh, hypot, nan, pi, radians, tan
from pathlib import Path

import numpy as np

from epsmesh_realtime.export.checks import TOOLS, Check, random_place, random_touch, solved, with_bar
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.model import Model

# Seed of groups; number of Poisson's ratios in one, each from a quarter of the range.
_SEED, _RATIOS = 5000, 4
# All tools by their number, the last two not flat: contact radii in units of the largest allowed by the model, radii of
# balls in units of the contact radius, half angles of cones (degrees), and radius of their shafts.
NAMES = (*TOOLS, "ball", "cone")
_CONTACTS, _BALLS, _ANGLES, _SHAFT = (0.2, 0.8), (2.0, 7.0), (55.0, 80.0), 1.6


def groups_of(path: Path) -> dict[int, list[Check]]:
    """Return the stored touches, by the number of their group."""
    found: dict[int, list[Check]] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            number = kept.pop("group")
            kept |= {"tool": Tool(**kept["tool"]), "vector": tuple(kept["vector"])}
            found.setdefault(number, []).append(Check(**kept))
    return found


def add_groups(path: Path, model: Model, solver: Solver, count: int, kinds: Sequence[int]) -> Iterator[list[Check]]:
    """Yield groups of tools of these ``kinds`` in turn until ``count`` touches are stored, each when it is solved."""
    known = groups_of(path)
    held, number = sum(map(len, known.values())), max(known, default=-1) + 1
    while held < count:
        found = _solve(model, solver, number, kinds[number % len(kinds)])
        keep(path, number, found)
        held, number = held + len(found), number + 1
        yield found


def keep(path: Path, number: int, group: Sequence[Check]) -> None:
    """Append a group to a file of stored touches."""
    lines = [json.dumps(asdict(check) | {"group": number}) + "\n" for check in group]
    with path.open("a", encoding="utf-8") as file:
        file.write("".join(lines))


def flat_kinds(model: Model) -> range:
    """Return the numbers of the flat tools of a model."""
    return range(len(TOOLS) if len(model.table.tensors) else 1)


def _solve(model: Model, solver: Solver, number: int, kind: int) -> list[Check]:
    rng = np.random.default_rng(_SEED + number)
    low, high = model.table.poisson
    if kind >= len(TOOLS):
        asked = _turned(model, _random_round(model, rng, kind))
        return solved(model, solver, asked, [asked.poisson] if low < high else None)
    shares = (np.arange(_RATIOS) + rng.uniform(size=_RATIOS)) / _RATIOS
    ratios = (low + (high - low) * shares).tolist() if low < high else None
    return solved(model, solver, _turned(model, random_touch(model, rng, kind)), ratios)


def _random_round(model: Model, rng: np.random.Generator, kind: int) -> Check:
    """Return an unsolved touch of a ball or a cone, at the depth of a contact ``radius`` on a half-space."""
    x, y = random_place(model, rng)
    a = model.largest * model.room(x, y) * float(np.exp(rng.uniform(*np.log(_CONTACTS))))
    poisson = float(rng.uniform(*model.table.poisson))
    if NAMES[kind] == "ball":
        share = 1 / float(rng.uniform(*_BALLS))
        depth, tool = a * atanh(share), Tool("sphere", a / share, contact="unilateral")
    else:
        angle = radians(rng.uniform(*_ANGLES))
        depth, tool = pi / 2 * a / tan(angle), Tool("cone", _SHAFT * a, angle, contact="unilateral")
    return with_bar(model, Check(x, y, a, depth, poisson, nan, nan, nan, nan, kind, tool))


def _turned(model: Model, asked: Check) -> Check:
    """Return a touch of a round tool on a round body, rotated to y = 0, where the program solves a half."""
    if not model.table.is_axial or asked.tool.name == "blade":
        return asked
    return replace(asked, x=hypot(asked.x, asked.y), y=0.0)
