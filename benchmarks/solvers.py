"""Cost of linear solvers in applications of the operator: ``python -m benchmarks.solvers``.

A disc on a box, a quarter of it, graded to the probe's edge. Set-up and solve are in units of one application of the
finest operator (a product with its blocked matrix), measured before and after. The figures therefore mean the same on
another machine, and on a busy one, as times are those of the processor. Each row is a separate process, since the peak
memory of a process is that of its largest solve. Levels are those of the multigrid cycle: degrees (p), then coarser
meshes (h), with the unknowns of the last, below which levels are algebraic.

``DIRECT_LIMIT`` in ``epsmesh.solve.krylov`` and ``epsmesh.solve.elements.mixed`` is from here, and so are the bytes per
dof in ``epsmesh.plan.estimate``.
"""

import itertools
import json
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from math import exp, log
from typing import Any

import numpy as np

from benchmarks import products
from benchmarks.processor import ask
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, markdown, options, write
from epsmesh.solve.movement import Motion, Movement

# Element size far from the probe and at its edge, mm.
SMALL = {1: ((4, 2), (3, 1), (2, 0.8)), 2: ((10, 3), (8, 1), (5, 0.8)), 3: ((20, 4), (15, 3), (10, 2))}
LARGE = {1: ((1, 0.2), (0.6, 0.2)), 2: ((1.7, 0.2), (1.0, 0.2), (0.63, 0.2)), 3: ((2.6, 0.3), (1.7, 0.2))}
RATIOS = {"displacement": (0.3, 0.45, 0.49), "mixed": (0.45, 0.49, 0.4999)}
YOUNG = 10e3
WITHOUT_HYPRE = "iterative, gamg"
PRESS = Motion((0.0, 0.0, -1.0))
# Degrees and element sizes of the products that are measured.
PRODUCTS = ((2, LARGE[2][0]), (2, LARGE[2][1]), (3, LARGE[3][0]))
# Solves that take longer than this (s) are not repeated: they vary little.
_ENOUGH = 8.0
COLUMNS = {
    "element": "",
    "degree": "d",
    "poisson": "g",
    "dofs": "d",
    "method": "",
    "levels": "",
    "iterations": "d",
    "assemble": ".0f",
    "setup": ".0f",
    "solve": ".0f",
    "total": ".0f",
    "application": ".2f",
    "bandwidth": ".2f",
    "bytes": ".0f",
}


def measure(element: str, degree: int, poisson: float, size: tuple[float, float], method: str, repeats: int) -> None:
    """Solve one case ``repeats`` times and print its row as JSON."""
    from mpi4py import MPI
    from threadpoolctl import threadpool_limits

    from epsmesh.run.memory import PeakMemory
    from epsmesh.run.meshing import mesh_case
    from epsmesh.solve import krylov
    from epsmesh.solve.conditions import Conditions
    from epsmesh.solve.physics import MaterialLaw
    from epsmesh.solve.quasi_static import QuasiStaticProblem
    from epsmesh.solve.spaces import Spaces

    how = method
    if method == WITHOUT_HYPRE:
        krylov.has_hypre, how = (lambda: False), "iterative"
    with threadpool_limits(limits=1), ExitStack() as stack:
        mesh = mesh_case(case_of(degree, size), ("x", "y"), MPI.COMM_SELF)
        base = PeakMemory(MPI.COMM_SELF)
        held = base.peak()
        problem = stack.enter_context(
            QuasiStaticProblem(stack.enter_context(Spaces(mesh)), degree, Conditions(), element)
        )
        run = _mixed_run if element == "mixed" else _elastic_run
        matrix, levels, once = run(problem, MaterialLaw.of_moduli(YOUNG, poisson), how, stack)
        runs, start = [], time.process_time()
        while len(runs) < repeats and (not runs or time.process_time() - start < _ENOUGH):
            before = _application(matrix)
            assemble, setup, solve, iterations = once()
            unit = (before + _application(matrix)) / 2
            runs.append((assemble / unit, setup / unit, solve / unit, unit))
        assemble, setup, solve, unit = (statistics.median(values) for values in zip(*runs, strict=True))
        moved = _entries(matrix) + 16 * matrix.getSize()[0]
        row = {
            "element": element,
            "degree": degree,
            "poisson": poisson,
            "dofs": problem.dofs,
            "method": method,
            "levels": levels,
            "iterations": iterations,
            "assemble": assemble,
            "setup": setup,
            "solve": solve,
            "total": setup + solve,
            "application": 1e3 * unit,
            "bandwidth": moved / unit / _stream(),
            "bytes": (base.peak() - held) / problem.dofs,
        }
    print(json.dumps(row), flush=True)


