"""Names beside points: each where it covers neither a point, nor a line, nor another name, or nowhere."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

# Inches: from a point to its name, half the size of a point, and what a name keeps from the panel's frame.
_NEAR, _POINT, _FRAME = 0.06, 0.025, 0.02
# Where a name may stand: which share of its width and height lie left of the point and below it, the best first.
_PLACES = ((1, 1), (1, 0), (0, 0), (0, 1), (1, 0.5), (0, 0.5), (0.5, 1), (0.5, 0))

Box = tuple[float, float, float, float]  # left, low, right, high


@dataclass
class Places:
    """The room of a panel, ``width`` × ``height`` inches, and what is taken of it."""

    width: float
    height: float
    taken: list[Box] = field(default_factory=list)

    def take_points(self, x: np.ndarray, y: np.ndarray) -> None:
        """Keep names off points (inches)."""
        self.taken += [
            (a - _POINT, b - _POINT, a + _POINT, b + _POINT)
            for a, b in zip(x, y, strict=True) if np.isfinite(a) and np.isfinite(b)
        ]  # fmt: skip

    def take_steps(self, x: np.ndarray, y: np.ndarray) -> None:
        """Keep names off a line (inches) that goes along x first, then along y."""
        for i in range(len(x) - 1):
            self.taken.append(_between((x[i], y[i]), (x[i + 1], y[i])))
            self.taken.append(_between((x[i + 1], y[i]), (x[i + 1], y[i + 1])))

    def find(self, x: float, y: float, width: float, height: float) -> tuple[float, float] | None:
        """Return the lower left corner of a free place beside a point for a name of that size, and take it."""
        for corner in _corners(x, y, width, height):
            box = (*corner, corner[0] + width, corner[1] + height)
            if self._holds(box) and not any(_meet(box, other) for other in self.taken):
                self.taken.append(box)
                return corner
        return None

    def _holds(self, box: Box) -> bool:
        return (box[0] >= _FRAME and box[1] >= _FRAME
                and box[2] <= self.width - _FRAME and box[3] <= self.height - _FRAME)  # fmt: skip


def _between(one: tuple[float, float], other: tuple[float, float]) -> Box:
    (x, y), (u, v) = one, other
    return min(x, u), min(y, v), max(x, u), max(y, v)


def _corners(x: float, y: float, width: float, height: float) -> Iterator[tuple[float, float]]:
    for left, below in _PLACES:
        yield (x - left * width + _NEAR * (1 - 2 * left), y - below * height + _NEAR * (1 - 2 * below))


def _meet(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
