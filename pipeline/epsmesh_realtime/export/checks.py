"""Touches solved in full: a calibration set for a model's error bar, and a test set."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np
from scipy.optimize import linprog

from epsmesh.arrays import FloatArray
from epsmesh.stages import stage
from epsmesh_realtime.export.forecast import DEPTH, SIZES
from epsmesh_realtime.export.full import Full, Solver, Tool
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.setting import place_of
from epsmesh_realtime.model import Model

# Least factor on the parts of a bar that grow with the tool: few touches are of the largest.
_LEAST_SHAPE = 0.25
# Error that full solves have in common, as a share of their error bars: on facets, meshes of the table and of the
# checks err alike (benchmarks/results/realtime.md).
_LEAST, _LEAST_CURVED = 0.25, 1.0
# Range of a blade's length over its width.
_SLENDER = (1.0, 12.0)
TOOLS = ("disc", "blade", "bonded")
# The kind of a ball at large displacements, after the flat tools.
BALL = len(TOOLS)


@dataclass(frozen=True)
class Check:
    """A touch: place and half size (m), ν, the force (N) of a full solve with its relative error bar, and the model's.

    ``kind`` is an index of ``TOOLS``: a disc, a blade (its half size is half its diagonal), or a bonded disc; or it is
    ``BALL``, whose half size is its radius.
    ``vector`` is the force of the tissue on the tool (N) by the full solve. ``aside`` is the error of the model's
    lateral force on a bonded tool, in units of ``full``; the model's error bar ``bar`` covers it, too.
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
        """The model's error, relative to the full solve."""
        return self.force / self.full - 1

    @property
    def is_covered(self) -> bool:
        """Whether the model's error bar covers both errors, along the normal and lateral."""
        return max(abs(self.error), self.aside) <= self.bar


def random_touches(model: Model, count: int, seed: int, tools: Sequence[int] = (0,)) -> list[Check]:
    """Return ``count`` random touches, not solved yet, with ``tools`` in turn."""
    rng = np.random.default_rng(seed)
    return [random_touch(model, rng, tools[number % len(tools)]) for number in range(count)]


@stage("checks")
def check_touches(
    model: Model, solver: Solver, sets: Sequence[Sequence[Check]], ranks: Ranks = ALONE
) -> list[list[Check]]:
    """Return ``sets`` of touches with their full solves, without those that failed; collective.

    Raises:
        RuntimeError: if half of the full solves of a set or more failed.
    """
    low, high = model.table.poisson

    def check(asked: Check) -> Check | str:
        try:
            (found,) = solved(model, solver, asked, [asked.poisson] if low < high else None)
        except RuntimeError as error:
            return str(error)
        return found

    done = iter(ranks.in_turn([one for each in sets for one in each], check, "full solves for the error bar"))
    found = []
    for each in sets:
        results = list(itertools.islice(done, len(each)))
        known = [one for one in results if isinstance(one, Check)]
        failed = [one for one in results if isinstance(one, str)]
        if failed and 2 * len(known) <= len(each):
            raise RuntimeError(failed[0])
        for why in failed:
            ranks.note(f"a touch is left out: {why}")
        found.append(known)
    return found


def random_touch(model: Model, rng: np.random.Generator, kind: int) -> Check:
    """Return a random touch with a tool of ``TOOLS``, not solved yet, with the model's force."""
    x, y = random_place(model, rng)
    smallest, largest = np.log(SIZES)
    size = model.largest * model.room(x, y) * float(np.exp(rng.uniform(smallest, largest)))
    low, high = model.table.poisson
    poisson, depth = float(rng.uniform(low, high)), DEPTH * size
    tool = Tool("disc", size, contact="bonded" if TOOLS[kind] == "bonded" else "frictionless")
    if TOOLS[kind] == "blade":
        slenderness, angle = float(np.exp(rng.uniform(*np.log(_SLENDER)))), rng.uniform(0, 2 * np.pi)
        width = 2 * size / float(np.hypot(slenderness, 1))
        first, second, third = (np.array([np.cos(angle), np.sin(angle), 0.0]) @ model.axes).tolist()
        tool = Tool("blade", length=slenderness * width, width=width, along=(first, second, third))
    return with_bar(model, Check(x, y, size, depth, poisson, nan, nan, nan, nan, kind, tool))


