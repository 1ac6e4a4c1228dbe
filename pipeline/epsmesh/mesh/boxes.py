"""Boxes of a plane, halved until each is small enough for its place, and cut into triangles.

A box is a row of r0, r1, z0, z1. The place where a side is cut depends on that side alone. Corners of neighbours are
then either bitwise equal or far apart.
"""

from collections.abc import Callable, Sequence

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray

# For boxes (n, 4): whether each is too large, and whether its second side is the longer one.
Judge = Callable[[FloatArray], tuple[BoolArray, BoolArray]]


def halve_boxes(boxes: FloatArray, marks: Sequence[FloatArray], judge: Judge) -> FloatArray:
    """Halve ``boxes`` across the longer side until ``judge`` finds none too large; return the resulting boxes, (n, 4).

    ``marks`` are places along each of the two axes; where boxes become small enough, their sides pass through them.
    """
    todo, done = boxes, []
    while len(todo):
        large, tall = judge(todo)
        done.append(todo[~large])
        todo = np.vstack([_halve(todo[large & (tall == bool(axis))], axis, marks[axis]) for axis in (0, 1)])
    return np.vstack(done)


def triangulate(boxes: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Connect the centre of each box to all corners, its own and its neighbours', on its boundary.

    Return the points (n, 2), the triangles (m, 3), and the box (m,) of each triangle.
    """
    r0, r1, z0, z1 = boxes.T
    corners = np.array([(r0, z0), (r1, z0), (r1, z1), (r0, z1)])  # (4, 2, n), counter-clockwise
    points, number = np.unique(corners.transpose(0, 2, 1).reshape(-1, 2), axis=0, return_inverse=True)
    number = number.reshape(4, -1)
    centre = len(points) + np.arange(len(boxes))
    cells, owners = [], []
    for side, fixed in enumerate((1, 0, 1, 0)):
        # In this order, the points between the two ends of a side are those on it.
        order = np.lexsort((points[:, 1 - fixed], points[:, fixed]))
        place = np.argsort(order)
        start, end = place[number[side]], place[number[(side + 1) % 4]]
        count, step = np.abs(end - start), np.sign(end - start)
        box = np.repeat(np.arange(len(boxes)), count)
        along = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
        first = start[box] + step[box] * along
        cells.append(np.column_stack([centre[box], order[first], order[first + step[box]]]))
        owners.append(box)
    middles = np.column_stack([(r0 + r1) / 2, (z0 + z1) / 2])
    return np.vstack([points, middles]), np.vstack(cells), np.concatenate(owners)


def _halve(boxes: FloatArray, axis: int, marks: FloatArray) -> FloatArray:
    """Cut boxes across ``axis`` at a mark in the middle half of their side, if there is one, else in the middle."""
    low, high = boxes[:, 2 * axis], boxes[:, 2 * axis + 1]
    middle = cut = (low + high) / 2
    for mark in marks:
        cut = np.where(np.abs(mark - middle) <= (high - low) / 4, mark, cut)
    first, second = boxes.copy(), boxes.copy()
    first[:, 2 * axis + 1] = second[:, 2 * axis] = cut
    return np.vstack([first, second])
