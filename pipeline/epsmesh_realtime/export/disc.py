"""Nodes on a disc, and polynomials through values there: tables of a round region whose body is not axisymmetric."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from epsmesh.arrays import FloatArray

_DIGITS = 12


@dataclass(frozen=True)
class Disc:
    """A disc of a ``radius`` (m), with polynomials in x and y of a total degree ``size``, an even number.

    In a direction of mirror symmetry (``even``) only its half, and even powers, are needed. Nodes of half the size are
    nodes, too.
    """

    radius: float
    even: tuple[bool, bool]
    size: int

    @cached_property
    def places(self) -> list[tuple[float, float]]:
        """The nodes (m): Chebyshev's along each diameter. Every second ring is turned by half an angle.

        On rings that are not turned, sin(size φ) would be 0 at all nodes.
        """
        found = []
        for ring in range(self.size // 2):
            r = self.radius * np.cos(pi * ring / self.size)
            for angle in pi * (np.arange(2 * self.size) + ring % 2 / 2) / self.size:
                x, y = (round(float(r * of), _DIGITS) + 0.0 for of in (np.cos(angle), np.sin(angle)))
                if (x >= 0 or not self.even[0]) and (y >= 0 or not self.even[1]):
                    found.append((x, y))
        return [*found, (0.0, 0.0)]

    def through(
        self, places: Sequence[tuple[float, float]], values: FloatArray, factor: FloatArray | None = None
    ) -> FloatArray:
        """Return the Chebyshev coefficients (ν, v, u) of ``values`` (ν, places), over a ``factor`` (places,).

        Least squares; the smallest coefficients, where the zeros of the factor leave some undetermined.
        """
        steps = [1 + is_even for is_even in self.even]
        share = np.array(places) / self.radius
        u, v = (
            np.polynomial.chebyshev.chebvander(2 * s**2 - 1 if is_even else s, self.size // step)
            for s, is_even, step in zip(share.T, self.even, steps, strict=True)
        )
        order = np.add.outer(steps[1] * np.arange(v.shape[1]), steps[0] * np.arange(u.shape[1]))
        kept = order <= self.size
        terms = np.einsum("nj,ni->nji", v, u)[:, kept]
        if factor is not None:
            terms = terms * factor[:, None]
        found = np.zeros((len(values), *kept.shape))
        found[:, kept] = np.linalg.lstsq(terms, values.T, rcond=1e-12)[0].T
        return found
