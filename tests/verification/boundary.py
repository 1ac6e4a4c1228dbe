"""A frictionless rectangular punch on a half-space by boundary elements, independent of all other code.

The pressure is constant on each of n × n rectangles of a quarter of the footprint, which are smaller towards its edge.
The displacement by each rectangle is A. E. H. Love's (Phil. Trans. R. Soc. A 228, 377, 1929); all centres sink equally.
"""

import numpy as np

from epsmesh.arrays import FloatArray


def rectangle_stiffness(ratio: float, divisions: tuple[int, int] = (16, 32)) -> tuple[float, float]:
    """Return c = F / (E* W d) of a frictionless rectangle of length L = ``ratio`` W, and the relative error of c.

    ``divisions`` are two numbers of elements along each half side, one twice the other. The error falls like n⁻², so
    both are extrapolated; the error of the result is the size of that step.
    """
    coarse, fine = (_stiffness(ratio, n) for n in divisions)
    step = (fine - coarse) / 3
    return fine + step, abs(step / fine)


def _stiffness(ratio: float, n: int) -> float:
    # Chebyshev points: elements of size n⁻² at the edge, where the pressure is singular (inverse root of the distance).
    edges = np.sin(np.linspace(0.0, np.pi / 2, n + 1))
    x, y = ratio / 2 * edges, edges / 2
    x0, y0 = (a.reshape(-1) for a in np.meshgrid(x[:-1], y[:-1]))
    x1, y1 = (a.reshape(-1) for a in np.meshgrid(x[1:], y[1:]))
    cx, cy = (x0 + x1) / 2, (y0 + y1) / 2
    matrix = sum(
        _love(sx * cx[:, None] - x0, sx * cx[:, None] - x1, sy * cy[:, None] - y0, sy * cy[:, None] - y1)
        for sx in (1, -1)
        for sy in (1, -1)
    )
    pressure = np.linalg.solve(matrix, np.ones(n * n))
    return float(4 * pressure @ ((x1 - x0) * (y1 - y0)))


def _love(xa: FloatArray, xb: FloatArray, ya: FloatArray, yb: FloatArray) -> FloatArray:
    """Displacement × E* by unit pressure on a rectangle, at (xa, ya) from one corner, (xb, yb) from the opposite."""

    def term(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return a * (np.arcsinh(b / np.abs(a)) - np.arcsinh(c / np.abs(a)))

    return (term(xa, ya, yb) - term(xb, ya, yb) + term(ya, xa, xb) - term(yb, xa, xb)) / np.pi
