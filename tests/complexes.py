"""Bodies of several regions for the tests."""

from collections import Counter

import numpy as np

from epsmesh.shapes.complex import OUTSIDE, Complex
from epsmesh.shapes.files.labels import LabelMap
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.files.partition import partition_of
from epsmesh.shapes.triangles import half_edges

AXES = np.array([36.0, 27.0, 20.0])  # mm
CENTRE, INNER = np.array([-12.0, 3.0, 0.0]), np.array([13.0, 9.0, 8.0])


def scene(spacing: tuple[float, float, float]) -> LabelMap:
    """Return an ellipsoid with another inside it, and a third part that ends at the surface, by voxels in mm."""
    steps = np.array(spacing)
    count = np.ceil(2 * (AXES + 4) / steps).astype(int)
    origin = (0.5 - count / 2) * steps
    x = np.moveaxis(np.indices(count), 0, -1) * steps + origin
    labels = (((x / AXES) ** 2).sum(axis=-1) < 1).astype(int)
    labels[(labels == 1) & (((x - CENTRE) / INNER) ** 2 < 1 / 3).all(axis=-1)] = 1
    labels[(((x - CENTRE) / INNER) ** 2).sum(axis=-1) < 1] = 7
    labels[(labels == 1) & (x[..., 0] > 18)] = 5
    return LabelMap(labels, 1e-3 * np.column_stack([np.diag(steps), origin]))


def parted(image: LabelMap, *labels: int, smooth: float | None = None, offset: float = 0.0) -> Loaded:
    """Return the surfaces between labels, all with the same filter (m)."""
    return partition_of(image, [(label, smooth) for label in labels], offset)


def are_closed(facets, sides, regions) -> bool:
    """Return whether each region's boundary has every edge once in either direction."""
    for region in regions:
        behind, before = (np.asarray(sides) == region).T
        around = np.vstack([facets[behind], facets[before][:, ::-1]])
        times = Counter(map(tuple, half_edges(around).tolist()))
        if any(count != 1 or times[b, a] != 1 for (a, b), count in times.items()):
            return False
    return True


def neighbours(body: Complex) -> set[tuple[int, int]]:
    """Return the pairs of regions that meet, lower first."""
    return {(min(pair), max(pair)) for pair in body.sides.tolist()}


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
