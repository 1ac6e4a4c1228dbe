"""Nested nodes of Clenshaw and Curtis on [-1, 1], and the hierarchical polynomials that belong to them.

Level 1 has the middle, level 2 also both ends, and every further level halves the angles between the nodes before:
1, 3, 5, 9, 17 nodes. The polynomial of a node is that of Lagrange on the nodes of the level in which it is first.
"""

from functools import cache

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from epsmesh.arrays import FloatArray

LEVELS = 5
SIZES = (1, 3, 5, 9, 17)
# Digits of a node: the same node then has the same text in a study, and the same record.
_DIGITS = 12


def first_of(level: int) -> int:
    """Return the number of the first node that is new in a level; levels begin at 1."""
    return 0 if level == 1 else SIZES[level - 2]


@cache
def nodes() -> FloatArray:
    """Return the nodes of all levels, in the order in which levels add them."""
    found = [0.0, -1.0, 1.0]
    for level in range(3, LEVELS + 1):
        count = SIZES[level - 1] - 1
        found += [float(np.cos(np.pi * odd / count)) for odd in range(count - 1, 0, -2)]
    return np.round(found, _DIGITS)


def new_nodes(level: int) -> FloatArray:
    """Return the nodes that a level adds."""
    return nodes()[first_of(level) : SIZES[level - 1]]


@cache
def _coefficients() -> FloatArray:
    """Return the Chebyshev coefficients of the hierarchical polynomials, one a column."""
    found = np.zeros((SIZES[-1], SIZES[-1]))
    for level in range(1, LEVELS + 1):
        size, first = SIZES[level - 1], first_of(level)
        found[:size, first:size] = np.linalg.inv(chebvander(nodes()[:size], size - 1))[:, first:]
    return found


def hierarchical(x: FloatArray) -> FloatArray:
    """Return all hierarchical polynomials (n, 17) at places x (n,) in [-1, 1]."""
    return np.asarray(chebvander(x, SIZES[-1] - 1) @ _coefficients())
