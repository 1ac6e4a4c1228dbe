"""Do the error bars hold the truth: random scenes and meshes, good and naive, against converged forces.

There are three families. "design" are the scenes that the bars are made for: cylinders, layers, boxes, discs off the
axis and blades. "proportions" are cylinders under a disc on the axis, of any proportions, whose truth costs nothing:
hundreds of them tell of each kind of element and mesh for itself. "ellipses" are scenes of the design under elliptical
footprints, half of them across the axes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite, nan
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
# What is asked of the bars of every group of trials that is large enough to tell.
HELD, IDLE, ENOUGH = 0.95, 2.0, 40
# The truth is to be known better than the best of the cases' errors: ten times, where that does not take minutes.
_TRUTH = {"design": "0.03 %", "proportions": "0.03 %", "ellipses": "0.1 %"}
# Kinds of scenes, with their share of the cases.
_KINDS = {"cylinder": 0.32, "layer": 0.15, "box": 0.18, "off centre": 0.12, "blade": 0.23}
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.4999, 0.5)
# Displacement elements of degree 1 are for less than this.
_MOST_STRAIGHT = 0.45
# A mesh is naive if its elements at the probe's edge are larger than this, in units of the probe's half width.
_NAIVE = 0.35


@dataclass(frozen=True)
class Trial:
    """One random case: its force and error bar, and the truth with its own; or the message of what failed.

    ``kind`` is the degree and the element, ``mesh`` "graded" or "naive"; a case is ``refused`` if its bar says that the
    force is not known.
    """

    name: str
    force: float
    bar: float
    truth: float
    truth_bar: float
    message: str = ""
    kind: tuple[int, str] = (0, "")
    mesh: str = ""
    refused: bool = False

    @property
    def error(self) -> float:
        """The larger of those relative to the force and to the truth."""
        return max(abs(self.truth / self.force - 1), abs(self.force / self.truth - 1))

    @property
    def is_held(self) -> bool:
        """Whether the bar holds the truth, with no allowance for the truth's own error."""
        return self.error <= self.bar

    @property
    def ratio(self) -> float:
        """How much larger the bar is than the error."""
        return self.bar / self.error


@dataclass(frozen=True)
class Group:
    """Trials of one kind, of which those that were refused say nothing of the bars."""

    name: str
    trials: tuple[Trial, ...]

    @property
    def served(self) -> tuple[Trial, ...]:
        """Those with a force."""
        return tuple(trial for trial in self.trials if not trial.refused)

    @property
    def held(self) -> int:
        """How many bars hold the truth."""
        return sum(trial.is_held for trial in self.served)

    @property
    def share(self) -> float:
        """Share of the bars that hold the truth."""
        return self.held / len(self.served) if self.served else nan

    @property
    def ratio(self) -> float:
        """Median of bar over error."""
        ratios = [trial.ratio for trial in self.served if not trial.message]
        return median(ratios) if ratios else nan

    @property
    def worst(self) -> float:
        """The largest error, in bars."""
        return max((1 / trial.ratio for trial in self.served if not trial.message), default=nan)

    @property
    def is_met(self) -> bool:
        """Whether the bars are 95 % bars, and not idle ones."""
        return self.share >= HELD and self.ratio <= IDLE


@dataclass(frozen=True)
class Coverage:
    """What all trials say of the bars."""

    trials: tuple[Trial, ...]

    @property
    def groups(self) -> tuple[Group, ...]:
        """The trials by degree and element, by mesh, by both, and all of them."""
        kinds = sorted({trial.kind for trial in self.trials}, key=lambda kind: (kind[1], kind[0]))
        found = []
        for degree, element in kinds:
            of_kind = tuple(trial for trial in self.trials if trial.kind == (degree, element))
            name = f"degree {degree} {element}"
            found.append(Group(name, of_kind))
            found += [Group(f"{name}, {mesh}", tuple(t for t in of_kind if t.mesh == mesh)) for mesh in self.meshes]
        found += [Group(f"{mesh} meshes", tuple(t for t in self.trials if t.mesh == mesh)) for mesh in self.meshes]
        return (*(group for group in found if group.trials), Group("all", self.trials))

    @property
    def meshes(self) -> tuple[str, ...]:
        """The kinds of meshes."""
        return tuple(sorted({trial.mesh for trial in self.trials}))

    @property
    def is_met(self) -> bool:
        """Whether all bars together, and those of every group that is large enough, are what they should be."""
        return all(group.is_met for group in self.groups if len(group.served) >= ENOUGH or group.name == "all")

    def __str__(self) -> str:
        """The table, a line for each group."""
        lines = [_LINE.format("", "held", "", "bar / |error|", "worst", "refused")]
        lines += [
            _LINE.format(
                group.name, f"{group.held} of {len(group.served)}", f"{group.share:.1%}", f"{group.ratio:.2f}",
                f"{group.worst:.2f}", len(group.trials) - len(group.served),
            )
            for group in self.groups
        ]  # fmt: skip
        asked = f"asked for, of groups of {ENOUGH} and more: {HELD:.0%} held, median of bar / |error| at most {IDLE:g}"
        return "\n".join([*lines, f"{asked}: {'met' if self.is_met else 'NOT MET'}"])


_LINE = "{:32} {:>12} {:>7} {:>14} {:>6} {:>8}"


