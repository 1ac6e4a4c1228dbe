"""Parts of a solve: products with cells and with a matrix beside the peak of the core, and the parts of a cycle.

They are tables of :mod:`benchmarks.solvers` and :mod:`benchmarks.huge`. Times are those of the processor: the least of
several products, the mean of several cycles. Operations are counted from the tables of ``product.c``: virtual machines
often have no counters.
"""

import json
import shutil
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

_YOUNG, _RATIO = 10e3, 0.3
_REPEATS = 15
_BETWEEN = "prolongation and restriction"
COLUMNS = {
    "degree": "d",
    "unknowns": ",d",
    "PETSc's matrix (ms)": ".1f",
    "cells, double (ms)": ".2f",
    "cells, single (ms)": ".2f",
    "operations of a cell": ",d",
    "peak, double (Gflop/s)": ".0f",
    "of it, double": ".0%",
    "peak, single (Gflop/s)": ".0f",
    "of it, single": ".0%",
    "bytes per unknown, matrix": ".0f",
    "bytes per unknown, cells": ".0f",
}
# Sums of products in registers, as many as hide their latency, in vectors of the width that the compiler uses.
_PEAK = """
#include <stdio.h>
#include <time.h>
#ifdef __AVX512F__
enum { BYTES = 64 };
#else
enum { BYTES = 32 };
#endif
#define MEASURE(NAME, TYPE)                                                                    \\
  static double NAME(void)                                                                     \\
  {                                                                                            \\
    typedef TYPE vector __attribute__((vector_size(BYTES)));                                   \\
    vector a[12], b = (vector){0} + (TYPE).999, c = (vector){0} + (TYPE).001, sum = {0};       \\
    for (int i = 0; i < 12; ++i)                                                               \\
      a[i] = b + (TYPE)i;                                                                      \\
    const long steps = 5000000;                                                                \\
    const clock_t start = clock();                                                             \\
    for (long step = 0; step < steps; ++step)                                                  \\
      for (int i = 0; i < 12; ++i)                                                             \\
        a[i] = a[i] * b + c;                                                                   \\
    const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;                         \\
    for (int i = 0; i < 12; ++i)                                                               \\
      sum += a[i];                                                                             \\
    return sum[0] == 0 ? 0 : 24.0 * BYTES / sizeof(TYPE) * (double)steps / seconds;            \\
  }
MEASURE(of_float, float)
MEASURE(of_double, double)
int main(void)
{
  double best[2] = {0, 0};
  for (int i = 0; i < 7; ++i)
  {
    const double found[2] = {of_double(), of_float()};
    for (int k = 0; k < 2; ++k)
      best[k] = found[k] > best[k] ? found[k] : best[k];
  }
  printf("[%g, %g]\\n", best[0], best[1]);
}
"""


