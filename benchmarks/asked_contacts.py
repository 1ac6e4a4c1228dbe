"""What an accuracy gives where a body has two contacts: random grasps, supports that let go and loose layers.

    python -m benchmarks.asked_contacts [--further] [--count N] [--seed N] [--minutes N] [--output FOLDER]

Each scene is asked for 1 %, with a tool in the middle of a box. With `--further` they have paths of friction, jaws are
on an organ, or a support is round, and 2 % is asked. The truth has elements of degree 3, at the edge of contact of 0.6
of the size of the first mesh, and as many steps of friction. Beside the first kinds, equal elements in the whole body
are solved, with as many unknowns.
"""

import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
from pathlib import Path
from random import Random
from statistics import median
from typing import Any

from benchmarks.machine import machine
from benchmarks.scenes import record_of
from benchmarks.tables import markdown, options, write
from epsmesh.plan.plan import make_plan
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.isolated import isolated

ASKED, ASKED_FURTHER = 0.01, 0.02
SEED, COUNT = 7500, 60
JAWS, SUPPORT, LAYER = KINDS = ("two jaws", "support that lets go", "loose layer")
RUBBING = {f"{kind} with friction": kind for kind in KINDS}
ORGAN, ROUND = "jaws on an organ", "round support"
FURTHER = (*RUBBING, ORGAN, ROUND)
# Scenes of the first kinds in turn: loose layers take many times as long.
_TURNS = (JAWS, SUPPORT, JAWS, SUPPORT, JAWS, SUPPORT, LAYER)
TOOLS = ("ball", "disc", "blade", "cone")
# Sizes of the truth's elements over those of the first mesh: at the edge of contact, and their growth.
_RIM, _GROWTH, _DEGREE = 0.6, 0.85, 3
# Bars are those of 95 %; at least this share of the scenes must have an error.
_OFF, _JUDGED = 0.05, 0.5
_ROUND, _MESHES = ("cylinder", "sphere"), Path(__file__).resolve().parents[1] / "meshes"
# Volume of a tetrahedron over the cube of its size, and unknowns for each, in degree 2.
_TETRAHEDRON, _UNKNOWNS = 0.21, 4.4
_COLUMNS = dict.fromkeys(
    (
        "scene", "cases", "reached", "bar / asked", "error / asked", "error below bar", "unknowns",
        "bar on equal elements", "processor time",
    ), "",
)  # fmt: skip

# Seconds after which a scene with its truth is given up, and what is told of it.
_LONGEST, _LONGEST_FURTHER = 75.0, 900.0
_TOO_LONG = ("not judged", *(math.nan,) * 3, 0, 0, math.nan, math.nan, "took too long")

Study = dict[str, Any]


@dataclass(frozen=True)
class Trial:
    """One scene: bars and true error relative to F, that of the truth, unknowns, and processor time (s)."""

    seed: int
    kind: str
    tool: str
    status: str
    bar: float
    error: float
    truth: float
    dofs: int
    degree: int
    seconds: float
    equal: float
    message: str
    asked: float = ASKED

    @property
    def is_judged(self) -> bool:
        """Whether its force was compared with a truth."""
        return math.isfinite(self.error)

    @property
    def holds(self) -> bool:
        """Whether its error is below its bar; a bar that is none holds nothing."""
        return self.error <= self.bar


def drawn(seed: int, *, further: bool = False) -> tuple[str, str, Study]:
    """Return kind, tool and study of a seed, of the ``further`` kinds or the first ones."""
    if not further:
        return _drawn(_TURNS[seed % len(_TURNS)], Random(f"asked contacts {seed}"))
    named, dice = FURTHER[seed % len(FURTHER)], Random(f"asked further contacts {seed}")
    while True:
        kind, tool, study = _drawn(RUBBING.get(named, SUPPORT if named == ROUND else JAWS), dice)
        first, body = study["probe"][0] if kind == JAWS else study["probe"], study["body"]
        coefficient = float(f"{dice.uniform(0.1, 0.6):.2g}")
        if named == ORGAN:
            tool, study = _on_organ(dice)
        elif named == ROUND:
            radius = f"{dice.uniform(20, 80):.3g} mm"
            body["support"] = {"on": "bottom", "friction": 0, "radius": radius, "shape": dice.choice(_ROUND)}
        elif kind == JAWS:
            first["friction"] = coefficient
        else:
            (body["support"] if kind == SUPPORT else body["layer"][0])["friction"] = coefficient
        try:
            parse(study | {"mesh": {"accuracy": "1 %"}})
        except StudyError:  # such as a coefficient at large displacements
            continue
        return named, tool, study


