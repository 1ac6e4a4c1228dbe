"""Error bars of contact at large displacements: random scenes on coarse meshes, compared with finer meshes of degree 3.

    python -m benchmarks.deep_contact [--count N] [--seed N] [--set calibrate|judge] [--out FILE]

Scenes are balls and cones on cylinders and boxes, some layered, of five laws, with ν from 0.3 to 0.5. The two
sets have bodies and tools of other proportions: factors are read off one, and judged on the other. Each line of the
output has the force, the change of degree 3, the bar, and the force of the finer mesh.
"""

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.campaigns import ended_soon
from benchmarks.families import Dice, mm
from benchmarks.tables import options
from pipeline.plan.symmetry import mirror_planes
from pipeline.run.meshing import mesh_case
from pipeline.run.problem import law_of, movement_of, tool_of
from pipeline.solve import SolveError
from pipeline.solve.contact.surface import CONDITIONS
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.solution import Solution
from pipeline.solve.spaces import Spaces
from pipeline.study.case import Case
from pipeline.study.problems import StudyError
from pipeline.study.read import parse

SEED, COUNT = 11, 60
RADIUS = 4.0
_LAWS: dict[str, dict[str, Any]] = {
    "neo-hookean": {},
    "mooney-rivlin": {"c2": 0.3},
    "yeoh": {"c2": 0.3},
    "ogden": {"terms": [{"share": 0.7, "alpha": 2.0}, {"share": 0.3, "alpha": 7.0}]},
    "veronda-westmann": {"alpha": 1.2},
}
_POISSON = (0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
# Ranges of each set: depth, height and radius of the body, in radii of the tool; size of elements at the edge of
# contact, in half widths of contact.
_SETS = {
    "calibrate": {"depth": (0.05, 0.7), "height": (1.5, 5.0), "wide": (3.0, 6.0), "rim": (0.25, 0.7)},
    "judge": {"depth": (0.08, 0.6), "height": (1.2, 7.0), "wide": (2.5, 8.0), "rim": (0.22, 0.75)},
}
# Elements of the finer mesh, relative to those of the case, and their largest size.
_FINER, _FINEST = 0.55, 0.3


@dataclass(frozen=True)
class Trial:
    """One scene: its force (N), relative bar, share that degree 3 removes, and the force of the finer mesh."""

    name: str
    force: float
    bar: float
    share: float
    area_bar: float
    truth: float
    seconds: float
    message: str = ""

    @property
    def error(self) -> float:
        """The relative error."""
        return abs(self.truth / self.force - 1)


def thrown(dice: Dice, ranges: dict[str, tuple[float, float]]) -> tuple[str, dict[str, Any], float]:
    """Return a scene: its name, its sections without a mesh, and the size of elements in half widths of contact."""
    law, poisson = dice.one_of(list(_LAWS)), dice.one_of(list(_POISSON))
    depth, height, wide = (dice.log(*ranges[key]) for key in ("depth", "height", "wide"))
    kind = dice.one_of(["sphere", "sphere", "cone"])
    probe: dict[str, Any] = {"shape": kind, "depth": mm(RADIUS * depth), "contact": "unilateral"}
    if kind == "sphere":
        probe["radius"] = mm(RADIUS)
    else:
        probe |= {"angle": f"{dice.between(60.0, 78.0, 1)} deg", "tip": mm(dice.log(1.0, 3.0))}
        probe["radius"] = mm(3 * RADIUS)
    body: dict[str, Any] = {"shape": "cylinder", "radius": mm(RADIUS * wide), "height": mm(RADIUS * height)}
    if dice.chance(0.3):
        size = [mm(2 * RADIUS * wide), mm(2 * RADIUS * wide), mm(RADIUS * height)]
        body = {"shape": "box", "size": size}
    if dice.chance(0.2):
        skin = {"name": "skin", "thickness": mm(0.25 * RADIUS * height), "young": "30 kPa", "poisson": poisson}
        body["layer"] = [skin]
    material = {"young": "10 kPa", "poisson": poisson, "law": law} | _LAWS[law]
    name = f"{kind} {law} ν {poisson:g} d/R {depth:.2f} h/R {height:.1f}{' skin' if 'layer' in body else ''}"
    return (
        name,
        {"body": body | {"fixed": "bottom"}, "material": material, "probe": probe},
        dice.between(*ranges["rim"], 2),
    )


def solved(scene: dict[str, Any], rim: float, degree: int, *, estimate: bool) -> Solution:
    """Solve a scene with elements of a size at the edge of contact, in half widths of contact."""
    case = _case(scene, rim, degree)
    with Spaces(mesh_case(case, mirror_planes(case), MPI.COMM_SELF)) as spaces:
        problem = QuasiStaticProblem(spaces, degree, CONDITIONS, case.element, tool=tool_of(case))
        return problem.solve(law_of(case), movement_of(case), estimate=estimate)


def _case(scene: dict[str, Any], rim: float, degree: int) -> Case:
    mesh = {"epsilon": "full", "degree": degree, "growth": 0.9, "coarse": mm(2.5 * RADIUS), "fine": mm(2 * RADIUS)}
    (case,) = parse({**scene, "mesh": mesh | {"rim": mm(RADIUS)}, "solve": {"exact": False}}).cases()
    size = mm(1e3 * rim * case.probe.contact_width, ".4f")
    (case,) = parse({**scene, "mesh": mesh | {"rim": size}, "solve": {"exact": False}}).cases()
    return case


def trial(name: str, scene: dict[str, Any], rim: float) -> Trial:
    """Solve a scene on its mesh and on a finer one."""
    start, force, bar, share, area_bar, truth, message = time.process_time(), *[float("nan")] * 5, ""
    try:
        coarse = solved(scene, rim, 2, estimate=True)
        assert coarse.contact is not None
        force, bar = coarse.reaction[2], coarse.bar
        share, area_bar = 0.8 * coarse.decrement, coarse.contact.bar - bar
        truth = solved(scene, min(_FINER * rim, _FINEST), 3, estimate=False).reaction[2]
    except SolveError as error:
        message = str(error)
    return Trial(f"{name} rim {rim:g}", force, bar, share, area_bar, truth, time.process_time() - start, message)


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = options(__doc__, writes=False)
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--set", choices=list(_SETS), default="calibrate")
    parser.add_argument("--out", type=Path, help="a line of JSON for each scene")
    asked = parser.parse_args(arguments)
    dice, found = Dice(np.random.default_rng(asked.seed)), list[Trial]()
    with ended_soon():
        while len(found) < asked.count:
            name, scene, rim = thrown(dice, _SETS[asked.set])
            try:
                _case(scene, rim, 2)
            except StudyError:  # an invalid draw
                continue
            found.append(trial(name, scene, rim))
            print(_line(found[-1]), flush=True)
            if asked.out:
                with asked.out.open("a") as lines:
                    lines.write(json.dumps(asdict(found[-1])) + "\n")
    served = [each for each in found if not each.message]
    held = sum(each.error <= each.bar for each in served)
    median = float(np.median([each.bar / each.error for each in served]))
    print(f"{held} of {len(served)} bars hold; median of bar / error {median:.2f}; {len(found) - len(served)} failed")
    return int(held < 0.95 * len(served))


def _line(each: Trial) -> str:
    verdict = "FAILED" if each.message else "ok" if each.error <= each.bar else "OUT"
    return (
        f"{verdict:7} error {100 * each.error:7.3f} %  bar {100 * each.bar:7.3f} %  share {100 * each.share:7.3f} %  "
        f"{each.seconds:5.0f} s  {each.name} {each.message}"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