def case_of(degree: int, size: tuple[float, float]) -> Any:
    """Return the case whose mesh has elements of these sizes (mm)."""
    from epsmesh.study.read import parse

    mesh = graded(f"{size[0]} mm", "20 mm", f"{size[1]} mm", 0.5, degree=degree)
    return parse(study(BOX, 0.3, DISC, mesh)).case(())


def levels_of(levels: list[Any]) -> str:
    """Return the levels of a cycle, finest first, with the unknowns of the last, below which levels are algebraic.

    Degrees are p, coarser meshes h.
    """
    names = ["h" if level.children is not None else f"p{level.degree}" for level in reversed(levels)]
    return f"{', '.join(names)}: {levels[0].matrix.getSize()[0]:,d}"


def _elastic_run(problem: Any, law: Any, method: str, stack: ExitStack) -> tuple[Any, str, Callable[[], Any]]:
    """Return the operator, the levels, and a function that assembles, sets up and solves once."""
    from epsmesh.solve.balance import TOLERANCE
    from epsmesh.solve.compiled import vector
    from epsmesh.solve.linear_solver import LinearSolver

    space = problem.elements.displacements
    unit = stack.enter_context(space.lend(law, entries=False))
    held = space.held(PRESS)
    with problem.solver(law, method) as lent:
        levels = "" if method == "direct" else levels_of(lent.levels)

    def once() -> tuple[float, float, float, int]:
        start = time.process_time()
        with (
            problem.solver(law, method) as lent,
            vector(space.space) as rhs,
            vector(space.space) as unknown,
        ):
            space.lift(rhs, held, law)
            made = time.process_time()
            solver = LinearSolver(lent.levels, direct=method == "direct")
            ready = time.process_time()
            iterations = solver.solve(rhs, unknown, TOLERANCE)
            done = time.process_time()
            solver.close()
            return made - start - (ready - made), ready - made, done - ready, iterations

    return unit, levels, once


def _mixed_run(problem: Any, law: Any, method: str, stack: ExitStack) -> tuple[Any, str, Callable[[], Any]]:
    """Return the same for mixed elements; a set-up that serves all Poisson's ratios counts once."""
    from epsmesh.solve.balance import TOLERANCE
    from epsmesh.solve.elements.mixed import LAME
    from epsmesh.solve.saddle import SaddleSolver

    direct, elements, c = method == "direct", problem.elements, 1 / (law.parameters[0].ratio - LAME.lame_lambda[0])
    start = time.process_time()
    saddle = elements.saddle(LAME, stack, direct=direct)
    assemble = time.process_time() - start
    # The unit is a matrix-free product of the displacement block, as in the other rows.
    unit = stack.enter_context(elements.displacements.lend(LAME, entries=False))
    press = Movement((PRESS,), (1.0,))

    def once() -> tuple[float, float, float, int]:
        with ExitStack() as made:
            (column,) = elements.columns(press, made)
            elements.lift(column, law)
            start = time.process_time()
            with SaddleSolver(saddle, direct=direct) as solver:
                ready = time.process_time()
                iterations = solver.solve(c, [column.right], [column.unknown], elements.stricter * TOLERANCE)
                return assemble, ready - start, time.process_time() - ready, iterations

    return unit, "" if direct else levels_of(saddle.levels), once


def _application(matrix: Any) -> float:
    """Return the seconds of one product with ``matrix``."""
    x, y = matrix.createVecs()
    x.set(1.0)
    seconds = []
    for _ in range(9):
        start = time.process_time()
        matrix.mult(x, y)
        seconds.append(time.process_time() - start)
    x.destroy()
    y.destroy()
    return statistics.median(seconds)


