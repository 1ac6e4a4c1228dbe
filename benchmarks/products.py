"""Products with the operator, assembled by PETSc or matrix-free: ``python -m benchmarks.products``.

A disc on a box, a quarter of it, graded to the probe's edge, degrees 2 to 4. Times are processor milliseconds, medians
of alternating runs. The table also has the cost before the first product, which is pattern and assembly of a matrix or
the layout of cells, and the bytes of memory.
"""

import time
from contextlib import ExitStack
from typing import Any

import numpy as np

from benchmarks.processor import median_seconds
from benchmarks.solvers import YOUNG, case_of
from benchmarks.tables import Table, options

# Element size far from the probe and at its edge, mm.
SIZES = ((3.0, 0.5), (1.7, 0.2), (1.0, 0.2))
ROUNDS = 9
COLUMNS = {
    "degree": "d",
    "dofs": "d",
    "cells": "d",
    "assemble": ".2f",
    "lay_out": ".2f",
    "petsc": ".2f",
    "cells_double": ".2f",
    "cells_single": ".2f",
    "ratio": ".1f",
    "matrix_bytes": ".0f",
    "cells_bytes": ".0f",
}


def measure(size: tuple[float, float], degrees: list[int]) -> list[dict[str, Any]]:
    """Return a row for each degree on one mesh."""
    from mpi4py import MPI
    from threadpoolctl import threadpool_limits

    from pipeline.run.meshing import mesh_case
    from pipeline.solve.conditions import Conditions
    from pipeline.solve.physics import MaterialLaw
    from pipeline.solve.spaces import Spaces

    law = MaterialLaw.of_moduli(YOUNG, 0.3)
    with threadpool_limits(limits=1):
        mesh = mesh_case(case_of(2, size), ("x", "y"), MPI.COMM_SELF)
        rows = []
        for degree in degrees:
            with Spaces(mesh) as spaces:
                rows.append(_row(spaces.get(degree, Conditions()), law) | {"cells": mesh.cells})
    return rows


def _row(space: Any, law: Any) -> dict[str, Any]:
    from pipeline.solve.kernels.native import library

    library()
    with ExitStack() as stack:
        start = time.process_time()
        operator = stack.enter_context(space.lend(law, entries=False))
        laid_out = time.process_time()
        matrix = stack.enter_context(space.lend(law))
        assembled = time.process_time()
        x, y = matrix.createVecs()
        x.array[:] = np.random.default_rng(0).standard_normal(x.getSize())
        x.array[space.prescribed] = 0.0
        cells = operator.getPythonContext()
        single = x.array.astype(np.float32), np.empty(x.getSize(), dtype=np.float32)
        ways = {
            "petsc": lambda: matrix.mult(x, y),
            "cells_double": lambda: operator.mult(x, y),
            "cells_single": lambda: cells.multiply(*single),
        }
        found = {name: 1e3 * seconds for name, seconds in median_seconds(ways, ROUNDS).items()}
        return {
            "degree": space.degree,
            "dofs": space.size,
            "assemble": assembled - laid_out,
            "lay_out": laid_out - start,
            **found,
            "ratio": found["petsc"] / found["cells_single"],
            "matrix_bytes": 12 * matrix.getInfo()["nz_used"] / space.size,
            "cells_bytes": cells.nbytes / space.size,
        }


def main() -> None:
    """Measure, and write ``products.json`` and ``products.md``."""
    parser = options(__doc__)
    parser.add_argument("--largest", type=int, default=len(SIZES), help="how many of the sizes")
    parser.add_argument("--degrees", type=int, nargs="+", default=[2, 3], choices=(2, 3, 4))
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for size in SIZES[: asked.largest]:
        for row in measure(size, asked.degrees):
            table.add(row)
    table.write("products", asked.output)


if __name__ == "__main__":
    main()