def _on_organ(dice: Random) -> tuple[str, Study]:
    """Return tool and study of jaws on one or two organs of a label map."""
    names, file = (str(_MESHES / name) for name in ("organs.txt", "organs.nii.gz"))
    body: Study = {
        "shape": "image",
        "file": file,
        "names": names,
        "label": "liver",
        "fixed": {"below": "-14 mm"},
    }
    body["region"] = [
        {"name": "stomach", "label": "stomach", "young": f"{dice.uniform(5, 30):.3g} kPa", "poisson": 0.4}
    ]
    first: Study = {"at": ["-14 mm", "0 mm", f"{dice.choice((-2, 14))} mm"], "axis": [1, 0, 0], "together": "grasp"}
    first |= {"shape": "sphere", "contact": "unilateral", "radius": f"{dice.uniform(3, 6):.3g} mm"}
    first["depth"] = f"{dice.uniform(0.15, 0.5):.2g} mm"
    material: Study = {"young": "10 kPa", "poisson": dice.choice((0.3, 0.4, 0.45))}
    return "ball", {
        "body": body,
        "material": material,
        "probe": [first, {"together": "grasp"}],
        "solve": {"exact": False},
    }


def _drawn(kind: str, dice: Random) -> tuple[str, str, Study]:
    while True:
        study: Study = {}
        name = dice.choice(TOOLS)
        side, height = dice.uniform(16, 36), dice.uniform(6, 16)
        material: Study = {
            "young": "10 kPa",
            "poisson": dice.choice((0.3, 0.35, 0.4, 0.44, 0.48) if kind != LAYER else (0.3, 0.4)),
        }
        body: Study = {"shape": "box", "size": [f"{side:.3g} mm", f"{dice.uniform(16, 36):.3g} mm", f"{height:.3g} mm"]}
        probe = _tool(name, dice)
        if kind == JAWS:
            second = dice.choice(({}, {}, _tool(dice.choice(TOOLS), dice)))
            body["fixed"] = dice.choice(("none", "sides"))
            study["probe"] = [probe | {"together": "grasp"}, second | {"together": "grasp"}]
        else:
            study["probe"] = probe
        if kind == SUPPORT:
            body |= {"fixed": "none", "support": {"on": "bottom", "friction": dice.choice((0, "stick"))}}
            if dice.random() < 0.4:
                study["load"] = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
                material["density"] = "1060 kg/m^3"
        if kind == LAYER:
            layer = {"name": "flap", "thickness": f"{dice.uniform(0.2, 0.5) * height:.3g} mm", "contact": "unilateral"}
            layer |= {"young": f"{dice.uniform(4, 30):.3g} kPa", "poisson": material["poisson"]}
            body |= {"fixed": "bottom", "layer": [layer | {"friction": dice.choice((0, "stick"))}]}
        elif dice.random() < 0.3 and name in ("ball", "cone"):
            material["law"] = "neo-hookean"
        study |= {"body": body, "material": material, "solve": {"exact": False}}
        try:
            parse(study | {"mesh": {"accuracy": "1 %"}})
        except StudyError:  # such as a footprint over the edge
            continue
        return kind, name, study


def _tool(name: str, dice: Random) -> Study:
    size = dice.uniform(2, 5)
    shapes: dict[str, Study] = {
        "ball": {"shape": "sphere", "radius": f"{1.5 * size:.3g} mm"},
        "disc": {"shape": "disc", "radius": f"{size:.3g} mm"},
        "blade": {"shape": "blade", "length": f"{2 * size:.3g} mm", "width": f"{dice.uniform(1.5, 4):.3g} mm"},
        "cone": {"shape": "cone", "angle": "70 deg", "radius": "8 mm", "tip": "1.5 mm"},
    }
    depth = math.exp(dice.uniform(math.log(0.1), math.log(0.4)))
    return shapes[name] | {"depth": f"{depth:.2g} mm", "contact": "unilateral"}


def trials(count: int, seed: int, minutes: float, *, further: bool = False) -> Iterator[Trial]:
    """Yield the trials of ``count`` scenes, until the ``minutes`` are over."""
    end = time.monotonic() + 60 * minutes
    timely = takewhile(lambda _: time.monotonic() < end, range(seed, seed + count))
    longest = _LONGEST_FURTHER if further else _LONGEST
    for (number, *_), trial in isolated(_trial, ((number, further) for number in timely), longest):
        kind, tool, _ = drawn(number, further=further)
        yield trial if isinstance(trial, Trial) else Trial(number, kind, tool, *_TOO_LONG)


