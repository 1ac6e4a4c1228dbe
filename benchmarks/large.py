"""Large displacements in units of a linear solve: ``python -m benchmarks.large``, a minute.

A bonded disc on a box, a quarter of it, pressed by a tenth of its radius: one depth, one depth with its error bar, and
ten depths on one load path. The unit is linear elasticity with the same elements on the same mesh, in the same process:
set-up and solve, without its error bar. Times are processor seconds, without meshes and compilation.
"""

from typing import Any

from benchmarks.processor import median_seconds
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, options

DEPTH, DEPTHS = 0.2e-3, 10
# Element size far from the probe and at its edge, mm.
SIZES = {"small": (2.4, 0.3), "large": (1.7, 0.2)}
ELEMENTS = {"displacement": 0.4, "mixed": 0.49}
COLUMNS = {
    "element": "",
    "poisson": ".2f",
    "dofs": "d",
    "linear": ".3f",
    "one depth": ".2f",
    "ratio": ".1f",
    "with its bar": ".1f",
    "ten depths": ".2f",
    "in depths": ".1f",
}


def measure(size: tuple[float, float], element: str, rounds: int) -> dict[str, Any]:
    """Return a row for one mesh and one kind of elements."""
    from threadpoolctl import threadpool_limits

    body = _mesh(*size)
    sweep = [DEPTH * (number + 1) / DEPTHS for number in range(DEPTHS)]
    ways = {
        "linear": lambda: _solved(body, element, "linear", [DEPTH], estimate=False),
        "one": lambda: _solved(body, element, "neo-hookean", [DEPTH], estimate=False),
        "bar": lambda: _solved(body, element, "neo-hookean", [DEPTH], estimate=True),
        "ten": lambda: _solved(body, element, "neo-hookean", sweep, estimate=True),
    }
    with threadpool_limits(limits=1):
        dofs = max([way() for way in ways.values()])  # compiles
        found = median_seconds(ways, rounds)
    return {
        "element": element,
        "poisson": ELEMENTS[element],
        "dofs": dofs,
        "linear": found["linear"],
        "one depth": found["one"],
        "ratio": found["one"] / found["linear"],
        "with its bar": found["bar"] / found["linear"],
        "ten depths": found["ten"],
        "in depths": found["ten"] / found["bar"],
    }


def _mesh(fine: float, rim: float) -> Any:
    """Return a quarter of the scene, meshed."""
    from mpi4py import MPI

    from pipeline.plan.plan import make_plan
    from pipeline.run.meshing import mesh_case
    from pipeline.study.read import parse

    mesh = graded(f"{fine} mm", "6 mm", f"{rim} mm", 0.4, degree=2, model="3d")
    (planned,) = make_plan(parse(study(BOX, 0.4, DISC, mesh))).solves
    return mesh_case(planned.case, ("x", "y"), MPI.COMM_SELF, None)


def _solved(body: Any, element: str, law: str, depths: list[float], *, estimate: bool) -> int:
    """Solve for ``depths`` (m) on one load path, all set-up included; return the number of unknowns."""
    from pipeline.solve.conditions import Conditions
    from pipeline.solve.movement import Movement
    from pipeline.solve.physics import MaterialLaw
    from pipeline.solve.quasi_static import QuasiStaticProblem
    from pipeline.solve.spaces import Spaces

    material = MaterialLaw.of_moduli(10e3, ELEMENTS[element], law)
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, 2, Conditions(), element, reuse=True) as problem:
        for depth in depths:
            problem.solve(material, Movement.along((0.0, 0.0, -depth)), estimate=estimate, method="iterative")
        return problem.dofs


def main() -> None:
    """Measure, and write ``large.json`` and ``large.md``."""
    parser = options(__doc__)
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for size in asked.sizes:
        for element in ELEMENTS:
            table.add(measure(SIZES[size], element, asked.rounds))
    table.write("large", asked.output)


if __name__ == "__main__":
    main()
