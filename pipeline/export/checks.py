"""Touches by full solves of the program: some that a model's bar is fitted to, others that it is judged on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.export.compliance import Region
from pipeline.plan.plan import make_plan
from pipeline.realtime.model import Model
from pipeline.run.execute import compute
from pipeline.shapes.bodies.box import Box
from pipeline.shapes.bodies.cylinder import Cylinder
from pipeline.stages import stage
from pipeline.study.load import parse

# Radii of the discs, in units of the largest that the model takes at the place; depth in units of the radius.
_RADII, _DEPTH = (0.1, 0.99), 0.02
# The bar is so much longer than the longest that the fit needs.
_SAFETY = 1.3


@dataclass(frozen=True)
class Check:
    """A touch of a disc: place and radius (m), ν, F (N) of a full solve with its relative bar, and of the model."""

    x: float
    y: float
    radius: float
    depth: float
    poisson: float
    full: float
    full_error: float
    force: float
    bar: float

    @property
    def error(self) -> float:
        """How far the model is off, relative to the full solve."""
        return self.force / self.full - 1

    @property
    def is_held(self) -> bool:
        """Whether the model's bar holds the difference."""
        return abs(self.error) <= self.bar


@stage("checks")
def check_touches(
    model: Model, region: Region, body: Box | Cylinder, count: int, seed: int, accuracy: float
) -> list[Check]:
    """Return ``count`` random touches of a model, full solves to a relative ``accuracy``.

    Raises:
        RuntimeError: if a full solve failed.
    """
    rng = np.random.default_rng(seed)
    return [_check(model, region, body, rng, accuracy) for _ in range(count)]


def _check(model: Model, region: Region, body: Box | Cylinder, rng: np.random.Generator, accuracy: float) -> Check:
    x, y = _place(region, rng)
    smallest, largest = np.log(_RADII)
    radius = model.largest * region.room(x, y) * float(np.exp(rng.uniform(smallest, largest)))
    poisson, depth = float(rng.uniform(*model.table.poisson)), _DEPTH * radius
    touch = model.query("disc", radius=radius, at=(x, y, 0.0), depth=depth, poisson=poisson)
    assert touch.status == "ok", touch
    full, bar = _full(body, (x, y, radius, depth), (model.young, poisson), accuracy)
    return Check(x, y, radius, depth, poisson, full, bar, float(touch.force[2]), touch.force_error)


def _place(region: Region, rng: np.random.Generator) -> tuple[float, float]:
    a, b = region.reach
    if not region.is_round:
        return float(rng.uniform(-a, a)), float(rng.uniform(-b, b))
    r, angle = a * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return float(r * np.cos(angle)), float(r * np.sin(angle))


def _full(
    body: Box | Cylinder, touch: tuple[float, float, float, float], tissue: tuple[float, float], accuracy: float
) -> tuple[float, float]:
    """Return F (N) of a disc by the program, and its relative bar."""
    x, y, radius, depth = (f"{1e3 * length:.12g} mm" for length in touch)
    if isinstance(body, Box):
        shape: dict[str, object] = {"shape": "box", "size": [_mm(size) for size in body.size]}
    else:
        shape = {"shape": "cylinder", "radius": _mm(body.radius), "height": _mm(body.height)}
    young, poisson = tissue
    study = parse({
        "body": shape,
        "material": {"young": f"{young:.12g} Pa", "poisson": poisson},
        "probe": {"shape": "disc", "contact": "frictionless", "radius": radius, "depth": depth, "at": [x, y]},
        "mesh": {"accuracy": f"{100 * accuracy:.6g} %"},
        "solve": {"exact": False},
    })  # fmt: skip
    (record,) = compute(make_plan(study), MPI.COMM_SELF).values()
    if not record.is_ok or not isfinite(record.force_error):
        raise RuntimeError(f"a full solve of a disc of {radius} at {x}, {y} failed: {record.message}")
    return record.force, record.force_error


def _mm(length: float) -> str:
    return f"{1e3 * length:.12g} mm"


def needed(checks: Sequence[Check], floor: float) -> float:
    """Return by how much bars must grow, ``floor`` apart, to hold errors with a safety, at least 1."""
    return max(1.0, _SAFETY * max((abs(check.error) - floor) / (check.bar - floor) for check in checks))


def columns(fitted: Sequence[Check], judged: Sequence[Check]) -> dict[str, tuple[str, FloatArray]]:
    """Return all checks as units and values by name, those that are judged after those that were fitted."""
    units = {"x": "m", "y": "m", "radius": "m", "depth": "m", "poisson": "1", "full": "N", "full_error": "1"}
    units |= {"force": "N", "bar": "1", "error": "1"}
    checks = [*fitted, *judged]
    found = {name: (unit, np.array([getattr(check, name) for check in checks])) for name, unit in units.items()}
    is_judged = np.array([0.0] * len(fitted) + [1.0] * len(judged))
    return {**found, "judged": ("1", is_judged)}