def _entries(matrix: Any) -> float:
    """Return the bytes of a matrix, or of a matrix-free product."""
    is_product = matrix.getType() == "python"
    return matrix.getPythonContext().nbytes if is_product else matrix.getInfo()["nz_used"] * (8 + 4 / 9)


def _stream() -> float:
    """Return the bandwidth of memory (bytes/s): a sum of two long arrays into a third."""
    a, b, c = np.zeros(10_000_000), np.ones(10_000_000), np.ones(10_000_000)
    seconds = []
    for _ in range(7):
        start = time.process_time()
        np.add(b, c, out=a)
        seconds.append(time.process_time() - start)
    return 3 * a.nbytes / statistics.median(seconds)


def crossovers(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Return the dofs at which both methods take equal time, for each element and degree, by interpolation."""
    found = {}
    for kind in sorted({(row["element"], row["degree"]) for row in rows}):
        times: dict[int, dict[str, float]] = {}
        for row in rows:
            if (row["element"], row["degree"]) == kind and row["poisson"] == RATIOS[kind[0]][0]:
                times.setdefault(row["dofs"], {})[row["method"]] = row["total"]
        both = sorted(
            (d, log(t["direct"] / t["iterative"])) for d, t in times.items() if t.keys() >= {"direct", "iterative"}
        )
        for (low, a), (high, b) in itertools.pairwise(both):
            if a <= 0 < b:
                found[f"{kind[0]} {kind[1]}"] = round(exp(log(low) + log(high / low) * a / (a - b)))
    return found


def plan(largest: int) -> list[tuple[str, int, float, tuple[float, float], str]]:
    """Return the rows to measure: element, degree, ratio, sizes, method; ``largest`` sizes of each element."""
    todo = []
    for degree, sizes in SMALL.items():
        for element in ("displacement", "mixed")[: 1 if degree == 1 else 2]:
            for size in sizes:
                todo += [(element, degree, RATIOS[element][0], size, method) for method in ("direct", "iterative")]
    for degree, sizes in LARGE.items():
        for element in ("displacement", "mixed")[: 2 if degree == 2 else 1]:
            for number, size in enumerate(sizes[:largest]):
                ratios = RATIOS[element] if number < 2 and degree > 1 else RATIOS[element][:1]
                methods = ("iterative", WITHOUT_HYPRE)[: 2 if number == 0 else 1]
                todo += [(element, degree, poisson, size, method) for poisson in ratios for method in methods]
    return todo


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--product", help="a row of the products, as JSON: in a process of its own")
    parser.add_argument("--one", help="a row, as JSON: what runs in a process of its own")
    parser.add_argument("--repeats", type=int, default=3, help="at most")
    parser.add_argument("--rows", type=int, help="the first of them only")
    parser.add_argument(
        "--largest", type=int, default=3, help="how many of the large sizes; the third is a million dofs"
    )
    asked = parser.parse_args()
    if asked.one:
        measure(*json.loads(asked.one), repeats=asked.repeats)
        return
    if asked.product:
        print(json.dumps(products.product(*json.loads(asked.product))))
        return
    table = Table(COLUMNS)
    for case in plan(asked.largest)[: asked.rows]:
        try:
            table.add(ask(["-m", "benchmarks.solvers", "--one", json.dumps(case), "--repeats", str(asked.repeats)]))
        except RuntimeError as error:  # if one row lacks memory, the others are still useful
            print(f"failed: {error}", file=sys.stderr)
    crossed = crossovers(table.rows)
    said = "".join(f"- {name}: {dofs} dofs\n" for name, dofs in crossed.items())
    of_products = [
        ask(["-m", "benchmarks.solvers", "--product", json.dumps(one)])
        for one in PRODUCTS[: None if asked.rows is None else 1]
    ]
    text = f"{markdown(table.rows, COLUMNS)}\nDirect and iterative take the same time at\n\n{said}"
    text += f"\n## A product\n\n{markdown(of_products, products.COLUMNS)}"
    write("solvers", asked.output, {"rows": table.rows, "crossover": crossed, "products": of_products}, text)


if __name__ == "__main__":
    main()