def trials(comm: MPI.Comm, count: int = COUNT, seed: int = SEED, family: str = "design") -> Iterator[Trial]:
    """Yield ``count`` random trials of a family; the same seed gives the same ones; collective."""
    random = np.random.default_rng(seed)
    throw = FAMILIES[family]
    done = 0
    while done < count:
        scene, mesh = throw(random)
        truth_mesh = {"accuracy": _TRUTH[family]} | {
            k: mesh[k] for k in ("epsilon", "outside") if mesh["outside"] != "coarse"
        }
        try:
            case, truth = _solve(comm, scene, mesh, ("axisymmetric",)), _solve(comm, scene, truth_mesh)
        except StudyError:  # the dice made no sense: a footprint over the edge, a ratio that locks
            continue
        done += 1
        yield _trial(scene, mesh, case, truth)


def _trial(scene: dict[str, Any], mesh: dict[str, Any], case: Record, truth: Record) -> Trial:
    message = "; ".join(r.message for r in (case, truth) if not isfinite(r.force))
    (declared,) = parse({**scene, "mesh": mesh}).cases()
    rim = declared.mesh.rim_size(declared.probe.half_width) / declared.probe.half_width
    return Trial(
        _name(scene, mesh), case.force, case.force_error, truth.force, truth.force_error, message,
        (declared.mesh.degree, declared.element), "naive" if rim > _NAIVE else "graded",
        refused=not case.is_ok and not message,
    )  # fmt: skip


def _solve(comm: MPI.Comm, scene: dict[str, Any], mesh: dict[str, Any], without: tuple[str, ...] = ()) -> Record:
    study = parse({**scene, "mesh": mesh, "solve": {"exact": False}})
    (record,) = compute(make_plan(study, without=without), comm).values()
    return record


def _design(random: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any]]:
    """Throw a scene that the bars are made for, and a mesh for it."""
    scene = _scene(random)
    return scene, _mesh(random, scene)


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.round(np.exp(random.uniform(np.log(low), np.log(high))), 3))


def _proportions(random: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any]]:
    """Throw a cylinder under a disc on its axis and a mesh, fine within 2.5 a; half of them nearly incompressible."""
    a = _log_uniform(random, 0.7, 5.0)
    poisson = round(random.uniform(0, 0.45) if random.random() < 0.5 else random.uniform(0.45, 0.497), 3)
    scene = {
        "body": {
            "shape": "cylinder", "radius": f"{a * _log_uniform(random, 3.5, 16):.4g} mm",
            "height": f"{a * _log_uniform(random, 1, 16):.4g} mm",
            "fixed": str(random.choice(["bottom", "bottom", "sides", "bottom+sides"])),
        },
        "material": {"young": "10 kPa", "poisson": poisson},
        "probe": {
            "shape": "disc", "radius": f"{a:.4g} mm", "depth": f"{a / 100:.4g} mm",
            "contact": str(random.choice(["bonded", "frictionless"])),
        },
    }  # fmt: skip
    degree = int(random.choice([1, 2, 3] if poisson < _MOST_STRAIGHT else [2, 3]))
    rim = random.uniform(0.4, 1.0) if random.random() < 0.5 else random.uniform(0.06, 0.3)
    fine = max(rim, _log_uniform(random, 0.4, 3.0))
    mesh = {
        "epsilon": f"{2.5 * a:.4g} mm", "outside": "coarse", "fine": f"{fine * a:.4g} mm",
        "coarse": f"{max(fine, _log_uniform(random, 2, 8)) * a:.4g} mm", "rim": f"{rim * a:.4g} mm", "growth": 0.5,
        "degree": degree,
    }  # fmt: skip
    return scene, mesh


def _ellipses(random: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any]]:
    """Throw a scene of the design under an ellipse of up to 6:1 instead of its probe, and a mesh for it."""
    scene = _scene(random)
    turned = random.uniform(0.0, np.pi) if random.random() < 0.5 else 0.0
    scene["probe"] = {
        "shape": "ellipse", "axes": [f"{_log_uniform(random, 1.0, 6.0)} mm", "1 mm"], "depth": "0.01 mm",
        "direction": [float(np.cos(turned)), float(np.sin(turned)), 0.0], "contact": scene["probe"]["contact"],
    }  # fmt: skip
    return scene, _mesh(random, scene)


# Families of trials by name.
FAMILIES: dict[str, Callable[[np.random.Generator], tuple[dict[str, Any], dict[str, Any]]]] = {
    "design": _design, "proportions": _proportions, "ellipses": _ellipses,
}  # fmt: skip


def _scene(random: np.random.Generator) -> dict[str, Any]:
    """Throw a scene; lengths in units of the probe's half width, 1 mm."""

    def log_uniform(low: float, high: float) -> float:
        return _log_uniform(random, low, high)

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
    tool = {"disc": f"disc{at}", "blade": f"blade {probe.get('length')}"}.get(probe["shape"]) or (
        f"ellipse {probe['axes'][0]} along {probe['direction'][0]:.2f} {probe['direction'][1]:.2f}"
    )
    sizes = f"rim {mesh['rim']} growth {mesh['growth']} fine {mesh['fine']}" if "rim" in mesh else "truth"
    return (
        f"{body['shape']} {size} on its {body['fixed']}, {tool} {probe['contact']}, ν {scene['material']['poisson']:g},"
        f" degree {mesh.get('degree', '-')} {sizes} ε {mesh.get('epsilon', '-')} {mesh.get('outside', '')}"
    )
