"""Work against precision: the error of F over run time and unknowns, for every kind of element and mesh.

F of the scene is known to 1e-7: a disc of 3 mm, bonded, on a cylinder of R = H = 50 mm. Runs are warm (forms compiled,
libraries loaded), alone, on one core; times are medians. Run it on an idle machine; it takes ten minutes.
It writes work_precision.json and work_precision.md into the folder of results.
"""

import itertools
import statistics
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.campaigns import ended_soon
from benchmarks.scenes import record_of, study
from benchmarks.tables import Table, options
from epsmesh.mesh.meridian import Meridian
from epsmesh.run.record import Record
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.meridian.problem import MeridianProblem
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from tests.verification import known

POISSON = (0.3, 0.49)
YOUNG, DEPTH = 10e3, 1e-4


@dataclass(frozen=True)
class Method:
    """A method, and the sequence of its meshes, coarse to fine."""

    name: str
    degree: int
    element: str
    meshes: tuple[dict[str, Any], ...]
    without: tuple[str, ...] = ()


def _uniform(*sizes: float) -> tuple[dict[str, Any], ...]:
    return tuple(
        {"epsilon": "full", "fine": f"{h} mm", "coarse": f"{h} mm", "rim": f"{h} mm", "growth": 1.0} for h in sizes
    )


def _graded(*rims: float) -> tuple[dict[str, Any], ...]:
    """Return meshes that grow by 0.4 from ``rims``, in units of the probe's radius."""
    return tuple(
        {"epsilon": "full", "fine": "25 mm", "coarse": "25 mm", "rim": f"{3 * rim:g} mm", "growth": 0.4} for rim in rims
    )


METHODS = (
    Method("P1 uniform", 1, "displacement", _uniform(8, 5, 3, 2)),
    Method("P2 uniform", 2, "displacement", _uniform(12, 8, 5, 3.5)),
    Method("P3 uniform", 3, "displacement", _uniform(16, 12, 8, 5)),
    Method("P1 graded", 1, "displacement", _graded(0.4, 0.2, 0.1, 0.05)),
    Method("P2 graded", 2, "displacement", _graded(0.4, 0.2, 0.1, 0.05)),
    Method("P2 graded, no symmetry", 2, "displacement", _graded(0.4, 0.2, 0.1, 0.05), ("symmetry",)),
    Method("P3 graded", 3, "displacement", _graded(0.4, 0.2, 0.1, 0.05)),
    Method("P2/P1 mixed graded", 2, "mixed", _graded(0.4, 0.2, 0.1, 0.05)),
    Method("P3/P2 mixed graded", 3, "mixed", _graded(0.4, 0.2, 0.1, 0.05)),
)
# Required accuracies, for the automatic choice of meshes in three dimensions.
ASKED = ("2 %", "1 %", "0.3 %", "0.1 %")
AXISYMMETRIC = (4, 5, 6)  # degrees; the error bar of lower ones exceeds the solver's limit
COLUMNS = {
    "method": "",
    "poisson": "g",
    "dofs": "d",
    "seconds": ".3f",
    "estimate_seconds": ".2f",
    "error": ".4%",
    "bar": ".4%",
    "iterations": "d",
}


@dataclass(frozen=True)
class Point:
    """One run of one method: its cost, medians of warm runs in seconds, and the relative error of F."""

    method: str
    poisson: float
    level: int
    error: float
    bar: float
    seconds: float
    estimate_seconds: float
    dofs: int
    iterations: int


def measure(repeats: int, *, quick: bool = False) -> Iterator[Point]:
    """Yield every point, coarse to fine; ``quick`` uses only the two coarsest meshes of each method."""
    most = 2 if quick else None
    with threadpool_limits(limits=1, user_api="blas"):
        for nu, method in itertools.product(POISSON, METHODS):
            if method.degree == 1 and nu > 0.45:  # locking: the program refuses it
                continue
            for level, mesh in enumerate(method.meshes[:most]):
                settings = {**mesh, "degree": method.degree, "element": method.element}
                yield _point(method.name, nu, level, settings, method.without, repeats)
        for nu in POISSON:
            for level, accuracy in enumerate(ASKED[:most]):
                yield _point("accuracy asked for, 3D", nu, level, {"accuracy": accuracy}, (), repeats)
            yield from _meridians(nu, repeats)


def _point(name: str, nu: float, level: int, mesh: dict[str, Any], without: tuple[str, ...], repeats: int) -> Point:
    probe = {"shape": "disc", "radius": "3 mm", "depth": "0.1 mm"}
    scene = study(known.CYLINDER_BODY, nu, probe, mesh)
    runs: list[Record] = []
    for _ in range(repeats + 1):  # the first run warms up
        record = record_of(scene, ("axisymmetric", *without))
        if not isfinite(record.force):  # error bars above 100 % are allowed here
            raise RuntimeError(f"{name}, ν = {nu:g}: {record.message}")
        runs.append(record)
    median = {n: statistics.median(getattr(r, n) for r in runs[1:]) for n in ("time_total", "time_error")}
    error = record.force / _exact(nu) - 1
    return Point(
        name,
        nu,
        level,
        error,
        record.force_error,
        median["time_total"],
        median["time_error"],
        record.dofs,
        record.iterations,
    )


def _exact(nu: float) -> float:
    return known.CYLINDER["bonded", nu] * 1e-3 * YOUNG * DEPTH


def _meridians(nu: float, repeats: int) -> Iterator[Point]:
    """The axisymmetric solver by degree, on the first of its meshes."""
    for level, degree in enumerate(AXISYMMETRIC):
        problem = MeridianProblem(Meridian(50e-3, 50e-3, 3e-3), Conditions(), degree=degree, accuracy=1.0)
        law, movement = MaterialLaw.of_moduli(YOUNG, nu), Movement.along((0.0, 0.0, -DEPTH))
        runs = [problem.solve(law, movement) for _ in range(repeats + 1)]
        seconds = statistics.median(r.times.total for r in runs[1:])
        last = runs[-1]
        error = last.reaction[2] / _exact(nu) - 1
        yield Point("axisymmetric, by degree", nu, level, error, last.bar, seconds, 0.0, last.dofs, 1)


def main(arguments: list[str]) -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--repeats", type=int, default=3, help="runs of each point; the median counts")
    parser.add_argument("--quick", action="store_true", help="a few points")
    asked = parser.parse_args(arguments)
    table = Table(COLUMNS)
    with ended_soon():
        for point in measure(max(asked.repeats, 1), quick=asked.quick):
            table.add(asdict(point))
    table.write("work_precision", asked.output)


if __name__ == "__main__":
    main(sys.argv[1:])
