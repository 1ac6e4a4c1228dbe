"""Operators cell by cell. Without curved edges, as most are, they need no quadrature, and every entry knows its place.

``assembly.c`` has the formulas. They take a sixth of the time of dolfinx's general kernels and PETSc's insertion, entry
by entry (docs/solvers.md). On several ranks each adds its own cells; what they add to rows of others is sent there.
dolfinx assembles the curved cells of matrices, and everything where this PETSc does not lend the arrays of its
matrices; for products (``product.py``, ``curved.py``) nothing is assembled.
"""

from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline import compat
from pipeline.solve.kernels import arrays

DEGREES = (1, 2, 3, 4)


def has_kernel(degree: int) -> bool:
    """Tell whether there is a kernel for the stiffness of elements of ``degree``."""
    return degree in DEGREES and PETSc.ScalarType == np.float64


def assembles(displacements: Any) -> bool:
    """Tell whether the stiffness on a space of displacements can be put together here, on any number of ranks."""
    return has_kernel(compat.degree(displacements)) and arrays.available()
