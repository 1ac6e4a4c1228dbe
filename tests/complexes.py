"""Bodies of several regions for the tests."""

import numpy as np

from pipeline.shapes.complex import OUTSIDE, Complex


def blocks(labels: np.ndarray, size: float = 10e-3) -> Complex:
    """Return cubes (m) whose region numbers are ``labels`` (nx, ny, nz), by the faces between different ones."""
    around = np.pad(labels, 1, constant_values=OUTSIDE)
    corners, sides = [], []
    square = np.array([(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)])
    for axis in range(3):
        first = around.transpose(np.roll(range(3), -axis))
        for at in np.argwhere(first[:-1] != first[1:]):
            corners.append(np.roll(square + at, axis, axis=1))
            sides.append((first[tuple(at)], first[at[0] + 1, at[1], at[2]]))
    points, facets = np.unique(np.vstack(corners), axis=0, return_inverse=True)
    quads, pairs = facets.reshape(-1, 4), np.array(sides)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Complex(points * size, triangles, np.vstack([pairs, pairs]))
