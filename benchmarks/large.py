"""Large displacements in units of a linear solve: ``python -m benchmarks.large``, a few minutes.

A tool on a box, a quarter of it: a bonded disc pressed by a tenth or half of its radius, or a ball, whose contact is
found, pressed to its equator. One depth, one depth with its error bar, and ten depths on one load path. The unit is
linear elasticity with the same elements on the same mesh, in the same process: set-up and solve, for the ball with its
contact, without an error bar. Times are processor seconds, without meshes and compilation.
"""

from typing import Any

from benchmarks.processor import median_seconds
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, options

DEPTHS = 10
BALL = {"shape": "sphere", "radius": "4 mm", "depth": "4 mm", "contact": "unilateral"}
# Tools: section and depth, m.
TOOLS: dict[str, tuple[dict[str, Any], float]] = {
    "disc": (DISC, 0.2e-3),
    "deep disc": (DISC | {"depth": "1 mm"}, 1e-3),
    "ball": (BALL, 4e-3),
}
# Element size far from the probe and at its edge, mm.
SIZES = {
    "disc": {"small": (2.4, 0.3), "large": (1.7, 0.2)},
    "deep disc": {"small": (2.4, 0.3), "large": (1.7, 0.2)},
    "ball": {"small": (2.6, 1.2), "large": (1.6, 0.72)},
}
ELEMENTS = {"displacement": 0.4, "mixed": 0.49}
COLUMNS = {
    "tool": "",
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


def measure(tool: str, size: str, element: str, rounds: int) -> dict[str, Any]:
    """Return a row for one tool, one mesh and one kind of elements."""
    from threadpoolctl import threadpool_limits

    case, body = _meshed(tool, size)
    depth = TOOLS[tool][1]
    sweep = [depth * (number + 1) / DEPTHS for number in range(DEPTHS)]
    ways = {
        "linear": lambda: _solved(case, body, element, "linear", [depth], estimate=False),
        "one": lambda: _solved(case, body, element, "neo-hookean", [depth], estimate=False),
        "bar": lambda: _solved(case, body, element, "neo-hookean", [depth], estimate=True),
        "ten": lambda: _solved(case, body, element, "neo-hookean", sweep, estimate=True),
    }
    with threadpool_limits(limits=1):
        dofs = max([way() for way in ways.values()])  # compiles
        found = median_seconds(ways, rounds)
    return {
        "tool": tool,
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


def _meshed(tool: str, size: str) -> tuple[Any, Any]:
    """Return the case of a tool, and a quarter of it, meshed."""
    from mpi4py import MPI

    from pipeline.plan.plan import make_plan
    from pipeline.run.meshing import mesh_case
    from pipeline.study.read import parse

    fine, rim = SIZES[tool][size]
    mesh = graded(f"{fine} mm", "6 mm", f"{rim} mm", 0.4, degree=2, model="3d")
    scene = study(BOX, 0.4, TOOLS[tool][0], mesh)
    scene["material"]["law"] = "neo-hookean"
    (planned,) = make_plan(parse(scene)).solves
    return planned.case, mesh_case(planned.case, ("x", "y"), MPI.COMM_SELF, None)


def _solved(case: Any, body: Any, element: str, law: str, depths: list[float], *, estimate: bool) -> int:
    """Solve for ``depths`` (m) on one load path, all set-up included; return the number of unknowns."""
    from pipeline.run.problem import tool_of
    from pipeline.solve.conditions import WITHOUT_FOOTPRINT, Conditions
    from pipeline.solve.movement import Movement
    from pipeline.solve.physics import MaterialLaw
    from pipeline.solve.quasi_static import QuasiStaticProblem
    from pipeline.solve.spaces import Spaces

    material = MaterialLaw.of_moduli(10e3, ELEMENTS[element], law)
    is_found = case.probe.contact == "unilateral"
    conditions, tool = (WITHOUT_FOOTPRINT, tool_of(case)) if is_found else (Conditions(), None)
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, 2, conditions, element, tool=tool, reuse=True) as problem:
        for depth in depths:
            problem.solve(material, Movement.along((0.0, 0.0, -depth)), estimate=estimate, method="iterative")
        return problem.dofs


def main() -> None:
    """Measure, and write ``large.json`` and ``large.md``."""
    parser = options(__doc__)
    parser.add_argument("--tools", nargs="+", choices=TOOLS, default=list(TOOLS))
    parser.add_argument("--sizes", nargs="+", choices=["small", "large"], default=["small", "large"])
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for tool in asked.tools:
        for size in asked.sizes:
            for element in ELEMENTS:
                table.add(measure(tool, size, element, asked.rounds))
    table.write("large", asked.output)


if __name__ == "__main__":
    main()
