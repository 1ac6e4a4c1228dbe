"""Interaction of places: the normal part of a body's Green's function, E = 1, on a flat face.

    G(x, y) = (1 - ν²)/(π |x - y|) + R(x, y),    R(x, y) = Σ φ_k(x) S_kl(ν) φ_l(y),

The first term is a half-space's (J. Boussinesq, 1885). The regular part R has low rank: modes φ are polynomials over
the region, and links S are symmetric, because R is (E. Betti, 1872).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from pipeline.realtime.classic import ModelError, check_shapes
from pipeline.realtime.place import Array, Pair
from pipeline.realtime.table import chebyshev, middle_of, polynomials

# Largest numbers of modes, and of their coefficients; the same as in C, as is that of links over ν.
MOST_MODES, MOST_TERMS, MOST_LINKS = 96, 16384, 3
PARTS = {"pair_modes": 3, "pair_links": 3, "pair_error": 0, "pair_aside": 0}


@dataclass(frozen=True, eq=False)
class Influence:
    """Interaction of places i and j: ``sinks`` (n, n) is G (1/m), 0 for i = j; ``slopes`` (n, n, 2) ∂G/∂x_i (1/m²).

    ``bends`` (n, n) is the magnitude of the Laplacian of R in x_i (1/m³), ``near`` (n, n) the half-space's part of G.
    ``away`` (n, n, 2) is x_i - x_j, and ``apart`` (n, n) the distance (m), infinite for i = j.
    """

    sinks: Array
    slopes: Array
    bends: Array
    near: Array
    away: Array
    apart: Array


@dataclass(frozen=True, eq=False)
class Pairs:
    """``modes`` (rank, y, x), Chebyshev coefficients over ``reach`` (m), ``links`` (ν, rank, rank) in 1/m over ν.

    The error of R is ``error`` over the root of both distances to the nearest side or the bottom. The lateral
    displacement by a unit force is at most ``aside`` over the distance.
    """

    modes: Array
    links: Array
    error: float
    aside: float
    reach: Pair
    poisson: Pair

    def between(self, places: list[Pair], poisson: float, least: float = 0.0) -> Influence:
        """Return the interaction of ``places`` (m); distances below ``least`` (m) are replaced by it."""
        terms = [self._terms(x, y) for x, y in places]
        flat = self._flat
        value, along, across, bend = (np.array([term[k] for term in terms]) @ flat.T for k in range(4))
        linked = value @ self._linked(poisson)
        at = np.array(places)
        away = at[:, None] - at
        apart = np.maximum(np.sqrt((away**2).sum(axis=-1)), least)
        np.fill_diagonal(apart, np.inf)
        near = (1 - poisson**2) / (pi * apart)
        others = 1.0 - np.eye(len(places))
        sinks = others * (near + linked @ value.T)
        slopes = np.stack([along @ linked.T, across @ linked.T], axis=-1) - (near / apart**2)[..., None] * away
        return Influence(sinks, others[..., None] * slopes, others * np.abs(bend @ linked.T), near, away, apart)

    def regular(self, at: list[Pair], to: list[Pair], poisson: float) -> Array:
        """Return R (n, m), in 1/m, of n places ``at`` for forces at m others."""
        of_at, of_to = (np.array([self._terms(x, y)[0] for x, y in places]) @ self._flat.T for places in (at, to))
        return np.asarray(of_at @ self._linked(poisson) @ of_to.T)

    def _linked(self, poisson: float) -> Array:
        middle = middle_of(self.poisson, poisson)
        return np.asarray(np.tensordot(np.array(chebyshev(middle, len(self.links))), self.links, 1))

    @cached_property
    def _flat(self) -> Array:
        return self.modes.reshape(len(self.modes), -1)

    def _terms(self, x: float, y: float) -> tuple[Array, Array, Array, Array]:
        """Return all products of polynomials at a place, their gradients, and their Laplacians."""
        (a, b), (_, rows, columns) = self.reach, self.modes.shape
        (u, du, ddu), (v, dv, ddv) = polynomials(x / a, columns), polynomials(y / b, rows)
        return (
            np.outer(v, u).ravel(),
            np.outer(v, du).ravel() / a,
            np.outer(dv, u).ravel() / b,
            np.outer(v, ddu).ravel() / a**2 + np.outer(ddv, u).ravel() / b**2,
        )


def read_pairs(found: Mapping[str, Array], reach: Pair, poisson: Pair) -> Pairs | None:
    """Return the interaction in a file's variables, None if the file has none.

    Raises:
        ModelError: if a value is invalid.
    """
    if not any(name in found for name in PARTS):
        return None
    check_shapes(found, PARTS, ", but others of its kind")
    modes, links = found["pair_modes"], found["pair_links"]
    rank, rows, columns = modes.shape
    fits = {
        "pair_modes": rank <= MOST_MODES and modes.size <= MOST_TERMS and max(rows, columns) <= 64,
        "pair_links": links.shape[1:] == (rank, rank)
        and len(links) <= MOST_LINKS
        and bool((links == links.transpose(0, 2, 1)).all())
        and (len(links) == 1 or poisson[0] < poisson[1]),
        "pair_error": bool(found["pair_error"] >= 0),
        "pair_aside": bool(found["pair_aside"] >= 0),
    }
    for name, is_right in fits.items():
        if not is_right:
            raise ModelError(f"{name} is not that of a model")
    return Pairs(modes, links, float(found["pair_error"]), float(found["pair_aside"]), reach, poisson)
