"""Frames of tangents and normal at surface nodes, in which contact holds the normal displacement."""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray

# A normal closer to the x axis than this (cosine) takes its first tangent from the z axis.
_ALONG_X = 0.9


def turned_frames(normal: FloatArray, chosen: BoolArray) -> FloatArray:
    """Return an orthonormal frame (n, d, d) at each node: tangents first, the unit ``normal`` (n, d) last.

    The tangents are those nearest to the first coordinate axes. Where a normal is in a plane of symmetry, the plane's
    own normal is therefore the tangent in the same slot. The identity at nodes that are not ``chosen`` (n).
    """
    count, dim = normal.shape
    frames = np.broadcast_to(np.eye(dim), (count, dim, dim)).copy()
    n = normal[chosen]
    if dim == 1:
        frames[chosen] = n[:, :, None]
        return frames
    if dim == 2:
        first = np.column_stack([np.abs(n[:, 1]), -n[:, 0] * np.where(n[:, 1] < 0, -1.0, 1.0)])
        frames[chosen] = np.stack([first, n], axis=2)
        return frames
    start = np.where((np.abs(n[:, 0]) < _ALONG_X)[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    first = start - np.einsum("ni,ni->n", start, n)[:, None] * n
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(n, first)
    second *= np.where(second[:, 1] < 0, -1.0, 1.0)[:, None]
    frames[chosen] = np.stack([first, second, n], axis=2)
    return frames