def _trial(seed: int, further: bool) -> Trial:
    kind, tool, study = drawn(seed, further=further)
    goal = ASKED_FURTHER if further else ASKED
    asked = study | {"mesh": {"accuracy": f"{100 * goal:g} %"}}
    start = time.process_time()
    found = record_of(asked)
    seconds = time.process_time() - start
    (solve,) = make_plan(parse(asked)).solves
    mesh, images = solve.case.mesh, 2.0 ** len(solve.mirrors)
    rim = _RIM * min(size for size in (mesh.rim, mesh.jaw_rim, mesh.fine) if size)
    sizes = {"epsilon": mesh.epsilon, "fine": mesh.fine, "coarse": mesh.coarse, "rim": rim}
    finer: Study = {key: f"{size:.6g} m" for key, size in sizes.items()}
    truth = record_of(study | {"mesh": finer | {"growth": _GROWTH * mesh.growth, "degree": _DEGREE}})
    messages, of_equal = [found.message, truth.message], math.nan
    if not further and found.dofs:
        size = (solve.case.body.volume / images / (_TETRAHEDRON * found.dofs / images / _UNKNOWNS)) ** (1 / 3)
        size = min(size, solve.case.body.thickness(solve.case.frame))
        same = dict.fromkeys(("fine", "coarse", "rim"), f"{size:.4g} m")
        equal = record_of(study | {"mesh": same | {"epsilon": "full", "growth": 1.0}})
        of_equal = equal.force_error if equal.is_ok else math.nan
        messages.append(equal.message)
    return Trial(
        seed, kind, tool, found.status, found.force_error, abs(found.force / truth.force - 1), truth.force_error,
        found.dofs, mesh.degree, seconds, of_equal, " | ".join(filter(None, messages))[:200], goal,
    )  # fmt: skip


def table(found: Sequence[Trial]) -> str:
    """Return, in markdown, medians and largest values by kind and by tool."""
    rows = []
    for name in (*KINDS, *FURTHER, *TOOLS, "all"):
        own = [trial for trial in found if name in (trial.kind, trial.tool, "all")]
        met = [trial for trial in own if trial.status == "ok"]
        known = [trial for trial in met if trial.is_judged]
        if known:
            equal = [trial.equal / trial.bar for trial in known if math.isfinite(trial.equal)]
            rows.append({
                "scene": name,
                "cases": sum(trial.status != "not judged" for trial in own),
                "reached": len(met),
                "bar / asked": _both([trial.bar / trial.asked for trial in met]),
                "error / asked": _both([trial.error / trial.asked for trial in known]),
                "error below bar": f"{sum(trial.holds for trial in known)} of {len(known)}",
                "unknowns": f"{median(trial.dofs for trial in met):,.0f}",
                "bar on equal elements": f"{median(equal):.1f} times" if equal else "",
                "processor time": f"{median(trial.seconds for trial in met):.1f} s",
            })  # fmt: skip
    return markdown(rows, _COLUMNS)


def verdict(found: Sequence[Trial]) -> str:
    """Return what is wrong, "" if nothing: too many errors above their bars, or too few scenes with an error at all."""
    judged = [trial for trial in found if trial.is_judged]
    if len(judged) < max(_JUDGED * len(found), 1):
        return f"only {len(judged)} of {len(found)} scenes are judged"
    off = sum(not trial.holds for trial in judged)
    above = sum(trial.status == "ok" and not trial.bar <= trial.asked for trial in judged)
    if off > _OFF * len(judged):
        return f"{off} of {len(judged)} errors are above their bars"
    return f"{above} bars are above what was asked, without a word" if above else ""


def _both(values: Sequence[float]) -> str:
    return f"{median(values):.2f}, {max(values):.2f}"


def main(arguments: list[str]) -> int:
    """Run, print, write; return 1 if more than 5 % of the errors exceed their bars, or half of them are unknown."""
    parser = options(__doc__)
    parser.add_argument("--further", action="store_true", help=", ".join(FURTHER))
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after this time")
    chosen = parser.parse_args(arguments)
    found: list[Trial] = []
    for trial in trials(chosen.count, chosen.seed, chosen.minutes, further=chosen.further):
        found.append(trial)
        print(json.dumps(asdict(trial)), flush=True)
    text = table(found)
    content = {"machine": machine(), "seed": chosen.seed, "trials": [asdict(trial) for trial in found]}
    write("asked_contacts", chosen.output, content, text)
    wrong = verdict(found)
    print("", text, wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
