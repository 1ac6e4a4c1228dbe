"""Touches by full solves of the program: some that a model's bar is fitted to, others that it is judged on."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.export.full import Full, Solver, Tool
from pipeline.export.ranks import ALONE, Ranks
from pipeline.realtime.model import Model
from pipeline.stages import stage

# Half sizes of the tools, in units of the largest that the model takes at the place; depth in units of those.
_SIZES, _DEPTH = (0.1, 0.99), 0.02
# The bar is so much longer than the longest that the fit needs.
_SAFETY = 1.3
# What few checks show of full solves beside a curved surface grows by this: three times in four, the largest of six
# errors is more than the 95 % quantile of all over it.
_SAFETY_FEW = 1.6
# Of their own bars, full solves tell F to this share at best.
_LEAST = 0.25
# Blades are so much longer than wide.
_SLENDER = (1.0, 12.0)
TOOLS = ("disc", "blade", "bonded")


@dataclass(frozen=True)
class Check:
    """A touch: place and half size (m), ν, F (N) of a full solve with its relative bar, and of the model.

    ``kind`` is a number of ``TOOLS``: a disc, a blade, whose half size is half its diagonal, or a bonded disc.
    ``vector`` is what the tissue does to the tool by the full solve (N), ``aside`` by how much the model's force aside
    is off it, in units of ``full``, if tissue sticks: the bar holds for both.
    """

    x: float
    y: float
    radius: float
    depth: float
    poisson: float
    full: float
    full_error: float
    force: float
    bar: float
    kind: int = 0
    tool: Tool = field(default_factory=lambda: Tool("disc"))
    vector: tuple[float, ...] = ()
    aside: float = 0.0

    @property
    def error(self) -> float:
        """How far the model is off, relative to the full solve."""
        return self.force / self.full - 1

    @property
    def is_held(self) -> bool:
        """Whether the model's bar holds the difference, aside as well."""
        return max(abs(self.error), self.aside) <= self.bar


def random_touches(model: Model, count: int, seed: int, tools: Sequence[int] = (0,)) -> list[Check]:
    """Return ``count`` random touches of a model, of ``tools`` in turn, not solved yet."""
    rng = np.random.default_rng(seed)
    return [random_touch(model, rng, tools[number % len(tools)]) for number in range(count)]


@stage("checks")
def check_touches(model: Model, solver: Solver, touches: Sequence[Check], ranks: Ranks = ALONE) -> list[Check]:
    """Return ``touches`` of a model with their full solves; collective.

    Raises:
        RuntimeError: if a full solve failed.
    """
    low, high = model.table.poisson

    def check(asked: Check) -> Check:
        (found,) = solved(model, solver, asked, [asked.poisson] if low < high else None)
        return found

    return ranks.in_turn(touches, check, "full solves to check against")


def random_touch(model: Model, rng: np.random.Generator, kind: int) -> Check:
    """Return a touch of a tool of ``TOOLS``, not solved yet, of which a model tells the force."""
    x, y = random_place(model, rng)
    smallest, largest = np.log(_SIZES)
    size = model.largest * model.room(x, y) * float(np.exp(rng.uniform(smallest, largest)))
    low, high = model.table.poisson
    poisson, depth = float(rng.uniform(low, high)), _DEPTH * size
    tool = Tool("disc", size, contact="bonded" if TOOLS[kind] == "bonded" else "frictionless")
    if TOOLS[kind] == "blade":
        slenderness, angle = float(np.exp(rng.uniform(*np.log(_SLENDER)))), rng.uniform(0, 2 * np.pi)
        width = 2 * size / float(np.hypot(slenderness, 1))
        along = (float(np.cos(angle)), float(np.sin(angle)), 0.0)
        tool = Tool("blade", length=slenderness * width, width=width, along=along)
    return with_bar(model, Check(x, y, size, depth, poisson, nan, nan, nan, nan, kind, tool))


def solved(model: Model, solver: Solver, asked: Check, poissons: Sequence[float] | None) -> list[Check]:
    """Return a touch with its full solve, for each of ``poissons`` on one mesh, or of the study's own materials.

    Raises:
        RuntimeError: if a full solve failed.
    """
    at, _ = on_face(model, asked.x, asked.y)
    fulls = solver.press_all(asked.tool, (float(at[0]), float(at[1])), [asked.depth], poissons)
    return [
        with_full(model, replace(asked, poisson=poisson), full)
        for poisson, full in zip(poissons or [asked.poisson], fulls, strict=True)
    ]


def with_full(model: Model, asked: Check, full: Full) -> Check:
    """Return a touch with what a full solve tells of it."""
    vector = tuple(float(part) for part in full.vector)
    return with_bar(model, replace(asked, full=full.force, full_error=full.error, vector=vector))


def with_bar(model: Model, check: Check) -> Check:
    """Return a check with the force of a model, and its bar."""
    at, normal = on_face(model, check.x, check.y)
    touch = model.query(check.tool.name, at=at.tolist(), depth=check.depth, poisson=check.poisson, **check.tool.sizes)
    assert touch.status == "ok", touch
    aside = 0.0
    if check.tool.contact == "bonded" and check.vector:
        off = touch.force - np.array(check.vector)
        aside = float(np.linalg.norm(off - (off @ normal) * normal)) / check.full
    return replace(check, force=float(touch.force @ normal), bar=touch.force_error, aside=aside)


def on_face(model: Model, x: float, y: float) -> tuple[FloatArray, FloatArray]:
    """Return where a place of the region is in the body's coordinates (3,), in m, and the normal there."""
    spot = model.face.at(model.table, x, y)
    return model.origin + np.array([x, y, spot.height]) @ model.axes, spot.normal @ model.axes


def random_place(model: Model, rng: np.random.Generator) -> tuple[float, float]:
    """Return x and y (m), anywhere in the region alike."""
    a, b = model.table.reach
    if not model.table.is_round:
        return float(rng.uniform(-a, a)), float(rng.uniform(-b, b))
    r, angle = a * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return float(r * np.cos(angle)), float(r * np.sin(angle))


def needed(checks: Sequence[Check], floor: float) -> float:
    """Return by how much bars must grow, ``floor`` apart, to hold errors with a safety, at least 1."""
    return max(1.0, _SAFETY * max((abs(check.error) - floor) / (check.bar - floor) for check in checks))


def told(checks: Sequence[Check], bar: float) -> float:
    """Return what full solves tell F to, relative: their own ``bar``, which counts in those of the checks, or less.

    Beside a curved surface own bars are some times the error; what the checks show of it, with a safety, is enough.
    """
    seen = max(abs(check.error) - (check.bar - bar) for check in checks)
    return min(bar, max(_LEAST * bar, _SAFETY_FEW * seen))


def columns(fitted: Sequence[Check], judged: Sequence[Check]) -> dict[str, tuple[str, FloatArray]]:
    """Return all checks as units and values by name, those that are judged after those that were fitted."""
    units = {"x": "m", "y": "m", "radius": "m", "depth": "m", "poisson": "1", "full": "N", "full_error": "1"}
    units |= {"force": "N", "bar": "1", "error": "1", "kind": "1", "aside": "1"}
    checks = [*fitted, *judged]
    found = {name: (unit, np.array([getattr(check, name) for check in checks])) for name, unit in units.items()}
    is_judged = np.array([0.0] * len(fitted) + [1.0] * len(judged))
    return {**found, "judged": ("1", is_judged)}