def peak() -> dict[str, float]:
    """Return the most operations a second that one core makes, in both precisions, or none without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return {}
    with TemporaryDirectory() as folder:
        source, program = Path(folder, "peak.c"), Path(folder, "peak")
        source.write_text(_PEAK)
        flags = ["-O3", "-march=native", "-funroll-loops"]
        subprocess.run([compiler, *flags, str(source), "-o", str(program)], check=True)
        done = subprocess.run([program], check=True, capture_output=True, text=True)
    return dict(zip(("float64", "float32"), json.loads(done.stdout), strict=True))


def operations(degree: int) -> int:
    """Return the additions and multiplications of a product for one straight cell: see ``product.c``."""
    from epsmesh.solve.kernels.product import bernstein

    table = bernstein(degree, "float64")
    entries, coefficients = len(table.forward.columns), len(table.raised)
    # Both maps between values and coefficients; gradients and stresses; the mass; forces.
    return 12 * entries + 72 * coefficients + 6 * coefficients * (2 * coefficients - 1) + 66 * coefficients


def product(degree: int, size: tuple[float, float]) -> dict[str, Any]:
    """Return the row of a space of ``degree``: milliseconds of a product by way, and its share of the peak."""
    from benchmarks.solvers import case_of

    with _problem(case_of(degree, size), degree) as problem, ExitStack() as stack:
        space = problem.elements.displacements
        matrix, free = (stack.enter_context(space.lend(_law(), entries=entries)) for entries in (True, False))
        operator, x = free.getPythonContext(), np.random.default_rng(0).standard_normal(space.owned)
        y, (given, found) = np.empty_like(x), matrix.createVecs()
        given.array[:] = x
        milliseconds = {"matrix": 1e3 * _least(partial(matrix.mult, given, found))}
        for kind in ("float64", "float32"):
            milliseconds[kind] = 1e3 * _least(partial(operator._write, x.astype(kind), y.astype(kind)))
        most, cells = peak(), problem._body.cells
        row = {"degree": degree, "unknowns": problem.dofs, "PETSc's matrix (ms)": milliseconds["matrix"]}
        for kind, name in (("float64", "double"), ("float32", "single")):
            speed = operations(degree) * cells / (1e-3 * milliseconds[kind])
            row |= {
                f"cells, {name} (ms)": milliseconds[kind],
                f"peak, {name} (Gflop/s)": most[kind] / 1e9 if most else float("nan"),
                f"of it, {name}": speed / most[kind] if most else float("nan"),
            }
        given.destroy()
        found.destroy()
        return row | {
            "operations of a cell": operations(degree),
            "bytes per unknown, matrix": matrix.getInfo()["nz_used"] * (8 + 4 / 9) / problem.dofs,
            "bytes per unknown, cells": operator.nbytes / problem.dofs,
        }


def cycle(case: Any, *, meshes: bool) -> dict[str, float]:
    """Return the parts of a cycle, in ns for each unknown: below degree 1 coarser ``meshes``, or algebraic levels."""
    from epsmesh.solve.kernels import multigrid, product
    from epsmesh.solve.kernels.multigrid import Cycle

    with _problem(case, 2, meshes=meshes) as problem, problem.solver(_law(), "iterative") as solver:
        spent = Counter[str]()
        inner, within = max(len(solver.cycle._levels) - 2, 0), [False]
        whole, call = Cycle._cycle, product.call

        def timed(name: str, function: Callable[..., Any], *arguments: Any) -> Any:
            start = time.process_time()
            result = function(*arguments)
            spent[name] += time.process_time() - start
            return result

        def counted(name: str, *arguments: Any) -> Any:
            parts = {"add_product": f"products, degree {arguments[0]}", "prolong": _BETWEEN, "restrict": _BETWEEN}
            part = next((found for begin, found in parts.items() if name.startswith(begin)), "")
            if within[0] or not part:
                return call(name, *arguments)
            return timed(part, call, name, *arguments)

        def inside(self: Cycle, number: int) -> None:
            if number != inner:
                whole(self, number)
                return
            within[0] = True
            timed("coarser levels", whole, self, number)
            within[0] = False

        size = problem.dofs
        r = np.random.default_rng(0).standard_normal(size)
        found: np.ndarray = np.empty_like(r)
        double = _least(partial(solver.matrix.getPythonContext()._write, r, np.empty_like(r)))
        solver.cycle.correct(r, found)
        product.call = multigrid.call = counted
        Cycle._cycle = inside  # type: ignore[method-assign]
        try:
            start = time.process_time()
            for _ in range(_REPEATS):
                solver.cycle.correct(r, found)
            cycles = (time.process_time() - start) / _REPEATS
        finally:
            product.call = multigrid.call = call
            Cycle._cycle = whole  # type: ignore[method-assign]
    parts = {name: seconds / _REPEATS for name, seconds in spent.items()}
    parts |= {"vectors": cycles - sum(parts.values()), "a cycle": cycles, "the product in double precision": double}
    return {name: 1e9 * seconds / size for name, seconds in parts.items()}


@contextmanager
def _problem(case: Any, degree: int, *, meshes: bool = True) -> Iterator[Any]:
    from mpi4py import MPI
    from threadpoolctl import threadpool_limits

    from epsmesh.run.meshing import mesh_case
    from epsmesh.solve.conditions import Conditions
    from epsmesh.solve.quasi_static import QuasiStaticProblem
    from epsmesh.solve.spaces import Spaces

    with threadpool_limits(limits=1):
        body = mesh_case(case, (), MPI.COMM_SELF)
        body = body if meshes else replace(body, refinements=0, beyond=None)
        with Spaces(body) as spaces, QuasiStaticProblem(spaces, degree, Conditions()) as problem:
            yield problem


def _law() -> Any:
    from epsmesh.solve.physics import MaterialLaw

    return MaterialLaw.of_moduli(_YOUNG, _RATIO)


def _least(way: Callable[[], Any]) -> float:
    """Return the least processor seconds of ``way``."""
    seconds = []
    for _ in range(_REPEATS):
        start = time.process_time()
        way()
        seconds.append(time.process_time() - start)
    return min(seconds)
