"""c and h of a body at any place of its region, with slopes, from Chebyshev tables over (ν, v, u).

Tabulated are t = 1/(c + c_ref), which stays smooth where c grows towards an edge, and q = h t³, a pure number. Where a
body is its own mirror image u and v are even in x and y, 2(x/X)² - 1 and 2(y/Y)² - 1, else x/X and y/Y; of a round body
there is u = 2(x² + y²)/X² - 1 alone.

What tools take that are not round, or stick, are seven more, each t³ times the first two and t times the rest of

    A₁ = (A_xx - A_yy)/2, A_xy, R_xz, R_yz, (R_xx + R_yy)/2, (R_xx - R_yy)/2, R_xy,

R the regular part of the Green's function at the place itself, A the second derivatives of R_zz with the place alone
(h = A_xx + A_yy), but for what mirror images make of them: with ξ = x/X and η = y/Y the factors 1, 2ξη, ξ, η, 1, 1,
2ξη, for a round body ξ² - η², 2ξη, ξ, η, 1, ξ² - η², 2ξη. Where there is no image, 1 is in the place of ξ or η.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.contact import Place, Shape

Array = NDArray[np.float64]
# A value, its slope, and its second derivatives xx, xy, yy.
_Local = tuple[float, Array, tuple[float, float, float]]
TENSORS = 7


@dataclass(frozen=True, eq=False)
class Table:
    """Coefficients (ν, v, u) of ``reciprocal`` t (m) and of ``curvature`` q; half extents X, Y (m) of the region.

    ``tensors`` (7, ν, v, u) may be empty. ``leans`` tells that the tilt of the face is not in h yet, but to be added.
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
        """Tell whether a place (m) is in the region."""
        if self.is_round:
            return bool(x**2 + y**2 <= self.reach[0] ** 2)
        return abs(x) <= self.reach[0] and abs(y) <= self.reach[1]

    def at(self, x: float, y: float, poisson: float, *, whole: bool = False) -> Place:
        """Return what is known of a place (m) in the region, for a Poisson's ratio in the range.

        ``whole`` asks for what tools take that are not round, or stick, too.

        Raises:
            ArithmeticError: if the table is not that of a body.
        """
        low, high = self.poisson
        middle = 0.0 if high == low else (2 * poisson - low - high) / (high - low)
        of_poisson = polynomials(middle, len(self.reciprocal))[0]
        tables = np.stack([self.reciprocal, self.curvature])
        if whole:
            tables = np.concatenate([tables, self.tensors])
        flat = of_poisson @ tables.reshape(len(tables), len(of_poisson), -1)
        (t, slope_t, of_t), (q, slope_q, _), *others = self.local(flat.reshape(-1, *tables.shape[2:]), x, y)
        if not t > 0:
            raise ArithmeticError("no compliance is below -c_ref")
        slope_c = -slope_t / t**2
        bend = [
            2 * a * b / t**3 - second / t**2
            for (a, b), second in zip(
                ((slope_t[0], slope_t[0]), (slope_t[0], slope_t[1]), (slope_t[1], slope_t[1])), of_t, strict=True
            )
        ]
        hessian = np.array([[bend[0], bend[1]], [bend[1], bend[2]]])
        tilt, slope_tilt = 0.25 * float(slope_c @ slope_c), 0.5 * hessian @ slope_c
        slope_h = slope_q / t**3 - 3 * q * slope_t / t**4
        if not self.leans:
            tilt, slope_tilt, hessian = 0.0, np.zeros(2), np.zeros((2, 2))
        shape = None
        if whole:
            bent, bent_slopes, regular = self._shape(others, x, y, t, slope_t)
            lean = slope_c if self.leans else np.zeros(2)
            shape = Shape(bent, bent_slopes, lean, hessian, regular)
        c, stiff = 1 / t - self.c_ref, 1 / (1 - poisson**2)
        return Place(c, q / t**3, tilt, slope_c, slope_h, slope_tilt, stiff, shape=shape, poisson=poisson)

    def local(self, tables: Array, x: float, y: float) -> list[_Local]:
        """Return of each of ``tables`` (n, v, u) what it is at a place (m)."""
        a, b = self.reach
        if self.is_round:
            u, v = 2 * (x**2 + y**2) / a**2 - 1, 0.0
        else:
            u = 2 * (x / a) ** 2 - 1 if self.even[0] else x / a
            v = 2 * (y / b) ** 2 - 1 if self.even[1] else y / b
        left, right = polynomials(v, tables.shape[1]), polynomials(u, tables.shape[2])
        return [self._along(found, x, y) for found in left @ tables @ right.T]

    def _along(self, found: Array, x: float, y: float) -> _Local:
        """Return a value, its slope, and its second derivatives xx, xy, yy, from those in v (rows) and u."""
        (f, fu, fuu), (fv, fuv), fvv = found[0].tolist(), found[1, :2].tolist(), float(found[2, 0])
        a, b = self.reach
        bend = 4 / a**2
        if self.is_round:
            ux, uy = bend * x, bend * y
            slope = np.array([fu * ux, fu * uy])
            return f, slope, (fuu * ux**2 + fu * bend, fuu * ux * uy, fuu * uy**2 + fu * bend)
        (ux, uxx) = (bend * x, bend) if self.even[0] else (1 / a, 0.0)
        (vy, vyy) = (4 / b**2 * y, 4 / b**2) if self.even[1] else (1 / b, 0.0)
        slope = np.array([fu * ux, fv * vy])
        return f, slope, (fuu * ux**2 + fu * uxx, fuv * ux * vy, fvv * vy**2 + fv * vyy)

    def _shape(self, others: list[_Local], x: float, y: float, t: float, slope_t: Array) -> tuple[Array, Array, Array]:
        """Return A₁ and A_xy, their slopes, and R."""
        (a, b), values, slopes = self.reach, [], []
        known = factors((x / a, y / b), self.reach, self.even, self.is_round)
        for (f, slope, _), (factor, own) in zip(others, known, strict=True):
            values.append(factor * f)
            slopes.append(factor * slope + f * own)
        bent, bent_slopes = np.array(values[:2]) / t**3, np.array(slopes[:2]) / t**3
        bent_slopes -= 3 * bent[:, None] * slope_t / t
        xz, yz, mean, half, xy = np.array(values[2:]) / t
        regular = np.array([[mean + half, xy, xz], [xy, mean - half, yz], [xz, yz, 1 / t - self.c_ref]])
        return bent, bent_slopes, regular


