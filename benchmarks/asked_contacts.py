"""What an accuracy gives where a body has two contacts: random grasps, supports that let go and loose layers.

    python -m benchmarks.asked_contacts [--count N] [--seed N] [--minutes N] [--output FOLDER]

Each scene is asked for 1 %, with a tool in the middle of a box, without paths of friction. The truth has elements of
degree 3, at the edge of contact of 0.6 of the size of the first mesh. Beside it, equal elements in the whole
body are solved, with as many unknowns.
"""

import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import takewhile
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

ASKED = 0.01
SEED, COUNT = 7500, 60
KINDS = ("two jaws", "support that lets go", "loose layer")
# Scenes of these in turn: loose layers take many times as long.
_TURNS = (0, 1, 0, 1, 0, 1, 2)
TOOLS = ("ball", "disc", "blade", "cone")
# Sizes of the truth's elements over those of the first mesh: at the edge of contact, and their growth.
_RIM, _GROWTH, _DEGREE = 0.6, 0.85, 3
# Volume of a tetrahedron over the cube of its size, and unknowns for each, in degree 2.
_TETRAHEDRON, _UNKNOWNS = 0.21, 4.4
_COLUMNS = dict.fromkeys(
    (
        "scene", "cases", "reached", "bar / asked", "error / asked", "error below bar", "unknowns",
        "bar on equal elements", "processor time",
    ), "",
)  # fmt: skip

# Seconds after which a scene with its truth is given up, and what is told of it.
_LONGEST = 75.0
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


def drawn(seed: int) -> tuple[str, str, Study]:
    """Return kind, tool and study of a seed."""
    dice = Random(f"asked contacts {seed}")
    while True:
        kind, study = KINDS[_TURNS[seed % len(_TURNS)]], {}
        name = dice.choice(TOOLS)
        side, height = dice.uniform(16, 36), dice.uniform(6, 16)
        material = {
            "young": "10 kPa",
            "poisson": dice.choice((0.3, 0.35, 0.4, 0.44, 0.48) if kind != KINDS[2] else (0.3, 0.4)),
        }
        body: Study = {"shape": "box", "size": [f"{side:.3g} mm", f"{dice.uniform(16, 36):.3g} mm", f"{height:.3g} mm"]}
        probe = _tool(name, dice)
        if kind == "two jaws":
            second = dice.choice(({}, {}, _tool(dice.choice(TOOLS), dice)))
            body["fixed"] = dice.choice(("none", "sides"))
            study["probe"] = [probe | {"together": "grasp"}, second | {"together": "grasp"}]
        else:
            study["probe"] = probe
        if kind == "support that lets go":
            body |= {"fixed": "none", "support": {"on": "bottom", "friction": dice.choice((0, "stick"))}}
            if dice.random() < 0.4:
                study["load"] = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
                material["density"] = "1060 kg/m^3"
        if kind == "loose layer":
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


def trials(count: int, seed: int, minutes: float) -> Iterator[Trial]:
    """Yield the trials of ``count`` scenes, until the ``minutes`` are over."""
    end = time.monotonic() + 60 * minutes
    timely = takewhile(lambda _: time.monotonic() < end, range(seed, seed + count))
    for (number, *_), trial in isolated(_trial, ((number,) for number in timely), _LONGEST):
        yield trial if isinstance(trial, Trial) else Trial(number, *drawn(number)[:2], *_TOO_LONG)


def _trial(seed: int) -> Trial:
    kind, tool, study = drawn(seed)
    asked = study | {"mesh": {"accuracy": f"{100 * ASKED:g} %"}}
    start = time.process_time()
    found = record_of(asked)
    seconds = time.process_time() - start
    (solve,) = make_plan(parse(asked)).solves
    mesh, images = solve.case.mesh, 2.0 ** len(solve.mirrors)
    rim = _RIM * min(size for size in (mesh.rim, mesh.jaw_rim, mesh.fine) if size)
    sizes = {"epsilon": mesh.epsilon, "fine": mesh.fine, "coarse": mesh.coarse, "rim": rim}
    finer: Study = {key: f"{size:.6g} m" for key, size in sizes.items()}
    truth = record_of(study | {"mesh": finer | {"growth": _GROWTH * mesh.growth, "degree": _DEGREE}})
    size = (solve.case.body.volume / images / (_TETRAHEDRON * found.dofs / images / _UNKNOWNS)) ** (1 / 3)
    size = min(size, solve.case.body.thickness(solve.case.frame))
    equal = record_of(
        study | {"mesh": dict.fromkeys(("fine", "coarse", "rim"), f"{size:.4g} m") | {"epsilon": "full", "growth": 1.0}}
    )
    return Trial(
        seed, kind, tool, found.status, found.force_error, abs(found.force / truth.force - 1), truth.force_error,
        found.dofs, mesh.degree, seconds, equal.force_error if equal.is_ok else math.nan,
        " | ".join(filter(None, (found.message, truth.message, equal.message)))[:200],
    )  # fmt: skip


def table(found: Sequence[Trial]) -> str:
    """Return, in markdown, medians and largest values by kind and by tool."""
    rows = []
    for name in (*KINDS, *TOOLS, "all"):
        own = [trial for trial in found if name in (trial.kind, trial.tool, "all")]
        met = [trial for trial in own if trial.status == "ok"]
        known = [trial for trial in met if math.isfinite(trial.error)]
        if known:
            equal = [trial.equal / trial.bar for trial in known if math.isfinite(trial.equal)]
            rows.append({
                "scene": name,
                "cases": sum(trial.status != "not judged" for trial in own),
                "reached": len(met),
                "bar / asked": _both([trial.bar / ASKED for trial in met]),
                "error / asked": _both([trial.error / ASKED for trial in known]),
                "error below bar": f"{sum(trial.error <= trial.bar for trial in known)} of {len(known)}",
                "unknowns": f"{median(trial.dofs for trial in met):,.0f}",
                "bar on equal elements": f"{median(equal):.1f} times" if equal else "",
                "processor time": f"{median(trial.seconds for trial in met):.1f} s",
            })  # fmt: skip
    return markdown(rows, _COLUMNS)


def _both(values: Sequence[float]) -> str:
    return f"{median(values):.2f}, {max(values):.2f}"


def main(arguments: list[str]) -> int:
    """Run, print, write; return 1 if more than 5 % of the errors exceed their bars."""
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after this time")
    chosen = parser.parse_args(arguments)
    found: list[Trial] = []
    for trial in trials(chosen.count, chosen.seed, chosen.minutes):
        found.append(trial)
        print(json.dumps(asdict(trial)), flush=True)
    text = table(found)
    content = {"machine": machine(), "seed": chosen.seed, "trials": [asdict(trial) for trial in found]}
    write("asked_contacts", chosen.output, content, text)
    print("", text, sep="\n")
    return int(sum(trial.error > trial.bar for trial in found) > 0.05 * len(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
