"""Large displacements in units of a linear solve: ``python -m benchmarks.large``, four minutes.

A tool on a box, a quarter of it: a bonded disc pressed by a tenth or half of its radius, or a ball, whose contact is
found, pressed to its equator. One depth, one depth with its error bar, and on a smaller mesh ten depths on one load
path, with error bars. The unit is linear elasticity with the same elements on the same mesh, in the same process:
set-up and solve, for the ball with its contact, without an error bar. Times are processor seconds, without meshes and
compilation.
"""

from functools import partial
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
SCENES = (("disc", "displacement"), ("deep disc", "displacement"), ("ball", "displacement"), ("ball", "mixed"))
POISSON = {"displacement": 0.4, "mixed": 0.49}
COLUMNS = {
    "tool": "",
    "element": "",
    "poisson": ".2f",
    "dofs": "d",
    "linear (s)": ".3f",
    "one depth": ".1f",
    "with its bar": ".1f",
    "dofs, ten depths": "d",
    "ten depths": ".0f",
}


def measure(tool: str, element: str, rounds: int) -> dict[str, Any]:
    """Return a row for one tool and one kind of elements; nonlinear times are in linear solves."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        dofs, one = _ratios(tool, "large", element, {"one depth": (1, False), "with its bar": (1, True)}, rounds)
        fewer, ten = _ratios(tool, "small", element, {"ten depths": (DEPTHS, True)}, rounds)
    row = {"tool": tool, "element": element, "poisson": POISSON[element], "dofs": dofs, "dofs, ten depths": fewer}
    return row | ten | one


def _ratios(
    tool: str, size: str, element: str, paths: dict[str, tuple[int, bool]], rounds: int
) -> tuple[int, dict[str, float]]:
    """Return the number of unknowns, and times of load ``paths``: number of depths, and whether they have bars."""
    case, body = _meshed(tool, size)
    depth = TOOLS[tool][1]

    def solved(law: str, number: int, *, estimate: bool) -> int:
        depths = [depth * (step + 1) / number for step in range(number)]
        return _solved(case, body, element, law, depths, estimate=estimate)

    dofs = solved("linear", 1, estimate=False)
    if size == "large":
        coarse = _meshed(tool, "small")
        _solved(*coarse, element, "neo-hookean", [depth], estimate=True)  # compiles
    ways = {"linear (s)": partial(solved, "linear", 1, estimate=False)}
    ways |= {name: partial(solved, "neo-hookean", number, estimate=bar) for name, (number, bar) in paths.items()}
    found = median_seconds(ways, rounds)
    unit = found["linear (s)"]
    return dofs, {"linear (s)": unit} | {name: found[name] / unit for name in paths}


def _meshed(tool: str, size: str) -> tuple[Any, Any]:
    """Return the case of a tool, and a quarter of it, meshed."""
    from mpi4py import MPI

    from epsmesh.plan.plan import make_plan
    from epsmesh.run.meshing import mesh_case
    from epsmesh.study.read import parse

    fine, rim = SIZES[tool][size]
    mesh = graded(f"{fine} mm", "6 mm", f"{rim} mm", 0.4, degree=2, model="3d")
    scene = study(BOX, 0.4, TOOLS[tool][0], mesh)
    scene["material"]["law"] = "neo-hookean"
    (planned,) = make_plan(parse(scene)).solves
    return planned.case, mesh_case(planned.case, ("x", "y"), MPI.COMM_SELF, None)


def _solved(case: Any, body: Any, element: str, law: str, depths: list[float], *, estimate: bool) -> int:
    """Solve for ``depths`` (m) on one load path, all set-up included; return the number of unknowns."""
    from epsmesh.run.tools import tool_of
    from epsmesh.solve.conditions import WITHOUT_FOOTPRINT, Conditions
    from epsmesh.solve.movement import Movement
    from epsmesh.solve.physics import MaterialLaw
    from epsmesh.solve.quasi_static import QuasiStaticProblem
    from epsmesh.solve.spaces import Spaces

    material = MaterialLaw.of_moduli(10e3, POISSON[element], law)
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
    parser.add_argument("--rounds", type=int, default=1)
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for tool, element in SCENES:
        if tool in asked.tools:
            table.add(measure(tool, element, asked.rounds))
    table.write("large", asked.output)


if __name__ == "__main__":
    main()
