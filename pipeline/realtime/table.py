"""c and h of a body at any place of its region, with gradients, from Chebyshev tables over (ν, v, u).

The tables are t = 1/(c + c_ref), which is smooth where c grows towards an edge, and q = h t³, dimensionless. In a
direction in which the body is symmetric, u and v are 2(x/X)² - 1 and 2(y/Y)² - 1, else x/X and y/Y. A round body has
only u = 2(x² + y²)/X² - 1.

Blades and bonded tools need seven more tables: t³ times the first two, and t times the others, of

    A₁ = (A_xx - A_yy)/2, A_xy, R_xz, R_yz, (R_xx + R_yy)/2, (R_xx - R_yy)/2, R_xy.

R is the regular part of the Green's function at the force, A the second derivatives of R_zz with respect to the field
point (h = A_xx + A_yy). Each table is divided by the factor that symmetry implies. With ξ = x/X and η = y/Y the factors
are 1, 2ξη, ξ, η, 1, 1, 2ξη; for a round body ξ² - η², 2ξη, ξ, η, 1, ξ² - η², 2ξη; without symmetry, 1 replaces ξ or η.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pipeline.realtime.place import Array, Pair, Place, Shape, Square

# A value, its gradient, and its second derivatives xx, xy, yy.
Local = tuple[float, Pair, tuple[float, float, float]]
TENSORS = 7
# Orders of derivatives along v and u: for value and gradient; for the first table, also for second derivatives.
_SLOPES, _BENDS = ((0, 0), (0, 1), (1, 0)), ((0, 2), (1, 1), (2, 0))
_NONE: Pair = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Table:
    """Coefficients (ν, v, u) of ``reciprocal`` t (m) and of ``curvature`` q; half extents X, Y (m) of the region.

    ``tensors`` (7, ν, v, u) may be empty. ``leans``: h does not include the tilt of the face, which is added.
    """

    reciprocal: Array
    curvature: Array
    c_ref: float
    reach: tuple[float, float]
    is_round: bool
    poisson: tuple[float, float]
    even: tuple[bool, bool] = (True, True)
    leans: bool = True
    tensors: Array = field(default_factory=lambda: np.zeros((0, 1, 1, 1)))

    def holds(self, x: float, y: float) -> bool:
        """Return whether a place (m) is in the region."""
        if self.is_round:
            return bool(x**2 + y**2 <= self.reach[0] ** 2)
        return abs(x) <= self.reach[0] and abs(y) <= self.reach[1]

    def prepare(self) -> None:
        """Compute in advance the arrays of all queries, so that the first one does not take milliseconds more."""
        _ = self._round
        if len(self.tensors):
            _ = self._all

    def at(self, x: float, y: float, poisson: float, *, whole: bool = False) -> Place:
        """Return the values at a place (m) in the region, for a Poisson's ratio in the range.

        ``whole`` includes those for blades and bonded tools.

        Raises:
            ArithmeticError: if the table is inconsistent.
        """
        middle = middle_of(self.poisson, poisson)
        (t, slope_t, of_t), (q, slope_q, _), *others = self.local(self._all if whole else self._round, x, y, middle)
        if not t > 0:
            raise ArithmeticError("no compliance is below -c_ref")
        c, stiff = 1 / t - self.c_ref, 1 / (1 - poisson**2)
        (tx, ty), (xx, xy, yy), cube = slope_t, of_t, t**3
        slope_c = -tx / t**2, -ty / t**2
        slope_h = slope_q[0] / cube - 3 * q * tx / t**4, slope_q[1] / cube - 3 * q * ty / t**4
        tilt, slope_tilt, lean, hessian = 0.0, _NONE, _NONE, (_NONE, _NONE)
        if self.leans:
            bend = 2 * tx * ty / cube - xy / t**2
            hessian = (2 * tx * tx / cube - xx / t**2, bend), (bend, 2 * ty * ty / cube - yy / t**2)
            (first, second), lean = slope_c, slope_c
            tilt = 0.25 * (first**2 + second**2)
            slope_tilt = (
                0.5 * (hessian[0][0] * first + hessian[0][1] * second),
                0.5 * (hessian[1][0] * first + hessian[1][1] * second),
            )
        shape = self._shape(others, (x, y), t, slope_t, lean, hessian) if whole else None
        return Place(c, q / cube, tilt, slope_c, slope_h, slope_tilt, stiff, shape=shape, poisson=poisson)

    @cached_property
    def _round(self) -> Array:
        return derived(np.stack([self.reciprocal, self.curvature]))

    @cached_property
    def _all(self) -> Array:
        return derived(np.concatenate([[self.reciprocal], [self.curvature], self.tensors]))

    def local(self, tables: Array, x: float, y: float, middle: float = 0.0) -> list[Local]:
        """Return the values of ``tables``, as ``derived`` gives them, at a place (m); ν is scaled to -1 … 1.

        Second derivatives are for the first table only, 0 for the others.
        """
        a, b = self.reach
        if self.is_round:
            u, v = 2 * (x**2 + y**2) / a**2 - 1, 0.0
        else:
            u = 2 * (x / a) ** 2 - 1 if self.even[0] else x / a
            v = 2 * (y / b) ** 2 - 1 if self.even[1] else y / b
        *_, layers, rows, columns = tables.shape
        down = [of_nu * of_v for of_nu in chebyshev(middle, layers) for of_v in chebyshev(v, rows)]
        terms = np.multiply.outer(down, chebyshev(u, columns))
        found = (tables.reshape(-1, terms.size) @ terms.ravel()).tolist()
        own = [self._along(found[i : i + 3], [0.0, 0.0, 0.0], x, y) for i in range(6, len(found), 3)]
        return [self._along(found[3:6], found[:3], x, y), *own]

    def _along(self, slopes: list[float], bends: list[float], x: float, y: float) -> Local:
        """Return a value, its gradient, and its second derivatives xx, xy, yy, from those along u and v."""
        (f, fu, fv), (fuu, fuv, fvv) = slopes, bends
        a, b = self.reach
        bend = 4 / a**2
        if self.is_round:
            ux, uy = bend * x, bend * y
            return f, (fu * ux, fu * uy), (fuu * ux**2 + fu * bend, fuu * ux * uy, fuu * uy**2 + fu * bend)
        (ux, uxx) = (bend * x, bend) if self.even[0] else (1 / a, 0.0)
        (vy, vyy) = (4 / b**2 * y, 4 / b**2) if self.even[1] else (1 / b, 0.0)
        return f, (fu * ux, fv * vy), (fuu * ux**2 + fu * uxx, fuv * ux * vy, fvv * vy**2 + fv * vyy)

    def _shape(self, others: list[Local], at: Pair, t: float, slope_t: Pair, lean: Pair, hessian: Square) -> Shape:
        """Return the values for blades and bonded tools, from the tables after the first two."""
        (a, b), cube = self.reach, t**3
        known = factors((at[0] / a, at[1] / b), self.reach, self.even, self.is_round)
        apart, twist, xz, yz, mean, half, xy = (
            factor * f for (f, _, _), (factor, _) in zip(others, known, strict=True)
        )
        bent = apart / cube, twist / cube
        apart_x, apart_y, twist_x, twist_y = (
            (factor * slope[axis] + f * own[axis]) / cube - 3 * value * slope_t[axis] / t
            for value, (f, slope, _), (factor, own) in zip(bent, others[:2], known[:2], strict=True)
            for axis in (0, 1)
        )
        regular = (
            ((mean + half) / t, xy / t, xz / t),
            (xy / t, (mean - half) / t, yz / t),
            (xz / t, yz / t, 1 / t - self.c_ref),
        )
        return Shape(bent, ((apart_x, apart_y), (twist_x, twist_y)), lean, hessian, regular)


def derived(tables: Array) -> Array:
    """Return the coefficients of derivatives of ``tables`` (n, ν, v, u) along v and u (3 + 3 n, ν, v, u).

    The order is uu, uv and vv of the first table, then for each table its value, u and v derivative.
    """
    orders = [(tables[0], order) for order in _BENDS] + [(table, order) for table in tables for order in _SLOPES]
    found = np.zeros((len(orders), *tables.shape[1:]))
    for row, (table, (of_v, of_u)) in zip(found, orders, strict=True):
        part = np.polynomial.chebyshev.chebder(table, of_v, axis=-2)
        part = np.polynomial.chebyshev.chebder(part, of_u, axis=-1)
        row[:, : part.shape[-2], : part.shape[-1]] = part
    return found


def factors(
    at: tuple[float, float], reach: tuple[float, float], even: tuple[bool, bool], is_round: bool
) -> list[tuple[float, Pair]]:
    """Return the factor of each of the seven tables, with its gradient (1/m), at ξ and η."""
    (xi, of_x), (eta, of_y) = (
        (share, 1 / size) if is_even else (1.0, 0.0) for share, size, is_even in zip(at, reach, even, strict=True)
    )
    one = 1.0, _NONE
    twist = 2 * xi * eta, (2 * eta * of_x, 2 * xi * of_y)
    apart = (xi**2 - eta**2, (2 * xi * of_x, -2 * eta * of_y)) if is_round else one
    return [apart, twist, (xi, (of_x, 0.0)), (eta, (0.0, of_y)), one, apart, twist]


def middle_of(poissons: Pair, poisson: float) -> float:
    """Return a Poisson's ratio scaled to its range: -1 at the lower end, 1 at the upper one; 0 for an empty range."""
    low, high = poissons
    return 0.0 if high == low else (2 * poisson - low - high) / (high - low)


def chebyshev(at: float, count: int) -> list[float]:
    """Return T_n for n below ``count``."""
    before, value, twice = at, 1.0, 2 * at
    found = []
    for _ in range(count):
        found.append(value)
        before, value = value, twice * value - before
    return found


def polynomials(at: float, count: int) -> Array:
    """Return T_n, T_n' and T_n'' (3, count)."""
    values, slopes, bends = [1.0, at], [0.0, 1.0], [0.0, 0.0]
    for _ in range(2, count):
        bends.append(2 * at * bends[-1] + 4 * slopes[-1] - bends[-2])
        slopes.append(2 * at * slopes[-1] + 2 * values[-1] - slopes[-2])
        values.append(2 * at * values[-1] - values[-2])
    return np.array([values[:count], slopes[:count], bends[:count]])