def solved(model: Model, solver: Solver, asked: Check, poissons: Sequence[float] | None) -> list[Check]:
    """Return a touch with its full solve, for each of ``poissons`` on one mesh, or with the study's own materials.

    Raises:
        RuntimeError: if a full solve failed.
    """
    at, normal = on_face(model, asked.x, asked.y)
    x, y, z = (-normal).tolist()
    # A bonded tool is held along its own plane: on facets, whose normals differ, that is the model's.
    is_turned = asked.tool.contact == "bonded" and not model.face.is_flat
    tool = replace(asked.tool, axis=(x, y, z)) if is_turned else asked.tool
    fulls = solver.press_all(tool, place_of(model.axes, at), [asked.depth], poissons)
    return [
        with_full(model, replace(asked, poisson=poisson), full)
        for poisson, full in zip(poissons or [asked.poisson], fulls, strict=True)
    ]


def with_full(model: Model, asked: Check, full: Full) -> Check:
    """Return a touch with the result of its full solve."""
    vector = tuple(float(part) for part in full.vector)
    return with_bar(model, replace(asked, full=full.force, full_error=full.error, vector=vector))


def with_bar(model: Model, check: Check) -> Check:
    """Return a check with a model's force and error bar."""
    at, normal = on_face(model, check.x, check.y)
    touch = model.query(check.tool.name, at=at.tolist(), depth=check.depth, poisson=check.poisson, **check.tool.sizes)
    assert touch.status == "ok", touch
    aside = 0.0
    if check.tool.contact == "bonded" and check.vector:
        off = touch.force - np.array(check.vector)
        aside = float(np.linalg.norm(off - (off @ normal) * normal)) / check.full
    force = float(touch.force @ normal)
    return replace(check, force=force, bar=touch.force_error / force, aside=aside)


def on_face(model: Model, x: float, y: float) -> tuple[FloatArray, FloatArray]:
    """Return a point of the face in the body's coordinates (3,), in m, and the outward normal there."""
    spot = model.spot(x, y)
    return model.origin + np.array([x, y, spot.height]) @ model.axes, spot.normal @ model.axes


def random_place(model: Model, rng: np.random.Generator) -> tuple[float, float]:
    """Return x and y (m), uniformly distributed over the region."""
    a, b = model.table.reach
    if not model.table.is_round:
        return float(rng.uniform(-a, a)), float(rng.uniform(-b, b))
    r, angle = a * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return float(r * np.cos(angle)), float(r * np.sin(angle))


def margin(count: int) -> float:
    """Return the factor on the narrowest bars that cover ``count`` touches, for which they cover 96 % of others.

    On average, for normally distributed errors, by simulation of 2 to 24 touches: 6.3 for two, 1.6 for twelve.
    """
    return (1 + 3 / count) ** 2


def narrowest(model: Model, checks: Sequence[Check]) -> tuple[float, float, float, float]:
    """Return the narrowest error bars of a model, on average, that cover all ``checks``, times a :func:`margin`.

    The first three parts of ``model.bar`` get one factor. The fourth, which is the same for all tools, is at
    least the error that full solves may have in common, a share of their error bars.
    """
    bare = replace(model, bar=(*model.bar[:3], 0.0))
    shapes = np.array([with_bar(bare, check).bar for check in checks])
    errors = np.abs([check.error for check in checks])
    rows = -np.column_stack([np.ones_like(shapes), shapes])
    bounds = [(0.0, None), (_LEAST_SHAPE, None)]
    fitted = linprog([1.0, shapes.mean()], A_ub=rows, b_ub=-errors, bounds=bounds).x
    floor, factor = margin(len(checks)) * fitted
    share = _LEAST if model.face.is_flat else _LEAST_CURVED
    common = share * float(np.mean([check.full_error for check in checks]))
    first, second, third = (float(factor) * part for part in model.bar[:3])
    return first, second, third, max(float(floor), common)


def columns(fitted: Sequence[Check], judged: Sequence[Check]) -> dict[str, FloatArray]:
    """Return all checks as arrays by name: first the calibration set, then the test set."""
    names = ("x", "y", "radius", "depth", "poisson", "full", "full_error", "force", "bar", "error", "kind", "aside")
    checks = [*fitted, *judged]
    found = {name: np.array([float(getattr(check, name)) for check in checks]) for name in names}
    return {**found, "judged": np.array([0.0] * len(fitted) + [1.0] * len(judged))}
