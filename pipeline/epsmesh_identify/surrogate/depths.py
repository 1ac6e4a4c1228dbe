"""Depths of a surrogate: nodes in the root of the depth, in which a force divided by its power of the depth is smooth.

On a thick body a ball's force is E* √R d^1.5 times a series in a/h, and the contact radius a grows like √d; so does, of
a cone, the logarithm of F/d².
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from epsmesh.arrays import FloatArray
from epsmesh_identify.surrogate.nodes import nodes

# Share of the largest depth at which nodes begin: the force is a hundredth to a thousandth of the largest there.
SHALLOWEST = 0.01


@dataclass(frozen=True)
class Depths:
    """Nodes between a smallest and a largest depth (m), and the power of the depth that forces are divided by."""

    deepest: float
    exponent: float
    count: int
    shallowest: float = SHALLOWEST

    @property
    def values(self) -> FloatArray:
        """The nodes (m), in the order in which levels add them; of one node, the largest depth."""
        if self.count == 1:
            return np.array([self.deepest])
        low, high = np.sqrt(self.shallowest), 1.0
        return np.asarray(self.deepest * (low + (high - low) * (nodes()[: self.count] + 1) / 2) ** 2)

    def basis(self, depth: FloatArray) -> FloatArray:
        """Return the weights (depths, nodes) of the logarithms of F/d^p at the nodes.

        Below the smallest node F goes like d^p.
        """
        if self.count == 1:
            return np.ones((len(depth), 1))
        low = np.sqrt(self.shallowest)
        x = 2 * (np.sqrt(depth / self.deepest) - low) / (1 - low) - 1
        return np.asarray(chebvander(np.clip(x, -1, 1), self.count - 1) @ _inverse(self.count))

    def power(self, depth: FloatArray) -> FloatArray:
        """Return d^p in units of that of the largest depth."""
        return np.asarray((depth / self.deepest) ** self.exponent)

    def with_count(self, count: int) -> "Depths":
        """Return so many nodes of the same depths."""
        return replace(self, count=count)


@cache
def _inverse(count: int) -> FloatArray:
    return np.asarray(np.linalg.inv(chebvander(nodes()[:count], count - 1)))
