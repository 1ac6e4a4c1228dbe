"""The tables of a model, as Chebyshev coefficients: what `epsmesh export` makes, and what C evaluates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epsmesh_realtime.evaluator import Array, Evaluator, Pair, Place

_EVEN = (True, True)
_OF_NEAR = ("most", "error", "room", "support")
# The numbers of a body around a table by itself.
_PLAIN: Mapping[str, ArrayLike] = {
    "origin": np.zeros(3), "axes": np.eye(3), "bar": np.zeros(4), "thickness": 1.0, "young": 1.0, "largest": 1.0,
    "off": 1.0, "aligned": 0.1, "bend_error": 0.0,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Face:
    """Chebyshev coefficients (v, u), as a table has them, of ``height`` (m) and of mean curvature ``bend`` (1/m)."""

    height: Array = field(default_factory=lambda: np.zeros((1, 1)))
    bend: Array = field(default_factory=lambda: np.zeros((1, 1)))

    @property
    def is_flat(self) -> bool:
        """Whether it is the plane z = 0."""
        return not (self.height.any() or self.bend.any())

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of a file."""
        return {"height": self.height, "bend": self.bend}


@dataclass(frozen=True, eq=False)
class Table:
    """c and h of a body at any place of its region, and what blades and bonded tools need.

    Coefficients (ν, v, u) of ``reciprocal`` t = 1/(c + c_ref) (m), which is smooth where c grows towards an edge, and
    of ``curvature`` q = h t³; half extents X, Y (m) of the region. In a direction in which the body is symmetric
    (``even``), u and v are 2(x/X)² - 1 and 2(y/Y)² - 1, else x/X and y/Y. On a round region (``is_round``), an
    axisymmetric body has only u = 2(x² + y²)/X² - 1.
    ``leans``: h does not include the tilt of the face, which is added.

    ``tensors`` (7, ν, v, u), which may be empty, are t³ times the first two, and t times the others, of

        A₁ = (A_xx - A_yy)/2, A_xy, R_xz, R_yz, (R_xx + R_yy)/2, (R_xx - R_yy)/2, R_xy.

    R is the regular part of the Green's function at the force, A the second derivatives of R_zz with respect to the
    field point (h = A_xx + A_yy). Each is divided by the factor that symmetry implies. With ξ = x/X and η = y/Y the
    factors are 1, 2ξη, ξ, η, 1, 1, 2ξη; for an axisymmetric body ξ² - η², 2ξη, ξ, η, 1, ξ² - η², 2ξη. Without
    symmetry, 1 replaces ξ or η.
    """

    reciprocal: Array
    curvature: Array
    c_ref: float
    reach: tuple[float, float]
    is_round: bool
    poisson: tuple[float, float]
    even: tuple[bool, bool] = _EVEN
    leans: bool = True
    tensors: Array = field(default_factory=lambda: np.zeros((0, 1, 1, 1)))

    def at(self, x: float, y: float, poisson: float) -> Place:
        """Return the values at a place (m) in the region, for a Poisson's ratio in the range.

        Raises:
            ArithmeticError: if the table is inconsistent.
        """
        return self._alone.place(x, y, poisson)

    def with_arrays(self, more: Mapping[str, ArrayLike]) -> Evaluator:
        """Return the evaluator of some body with this table, and with the arrays of another part."""
        rest: dict[str, ArrayLike] = {"sides": 2 * np.array(self.reach), "poisson": self.poisson[0]}
        return Evaluator.of({**_PLAIN, **rest, **self.numbers(), **Face().numbers(), **more})

    def factors(self, x: float, y: float) -> Array:
        """Return the factors (7,) of ``tensors`` at a place (m)."""
        return self._alone.factors(x, y)

    @staticmethod
    def none(
        reach: Pair, poisson: Pair = (0.0, 0.0), is_round: bool = False, even: tuple[bool, bool] = _EVEN
    ) -> "Table":
        """Return the table of a half-space."""
        return Table(np.ones((1, 1, 1)), np.zeros((1, 1, 1)), 1.0, reach, is_round, poisson, even, leans=False)

    @property
    def is_axial(self) -> bool:
        """Whether the body is axisymmetric."""
        return self.is_round and self.reciprocal.shape[1] == 1

    @cached_property
    def _alone(self) -> Evaluator:
        return self.with_arrays({})

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of a file."""
        names = ("reciprocal", "curvature", "c_ref", "reach", "is_round", "even", "leans")
        found: dict[str, ArrayLike] = {name: np.asarray(getattr(self, name), dtype=float) for name in names}
        return found | {"poisson_range": self.poisson} | ({"tensors": self.tensors} if len(self.tensors) else {})

    @staticmethod
    def of(found: Mapping[str, NDArray[Any]]) -> "Table":
        """Return the table of a file's arrays."""
        reach, poisson, even = (tuple(found[name].tolist()) for name in ("reach", "poisson_range", "even"))
        tensors = {"tensors": found["tensors"]} if "tensors" in found else {}
        return Table(
            found["reciprocal"],
            found["curvature"],
            float(found["c_ref"]),
            reach,
            bool(found["is_round"]),
            poisson,
            (bool(even[0]), bool(even[1])),
            leans=bool(found["leans"]),
            **tensors,
        )