def factors(
    at: tuple[float, float], reach: tuple[float, float], even: tuple[bool, bool], is_round: bool
) -> list[tuple[float, Array]]:
    """Return what each of the seven tables is times, with its slope (1/m), at ξ and η."""
    (xi, of_x), (eta, of_y) = (
        (share, 1 / size) if is_even else (1.0, 0.0) for share, size, is_even in zip(at, reach, even, strict=True)
    )
    one, none = 1.0, np.zeros(2)
    twist = (2 * xi * eta, np.array([2 * eta * of_x, 2 * xi * of_y]))
    along, across = (xi, np.array([of_x, 0.0])), (eta, np.array([0.0, of_y]))
    apart = (xi**2 - eta**2, np.array([2 * xi * of_x, -2 * eta * of_y])) if is_round else (one, none)
    return [apart, twist, along, across, (one, none), apart, twist]


def polynomials(at: float, count: int) -> Array:
    """Return T_n, T_n' and T_n'' (3, count)."""
    values, slopes, bends = [1.0, at], [0.0, 1.0], [0.0, 0.0]
    for _ in range(2, count):
        bends.append(2 * at * bends[-1] + 4 * slopes[-1] - bends[-2])
        slopes.append(2 * at * slopes[-1] + 2 * values[-1] - slopes[-2])
        values.append(2 * at * values[-1] - values[-2])
    return np.array([values[:count], slopes[:count], bends[:count]])
