"""c and h of a body at any place of its region, with slopes, from Chebyshev tables over (ν, v, u).

Tabulated are t = 1/(c + c_ref), which stays smooth where c grows towards an edge, and q = h t³, a pure number. u and v
are even in x and y, as bodies are: 2(x/X)² - 1 and 2(y/Y)² - 1, or for a round body 2(x² + y²)/X² - 1 alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.contact import Place

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Coefficients (ν, v, u) of ``reciprocal`` t (m) and of ``curvature`` q; half extents X, Y (m) of the region."""

    reciprocal: Array
    curvature: Array
    c_ref: float
    reach: tuple[float, float]
    is_round: bool
    poisson: tuple[float, float]

    def holds(self, x: float, y: float) -> bool:
        """Tell whether a place (m) is in the region."""
        if self.is_round:
            return bool(x**2 + y**2 <= self.reach[0] ** 2)
        return abs(x) <= self.reach[0] and abs(y) <= self.reach[1]

    def at(self, x: float, y: float, poisson: float) -> Place:
        """Return what is known of a place (m) in the region, for a Poisson's ratio in the range.

        Raises:
            ArithmeticError: if the table is not that of a body.
        """
        low, high = self.poisson
        middle = 0.0 if high == low else (2 * poisson - low - high) / (high - low)
        of_poisson = _polynomials(middle, len(self.reciprocal))[0]
        a, b = self.reach
        if self.is_round:
            u, v = 2 * (x**2 + y**2) / a**2 - 1, 0.0
        else:
            u, v = 2 * (x / a) ** 2 - 1, 2 * (y / b) ** 2 - 1
        left, right = _polynomials(v, self.reciprocal.shape[1]), _polynomials(u, self.reciprocal.shape[2])
        flat = of_poisson @ np.stack([self.reciprocal, self.curvature]).reshape(2, len(of_poisson), -1)
        of_t, of_q = left @ flat.reshape(2, *self.reciprocal.shape[1:]) @ right.T
        t, slope_t, (t_xx, t_xy, t_yy) = self._along(of_t, x, y)
        q, slope_q, _ = self._along(of_q, x, y)
        if not t > 0:
            raise ArithmeticError("no compliance is below -c_ref")
        slope_c = -slope_t / t**2
        across = slope_t[0] * slope_t[1]
        c_xx = 2 * slope_t[0] ** 2 / t**3 - t_xx / t**2
        c_xy = 2 * across / t**3 - t_xy / t**2
        c_yy = 2 * slope_t[1] ** 2 / t**3 - t_yy / t**2
        bent = np.array([c_xx * slope_c[0] + c_xy * slope_c[1], c_xy * slope_c[0] + c_yy * slope_c[1]])
        tilt = 0.25 * float(slope_c[0] ** 2 + slope_c[1] ** 2)
        slope_h = slope_q / t**3 - 3 * q * slope_t / t**4
        return Place(1 / t - self.c_ref, q / t**3, tilt, slope_c, slope_h, 0.5 * bent, 1 / (1 - poisson**2))

    def _along(self, found: Array, x: float, y: float) -> tuple[float, Array, tuple[float, float, float]]:
        """Return a value, its slope, and its second derivatives xx, xy, yy, from those in v (rows) and u."""
        (f, fu, fuu), (fv, fuv), fvv = found[0].tolist(), found[1, :2].tolist(), float(found[2, 0])
        bend = 4 / self.reach[0] ** 2
        if self.is_round:
            ux, uy = bend * x, bend * y
            slope = np.array([fu * ux, fu * uy])
            return f, slope, (fuu * ux**2 + fu * bend, fuu * ux * uy, fuu * uy**2 + fu * bend)
        other = 4 / self.reach[1] ** 2
        ux, vy = bend * x, other * y
        return f, np.array([fu * ux, fv * vy]), (fuu * ux**2 + fu * bend, fuv * ux * vy, fvv * vy**2 + fv * other)


def _polynomials(at: float, count: int) -> Array:
    """Return T_n, T_n' and T_n'' (3, count)."""
    values, slopes, bends = [1.0, at], [0.0, 1.0], [0.0, 0.0]
    for _ in range(2, count):
        bends.append(2 * at * bends[-1] + 4 * slopes[-1] - bends[-2])
        slopes.append(2 * at * slopes[-1] + 2 * values[-1] - slopes[-2])
        values.append(2 * at * values[-1] - values[-2])
    return np.array([values[:count], slopes[:count], bends[:count]])
