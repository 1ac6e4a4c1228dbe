"""Do the error bars hold the truth: random scenes and meshes, good and naive, against converged forces."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from statistics import median
from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.run.record import Record
from pipeline.study.load import parse
from pipeline.study.problems import StudyError

SEED, COUNT = 2026, 160
# The truth is to be known ten times better than the best of the cases' errors.
_TRUTH = "0.03 %"
# Kinds of scenes, with their share of the cases.
_KINDS = {"cylinder": 0.32, "layer": 0.15, "box": 0.18, "off centre": 0.12, "blade": 0.23}
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.4999, 0.5)
# Displacement elements of degree 1 are for less than this.
_MOST_STRAIGHT = 0.45


@dataclass(frozen=True)
class Trial:
    """One random case: its force and error bar, and the truth with its own; or the message of what failed."""

    name: str
    force: float
    bar: float
    truth: float
    truth_bar: float
    message: str = ""

    @property
    def error(self) -> float:
        """Relative to the force, as the bar is."""
        return abs(self.truth / self.force - 1)

    @property
    def is_held(self) -> bool:
        """Whether the bar holds the truth, with no allowance for the truth's own error."""
        return self.error <= self.bar

    @property
    def ratio(self) -> float:
        """How much larger the bar is than the error."""
        return self.bar / self.error


@dataclass(frozen=True)
class Coverage:
    """What all trials say of the bars."""

    trials: tuple[Trial, ...]

    @property
    def held(self) -> float:
        """Share of the bars that hold the truth."""
        return sum(trial.is_held for trial in self.trials) / len(self.trials)

    @property
    def ratio(self) -> float:
        """Median of bar over error."""
        return median(trial.ratio for trial in self.trials if not trial.message)

    @property
    def is_met(self) -> bool:
        """Whether the bars are 95 % bars, and not idle ones."""
        return self.held >= 0.95 and self.ratio <= 3.0


def trials(comm: MPI.Comm, count: int = COUNT, seed: int = SEED) -> Iterator[Trial]:
    """Yield ``count`` random trials; the same seed gives the same ones; collective."""
    random = np.random.default_rng(seed)
    done = 0
    while done < count:
        scene = _scene(random)
        mesh = _mesh(random, scene)
        truth_mesh = {"accuracy": _TRUTH} | {k: mesh[k] for k in ("epsilon", "outside") if mesh["outside"] != "coarse"}
        try:
            case, truth = _solve(comm, scene, mesh, ("axisymmetric",)), _solve(comm, scene, truth_mesh)
        except StudyError:  # the dice made no sense: a footprint over the edge, a ratio that locks
            continue
        done += 1
        message = "; ".join(r.message for r in (case, truth) if not isfinite(r.force))
        yield Trial(_name(scene, mesh), case.force, case.force_error, truth.force, truth.force_error, message)


def _solve(comm: MPI.Comm, scene: dict[str, Any], mesh: dict[str, Any], without: tuple[str, ...] = ()) -> Record:
    study = parse({**scene, "mesh": mesh, "solve": {"exact": False}})
    (record,) = compute(make_plan(study, without=without), comm).values()
    return record


def _scene(random: np.random.Generator) -> dict[str, Any]:
    """Throw a scene; lengths in units of the probe's half width, 1 mm."""

    def log_uniform(low: float, high: float) -> float:
        return float(np.round(np.exp(random.uniform(np.log(low), np.log(high))), 3))

    kind = random.choice(list(_KINDS), p=list(_KINDS.values()))
    contact = str(random.choice(["bonded", "frictionless"]))
    fixed = str(random.choice(["bottom", "bottom", "sides", "bottom+sides"]))
    radius = log_uniform(2.0, 30.0)
    height = log_uniform(0.15, 1.0) if kind == "layer" else log_uniform(1.0, 20.0)
    round_body = {"shape": "cylinder", "radius": f"{radius} mm", "height": f"{height} mm"}
    box = {"shape": "box", "size": [f"{2 * radius} mm", f"{2 * log_uniform(2.0, 30.0)} mm", f"{height} mm"]}
    body = round_body if kind in ("cylinder", "layer") or random.random() < 0.4 else box
    if kind == "box":
        body = box
    if kind == "layer":
        fixed = "bottom"
    probe: dict[str, Any] = {"shape": "disc", "radius": "1 mm", "depth": "0.01 mm", "contact": contact}
    if kind == "blade":
        probe = {
            "shape": "blade", "length": f"{2 * log_uniform(1.0, 8.0)} mm", "width": "2 mm", "depth": "0.01 mm",
            "contact": contact,
        }  # fmt: skip
    if kind == "off centre":
        probe["at"] = [f"{np.round(random.uniform(0.1, 0.7) * radius, 3)} mm", "0 mm"]
    return {
        "body": {**body, "fixed": fixed},
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": probe,
    }


def _mesh(random: np.random.Generator, scene: dict[str, Any]) -> dict[str, Any]:
    """Throw a mesh for a scene: graded to the edge, or as one would draw it who knows nothing of the edge."""
    degree = int(random.choice([1, 2, 2, 3]))
    if scene["material"]["poisson"] >= _MOST_STRAIGHT:
        degree = max(degree, 2)
    far = 60.0
    if random.random() < 0.6:
        rim, growth, fine = random.uniform(0.08, 0.3), random.uniform(0.35, 0.6), far
    else:
        rim, growth, fine = random.uniform(0.4, 1.2), random.uniform(0.5, 1.2), random.uniform(1.2, 3.0)
    epsilon, outside = ("full" if fine == far else f"{random.uniform(3.0, 6.0):.3g} mm"), "coarse"
    if scene["body"]["shape"] == "cylinder" and "at" not in scene["probe"] and random.random() < 0.3:
        epsilon, outside = f"{random.uniform(2.0, 6.0):.3g} mm", str(random.choice(["free", "fixed"]))
    return {
        "epsilon": epsilon, "outside": outside, "fine": f"{fine:.3g} mm", "coarse": f"{far:.3g} mm",
        "rim": f"{min(rim, fine):.3g} mm", "growth": float(np.round(growth, 2)), "degree": degree,
    }  # fmt: skip


def _name(scene: dict[str, Any], mesh: dict[str, Any]) -> str:
    body, probe = scene["body"], scene["probe"]
    size = f"{body['radius']} × {body['height']}" if body["shape"] == "cylinder" else " × ".join(body["size"])
    at = f" at {probe['at'][0]}" if "at" in probe else ""
    tool = f"disc{at}" if probe["shape"] == "disc" else f"blade {probe['length']}"
    sizes = f"rim {mesh['rim']} growth {mesh['growth']} fine {mesh['fine']}" if "rim" in mesh else "truth"
    return (
        f"{body['shape']} {size} on its {body['fixed']}, {tool} {probe['contact']}, ν {scene['material']['poisson']:g},"
        f" degree {mesh.get('degree', '-')} {sizes} ε {mesh.get('epsilon', '-')} {mesh.get('outside', '')}"
    )
