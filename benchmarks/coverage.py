"""Coverage of the error bars: random scenes and meshes, good and naive, compared with converged forces.

    python -m benchmarks.coverage [--family NAME] [--count N] [--seed N] [--json]

Scenes are those of :mod:`benchmarks.families`. The exit status is 1 if coverage is too low, or the bars too wide.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import isfinite, nan
from statistics import median
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.campaigns import each, ended_soon, finite
from benchmarks.families import FAMILIES
from benchmarks.scenes import record_of
from benchmarks.tables import markdown, options
from epsmesh.plan.recipe import half_width_of
from epsmesh.run.record import Record
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.verification.sections import Section

SEED, COUNT = 2026, 160
# A mesh is naive if its elements at the probe's edge are larger than this, in units of the half width of contact.
_NAIVE = 0.35
# Limits for every group with enough trials: coverage, and median bar over error. A family of scenes may have its own
# limit of the median: where F is no bound, a bar applies to both sides.
HELD, IDLE, ENOUGH = 0.95, 2.0, 40
_SOLVE = {"solve": {"exact": False}}


@dataclass(frozen=True)
class Trial:
    """One random case: its force and error bar, and the converged force with its own; or the message of a failure.

    ``kind`` is the degree and the element, ``mesh`` "graded" or "naive". A case is ``refused`` if its bar says that the
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
        """The error relative to the force, or to the converged force if that is larger."""
        return max(abs(self.truth / self.force - 1), abs(self.force / self.truth - 1))

    @property
    def is_held(self) -> bool:
        """Whether the bar covers the converged force, without an allowance for that force's own error."""
        return self.error <= self.bar

    @property
    def ratio(self) -> float:
        """Bar over error."""
        return self.bar / self.error


@dataclass(frozen=True)
class Group:
    """Trials of one kind; refused trials do not count for the bars."""

    name: str
    trials: tuple[Trial, ...]

    @property
    def served(self) -> tuple[Trial, ...]:
        """Trials with a force."""
        return tuple(trial for trial in self.trials if not trial.refused)

    @property
    def held(self) -> int:
        """Number of bars that cover the converged force."""
        return sum(trial.is_held for trial in self.served)

    @property
    def share(self) -> float:
        """Share of the bars that cover the converged force."""
        return self.held / len(self.served) if self.served else nan

    @property
    def ratio(self) -> float:
        """Median of bar over error."""
        ratios = [trial.ratio for trial in self.served if not trial.message]
        return median(ratios) if ratios else nan

    @property
    def worst(self) -> float:
        """The largest error, in units of its bar."""
        return max((1 / trial.ratio for trial in self.served if not trial.message), default=nan)

    @property
    def row(self) -> dict[str, Any]:
        """What a table has of the group."""
        return {
            "name": self.name,
            "cases": len(self.trials),
            "served": len(self.served),
            "held": self.held,
            "share": self.share,
            "median_bar_over_error": self.ratio,
            "worst": self.worst,
        }

    def is_met(self, idle: float) -> bool:
        """Return whether coverage is 95 %, and the median bar at most ``idle`` errors."""
        return self.share >= HELD and self.ratio <= idle


@dataclass(frozen=True)
class Coverage:
    """Coverage of the bars in all trials."""

    trials: tuple[Trial, ...]
    idle: float = IDLE

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
        """Whether all bars together, and those of every group with enough trials, are within the limits."""
        return all(
            group.is_met(self.idle) for group in self.groups if len(group.served) >= ENOUGH or group.name == "all"
        )

    def __str__(self) -> str:
        """The table, one line per group."""
        table = markdown([group.row for group in self.groups], _COLUMNS)
        asked = f"{HELD:.0%} held, median of bar / error at most {self.idle:g}"
        return f"{table}asked for, of groups of {ENOUGH} and more: {asked}: {'met' if self.is_met else 'NOT MET'}"


_COLUMNS = {"name": "", "cases": "d", "served": "d", "held": "d", "share": ".1%", "median_bar_over_error": ".2f",
            "worst": ".2f"}  # fmt: skip