@dataclass(frozen=True, eq=False)
class Near:
    """A ball on a half-space at large displacements; the rest of the body remains linear.

    Depth and contact radius at a force are in units of those of H. Hertz (1882), a function of ν and
    x = (F/E* R²)^(1/3). ``values`` (2, ν, x) are their Chebyshev coefficients, over ν and 2x/``most`` - 1. ``error`` is
    the relative error of F on the half-space. As the ball comes nearer to the bottom or other tissue, its depth at a
    force is smaller by ``support`` F L/thickness² for E = 1, where L is the depth on the half-space. The error of c by
    large displacements is ``room`` times the depth over the square of the distance to the nearest side or the bottom.
    """

    values: Array
    most: float
    error: float
    room: float
    support: float = 0.0

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of a file."""
        return {"near": self.values, **{f"near_{name}": getattr(self, name) for name in _OF_NEAR}}

    @staticmethod
    def of(found: Mapping[str, NDArray[Any]]) -> "Near | None":
        """Return the half-space in a file's arrays, None if the file has none."""
        if "near" not in found:
            return None
        return Near(found["near"], *(float(found[f"near_{name}"]) for name in _OF_NEAR))


@dataclass(frozen=True, eq=False)
class Pairs:
    """Interaction of places: the normal part of a body's Green's function on its face, E = 1.

        G(x, y) = (1 - ν²)/(π |x - y|) + R(x, y),    R(x, y) = Σ φ_k(x) S_kl(ν) φ_l(y).

    ``modes`` (rank, y, x) are Chebyshev coefficients of φ over ``reach`` (m), ``links`` (ν, rank, rank) those of S, in
    1/m; they are symmetric, because R is (E. Betti, 1872). The error of R is ``error`` over the root of both distances
    to the nearest side or the bottom. The lateral displacement by a unit force is at most ``aside`` over the distance.
    """

    modes: Array
    links: Array
    error: float
    aside: float
    reach: Pair
    poisson: Pair

    def regular(self, at: ArrayLike, to: ArrayLike, poisson: float) -> Array:
        """Return R (n, m), in 1/m, of n places ``at`` (n, 2) for forces at m others."""
        return self._alone.between(at, to, poisson)

    @cached_property
    def _alone(self) -> Evaluator:
        return Table.none(self.reach, self.poisson).with_arrays(self.numbers())

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of a file."""
        return {f"pair_{name}": getattr(self, name) for name in ("modes", "links", "error", "aside")}

    @staticmethod
    def of(found: Mapping[str, NDArray[Any]]) -> "Pairs | None":
        """Return the interaction in a file's arrays, None if the file has none."""
        if "pair_modes" not in found:
            return None
        error, aside = float(found["pair_error"]), float(found["pair_aside"])
        reach, poisson = (tuple(found[name].tolist()) for name in ("reach", "poisson_range"))
        return Pairs(found["pair_modes"], found["pair_links"], error, aside, reach, poisson)
