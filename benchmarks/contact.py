"""Cost of unilateral contact, relative to a prescribed footprint on the same mesh, and over many depths.

    python -m benchmarks.contact

Times are processor seconds, medians of alternating runs; forms are compiled before. A linear solve is the cost of a
frictionless footprint on the mesh of a ball: spaces, assembly, set-up and iterations. The limit for unilateral contact
is four linear solves, and for its error bar that of a prescribed footprint. It runs for about a minute.
"""

import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

from mpi4py import MPI

from benchmarks.processor import by_turns, median_seconds
from benchmarks.scenes import graded, study
from benchmarks.tables import options, write
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.plan.plan import make_plan
from epsmesh.plan.symmetry import model_planes
from epsmesh.run.execute import compute
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Case
from epsmesh.study.read import parse

_REPEATS = 3
_BODY = {"shape": "cylinder", "radius": "6 mm", "height": "5 mm", "fixed": "bottom"}
_BALL = {"shape": "sphere", "radius": "10 mm", "contact": "unilateral"}
_DEPTHS = [f"{0.05 + 0.2 * n / 11:.6g} mm" for n in range(12)]
# Ways to solve many depths: reductions left out, and whether all depths have one mesh.
_WAYS: dict[str, tuple[tuple[str, ...], bool]] = {
    "a mesh for each depth": (("initial-guess", "condensed"), False),
    "one mesh, each depth by itself": (("initial-guess", "condensed"), True),
    "initial guess from neighbouring depths": (("condensed",), True),
    "condensed": ((), True),
}


def _study(poisson: float, rim: str, depth: str | list[str], **probe: Any) -> dict[str, Any]:
    return study(_BODY, poisson, _BALL | {"depth": depth} | probe, graded("2 mm", "2 mm", rim, 0.5, degree=2))


def found(body: BodyMesh, case: Case, *, estimate: bool) -> Solution:
    """Solve a case with unilateral contact on its mesh; collective."""
    with Spaces(body) as spaces, problem_of(spaces, case) as problem:
        return problem.solve(law_of(case), movement_of(case), estimate=estimate)


def prescribed(body: BodyMesh, case: Case, *, estimate: bool) -> Solution:
    """Solve with the whole candidate region as a frictionless footprint, on the same mesh; collective."""
    with (
        Spaces(body) as spaces,
        QuasiStaticProblem(spaces, case.mesh.degree, Conditions(bonded=False), case.way.element) as problem,
    ):
        return problem.solve(law_of(case), movement_of(case), estimate=estimate)


def in_linear_solves(poisson: float, rim: str = "0.12 mm", repeats: int = _REPEATS) -> dict[str, Any]:
    """Return the cost of unilateral contact in units of a prescribed footprint's, without and with the error bar."""
    (case,) = parse(_study(poisson, rim, "0.1 mm")).cases()
    body = mesh_case(case, model_planes(case), MPI.COMM_SELF)
    ways: dict[str, Callable[[], Solution]] = {
        f"{name}, {what}": partial(solve, body, case, estimate=estimate)
        for name, solve in (("found", found), ("prescribed", prescribed))
        for what, estimate in (("force", False), ("force and bar", True))
    }
    solutions = {name: way() for name, way in ways.items()}  # also compiles
    spent = median_seconds(ways, repeats)
    return {
        "poisson": poisson,
        "element": case.way.element,
        "dofs": solutions["found, force"].dofs,
        "seconds": spent,
        "linear solves": spent["found, force"] / spent["prescribed, force"],
        "with the error bar": spent["found, force and bar"] / spent["prescribed, force and bar"],
    }


def sweeps(repeats: int = _REPEATS) -> dict[str, dict[str, float]]:
    """Return the time of twelve depths, with meshes and error bars, in each way, and the difference in F."""
    found = by_turns({name: partial(_sweep, *way) for name, way in _WAYS.items()}, repeats)
    (_, plain), *_ = found["one mesh, each depth by itself"]
    return {
        name: {
            "seconds": median(seconds for seconds, _ in runs),
            "F differs by": max(abs(force / other - 1) for force, other in zip(runs[0][1], plain, strict=True)),
        }
        for name, runs in found.items()
    }


def _sweep(without: tuple[str, ...], on_one: bool) -> tuple[float, list[float]]:
    """Return the seconds of twelve depths, and the forces (N)."""
    probe = {"mesh_depths": [_DEPTHS[0], _DEPTHS[-1]]} if on_one else {}
    plan = make_plan(parse(_study(0.3, "0.3 mm", _DEPTHS, **probe)), without=("axisymmetric", *without))
    start = time.process_time()
    records = compute(plan, MPI.COMM_SELF)
    return time.process_time() - start, [records[key].force for key in plan.keys]


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--repeats", type=int, default=_REPEATS)
    asked = parser.parse_args()
    rows = [in_linear_solves(poisson, repeats=asked.repeats) for poisson in (0.3, 0.49)]
    for row in rows:
        print(
            f"ball, ν = {row['poisson']:g}, {row['dofs']:,} dofs of {row['element']} elements: contact takes "
            f"{row['linear solves']:.1f} linear solves (limit: 4), with the error bar {row['with the error bar']:.1f} "
            "times a prescribed footprint with its bar"
        )
    depths = sweeps(asked.repeats)
    for name, values in depths.items():
        print(f"12 depths, {name}: {values['seconds']:.2f} s, F differs by {values['F differs by']:.0e}")
    write("contact", asked.output, {"found": rows, "depths": depths})


if __name__ == "__main__":
    main()