def trials(comm: MPI.Comm, count: int = COUNT, seed: int = SEED, family: str = "design") -> Iterator[Trial]:
    """Yield the trials of ``count`` random scenes of a family, reproducible by the seed; collective."""
    random = np.random.default_rng(seed)
    thrown = FAMILIES[family]
    done = 0
    while done < count:
        scene, mesh = thrown.throw(random)
        truth_mesh = {"accuracy": thrown.truth} | {
            k: mesh[k] for k in ("epsilon", "outside") if mesh["outside"] != "coarse"
        }
        try:
            case = record_of({**scene, "mesh": mesh, **_SOLVE}, ("axisymmetric",), comm)
            truth = record_of({**scene, "mesh": truth_mesh, **_SOLVE}, comm=comm)
        except StudyError:  # an invalid draw: a footprint over the edge, a ratio that locks
            continue
        done += 1
        trial = _trial(scene, mesh, case, truth)
        yield trial
        if isfinite(case.energy_release):
            yield _of_release(trial, case, truth)


def _of_release(trial: Trial, case: Record, truth: Record) -> Trial:
    """Return a trial of the energy that a slit's front releases, from the trial of its force."""
    degree, element = trial.kind
    return replace(
        trial,
        name=f"energy release: {trial.name}",
        force=case.energy_release,
        bar=case.energy_release_error,
        truth=truth.energy_release,
        truth_bar=truth.energy_release_error,
        kind=(degree, f"{element}, released"),
    )


def _trial(scene: Section, mesh: Section, case: Record, truth: Record) -> Trial:
    message = "; ".join(r.message for r in (case, truth) if not isfinite(r.force))
    (declared,) = parse({**scene, "mesh": mesh}).cases()
    rim = declared.mesh.rim_size(declared.probe.half_width) / half_width_of(declared)
    return Trial(
        _name(scene, mesh),
        case.force,
        case.force_error,
        truth.force,
        truth.force_error,
        message,
        (declared.mesh.degree, declared.way.element),
        "naive" if rim > _NAIVE else "graded",
        refused=not case.is_ok and not message,
    )


def _name(scene: Section, mesh: Section) -> str:
    body, probe = scene["body"], scene["probe"]
    at = f" at {' '.join(probe['at'])}" if "at" in probe else ""
    along = f" along {probe['direction'][0]:.2f} {probe['direction'][1]:.2f}" if "direction" in probe else ""
    tool = f"{probe['shape']} {probe.get('length') or probe.get('axes', probe.get('radius'))}{along}{at}"
    if "incision" in probe:
        tool += f" in a slit of {probe['incision']}, ends {probe['ends']},"
    sizes = f"rim {mesh['rim']} growth {mesh['growth']} fine {mesh['fine']}" if "rim" in mesh else "truth"
    return (
        f"{body['shape']} {_size(body)} on its {body['fixed']}{_regions(body)}, {tool} {probe['contact']},"
        f" ν {scene['material']['poisson']:g},"
        f" degree {mesh.get('degree', '-')} {sizes} ε {mesh.get('epsilon', '-')} {mesh.get('outside', '')}"
    )


def _size(body: Section) -> str:
    """Return the size of a body as text."""
    if body["shape"] == "surface":
        return str(body["file"])
    if body["shape"] == "cylinder":
        return f"{body['radius']} × {body['height']}"
    return " × ".join(body["axes"] if body["shape"] == "ellipsoid" else body["size"])


def _regions(body: Section) -> str:
    """Return the regions of a body as text."""
    layers, inclusions = body.get("layer", ()), body.get("inclusion", ())
    sizes = [piece["thickness"] for piece in layers]
    sizes += [f"{p.get('radius') or ' × '.join(p['axes'])} at {' '.join(p['at'])}" for p in inclusions]
    return "".join(
        f", {piece['name']} {size} E {piece['young']} ν {piece['poisson']:g}"
        for piece, size in zip((*layers, *inclusions), sizes, strict=True)
    )


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = options(__doc__, writes=False)
    parser.add_argument("--family", choices=list(FAMILIES), default="design")
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args(arguments)
    comm = MPI.COMM_WORLD
    speaks = comm.rank == 0
    with ended_soon():
        thrown = trials(comm, asked.count, asked.seed, asked.family)
        told = tuple(each(thrown, _line if speaks and not asked.json else None))
    found = Coverage(told, FAMILIES[asked.family].idle)
    if speaks:
        print(json.dumps(_data(found), indent=2, ensure_ascii=False) if asked.json else found)
    return int(not found.is_met)


def _data(found: Coverage) -> object:
    groups = [group.row for group in found.groups]
    return finite({"met": found.is_met, "groups": groups, "trials": [asdict(trial) for trial in found.trials]})


def _line(trial: Trial) -> str:
    verdict = "refused" if trial.refused else "ok" if trial.is_held else "OUT"
    return f"{verdict:7} error {100 * trial.error:8.4f} %  bar {100 * trial.bar:8.4f} %  {trial.name} {trial.message}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
