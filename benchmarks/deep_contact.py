"""Error bars of contact at large displacements: random scenes on coarse meshes, compared with finer meshes of degree 3.

    python -m benchmarks.deep_contact [--count N] [--seed N] [--set calibrate|judge] [--family F] [--degree 2|3]
                                      [--out FILE]

Scenes are those of :mod:`benchmarks.deep_scenes`: tools on cylinders and boxes, some layered, of five laws, with ν from
0.3 to 0.5. Each line of the output has the force, the change of one degree more, the bar, and the force of the finer
mesh. With friction, that mesh has degree 2, and twice as many load steps.
"""

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from benchmarks.campaigns import ended_soon
from benchmarks.deep_scenes import FAMILIES, RADIUS, SETS, Scene, thrown
from benchmarks.families import Dice, mm
from benchmarks.tables import options
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.tools import tool_of
from epsmesh.solve import SolveError
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.contact.large import LargeContact
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Case
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse

SEED, COUNT = 11, 60
# Elements of the finer mesh, relative to those of the case, and their largest size, without and with friction.
_FINER, _FINEST = 0.55, 0.3
_FINER_RUBBING, _FINEST_RUBBING = 0.45, 0.22


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


@contextmanager
def more_steps() -> Iterator[None]:
    """Take twice as many load steps with friction."""
    usual = LargeContact.STEPS
    LargeContact.STEPS = 2 * usual
    try:
        yield
    finally:
        LargeContact.STEPS = usual


def truth_of(scene: Scene) -> float:
    """Return the force (N) on a finer mesh."""
    if "friction" not in scene.sections["probe"]:
        return solved(scene, min(_FINER, _FINEST / scene.rim), 3, estimate=False).reaction[2]
    with more_steps():
        return solved(scene, min(_FINER_RUBBING, _FINEST_RUBBING / scene.rim), 2, estimate=False).reaction[2]


def solved(scene: Scene, finer: float, degree: int, *, estimate: bool) -> Solution:
    """Solve a scene, with elements ``finer`` than its own at the edge of contact by this factor."""
    case = case_of(scene, finer, degree)
    with Spaces(mesh_case(case, mirror_planes(case), MPI.COMM_SELF)) as spaces:
        problem = QuasiStaticProblem(spaces, degree, WITHOUT_FOOTPRINT, case.way.element, tool=tool_of(case))
        return problem.solve(law_of(case), movement_of(case), estimate=estimate)


def case_of(scene: Scene, finer: float, degree: int) -> Case:
    """Return the case of a scene.

    Raises:
        StudyError: if it is not valid.
    """
    mesh = {"epsilon": "full", "degree": degree, "growth": 0.9, "coarse": mm(2.5 * RADIUS), "fine": mm(2 * RADIUS)}

    def parsed(rim: float) -> Case:
        (case,) = parse({**scene.sections, "mesh": mesh | {"rim": mm(rim, ".4f")}, "solve": {"exact": False}}).cases()
        return case

    unit = scene.unit or 1e3 * parsed(RADIUS).probe.contact_width
    return parsed(finer * scene.rim * unit)


def trial(scene: Scene, degree: int) -> Trial:
    """Solve a scene on its mesh and on a finer one."""
    start, force, bar, share, area_bar, truth, message = time.process_time(), *[float("nan")] * 5, ""
    try:
        coarse = solved(scene, 1.0, degree, estimate=True)
        assert coarse.contact is not None
        force, bar = coarse.reaction[2], coarse.bar
        share, area_bar = 0.8 * coarse.decrement, coarse.contact.bar - bar
        truth = truth_of(scene)
    except SolveError as error:
        message = str(error)
    name = f"{scene.name} rim {scene.rim:g} degree {degree}"
    return Trial(name, force, bar, share, area_bar, truth, time.process_time() - start, message)


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = options(__doc__, writes=False)
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--set", choices=list(SETS), default="calibrate")
    parser.add_argument("--family", choices=FAMILIES, default="round")
    parser.add_argument("--degree", type=int, choices=[2, 3], default=2)
    parser.add_argument("--out", type=Path, help="a line of JSON for each scene")
    asked = parser.parse_args(arguments)
    dice, found = Dice(np.random.default_rng(asked.seed)), list[Trial]()
    with ended_soon():
        while len(found) < asked.count:
            scene = thrown(dice, SETS[asked.set], asked.family)
            try:
                case_of(scene, 1.0, asked.degree)
            except StudyError:  # an invalid draw
                continue
            found.append(trial(scene, asked.degree))
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
