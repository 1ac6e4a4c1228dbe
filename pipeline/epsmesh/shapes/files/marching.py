"""Surfaces between the labels of a grid: marching tetrahedra for any number of labels.

Cubes of the grid are divided into six tetrahedra each. A corner is outside, or its label is that of its largest weight.
Each tetrahedron is divided between the labels of its corners: by points on its edges where the weights of two labels
are equal, in its faces where those of three are, and inside. Facets are cones from one point over lines in the faces of
a tetrahedron, so that none of them cross, and the surface around every label is closed.
"""

from itertools import combinations

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray

# Corners of a cube by their bits, x, y, z, in six tetrahedra around its diagonal (H. W. Kuhn, 1960).
_CUBE = ((0, 1, 3, 7), (0, 5, 1, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 6, 4, 7))
# Smallest barycentric coordinate of a point: closer to a corner of the grid, facets would be slivers.
_AWAY = 0.05
_FLAT = 1e-9

# A point is named by the corners of the edge, face or tetrahedron that it is in. A facet has three points; behind and
# before it are the labels of two corners.
_Facet = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...], int, int]
_ALL = (0, 1, 2, 3)
# Corner 0 has one label, the others another.
_ONE: tuple[_Facet, ...] = (((0, 1), (0, 2), (0, 3), 0, 1),)
# Corners 0 and 1 have one label, 2 and 3 another.
_TWO: tuple[_Facet, ...] = (((0, 2), (0, 3), (1, 3), 0, 2), ((0, 2), (1, 3), (1, 2), 0, 2))
# Corners 0 and 1 have one label, 2 and 3 have one each.
_THREE: tuple[_Facet, ...] = (
    (_ALL, (0, 2), (0, 2, 3), 0, 2), (_ALL, (1, 2, 3), (1, 2), 0, 2), (_ALL, (1, 2), (0, 2), 0, 2),
    (_ALL, (0, 2, 3), (0, 3), 0, 3), (_ALL, (0, 3), (1, 3), 0, 3), (_ALL, (1, 3), (1, 2, 3), 0, 3),
    (_ALL, (2, 3), (0, 2, 3), 2, 3), (_ALL, (1, 2, 3), (2, 3), 2, 3),
)  # fmt: skip
# All four differ: around each edge (i, j) there are two faces, (i, j, k) and (i, j, l).
_AROUND = ((2, 3, 0, 1), (0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 2, 0))
_FOUR: tuple[_Facet, ...] = tuple(
    facet
    for i, j, k, m in _AROUND
    for facet in ((_ALL, (i, j, m), (i, j), i, j), (_ALL, (i, j), (i, j, k), i, j))
)  # fmt: skip


def march(outside: FloatArray, weights: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the surface between what is outside and labels, and the surfaces between the labels.

    ``outside`` (nx, ny, nz) is positive there. Elsewhere the label is that of the largest of ``weights``
    (k, nx, ny, nz), which are numbered from 0. Where labels meet, they do not change the surface to the outside.
    The result are points (n, 3) in indices, facets (m, 3), and the labels (m, 2) behind and before each facet. The
    label behind is the larger one; -1 is outside.
    """
    shape = outside.shape
    label = np.where(outside > 0, 0, 1 + weights.argmax(axis=0))
    weights = np.concatenate([outside[None], weights])
    tetrahedra, odd = _mixed(label)
    flat, labels = weights.reshape(len(weights), -1), label.ravel()
    own = labels[tetrahedra]
    distinct = (np.diff(np.sort(own, axis=1), axis=1) != 0).sum(axis=1) + 1
    single = (own == own[:, :1]).sum(axis=1) == 1
    names, sides = [], []
    for facets, chosen in (
        (_ONE, (distinct == 2) & single), (_TWO, (distinct == 2) & ~single), (_THREE, distinct == 3),
        (_FOUR, distinct == 4),
    ):  # fmt: skip
        corners, turned, own_chosen = tetrahedra[chosen], odd[chosen], own[chosen]
        named = {point: _named(corners[:, list(point)], shape) for facet in facets for point in facet[:3]}
        for *points, behind, before in facets:
            name = np.stack([named[point] for point in points], axis=1)
            name[turned] = name[turned][:, ::-1]
            names.append(name)
            sides.append(own_chosen[:, [behind, before]])
    distinct_names, number = np.unique(np.vstack(names), return_inverse=True)
    facets_found, pairs = number.reshape(-1, 3), np.vstack(sides)
    turned = pairs[:, 0] < pairs[:, 1]
    facets_found[turned], pairs[turned] = facets_found[turned][:, ::-1], pairs[turned][:, ::-1]
    return _places(_corners(distinct_names, shape), flat, labels, shape), facets_found, pairs - 1


def _mixed(label: IntArray) -> tuple[IntArray, BoolArray]:
    """Return the tetrahedra (n, 4) with more than one label, as numbers of voxels, and whether each is inverted.

    Corners whose labels are alone come first if the others are alike, otherwise last.
    """
    shape = label.shape
    corners = [((bits >> 0) & 1, (bits >> 1) & 1, (bits >> 2) & 1) for bits in range(8)]
    shifted = [label[tuple(slice(o, n - 1 + o) for o, n in zip(corner, shape, strict=True))] for corner in corners]
    cubes = np.argwhere(np.logical_or.reduce([other != shifted[0] for other in shifted[1:]]))
    numbers = np.stack([np.ravel_multi_index(tuple((cubes + corner).T), shape) for corner in np.array(corners)], axis=1)
    tetrahedra = numbers[:, np.array(_CUBE)].reshape(-1, 4)
    own = label.ravel()[tetrahedra]
    mixed = (own != own[:, :1]).any(axis=1)
    tetrahedra, own = tetrahedra[mixed], own[mixed]
    alike = (own[:, :, None] == own[:, None]).sum(axis=2)
    first = np.where(alike.max(axis=1) == 3, alike.T, -alike.T).T
    order = np.lexsort((own, first), axis=1)
    odd = np.linalg.det(np.eye(4)[order]) < 0
    return np.take_along_axis(tetrahedra, order, axis=1), odd


def _named(corners: IntArray, shape: tuple[int, ...]) -> IntArray:
    """Return the names (n) of points by the corners (n, k) of the simplices that they are in.

    A simplex follows a cube's edges from its first corner: the others are named by bits, as corners of that cube.
    """
    ordered = np.sort(corners, axis=1)
    name = ordered[:, 0]
    for k in range(1, 4):
        bits: IntArray | int = 0
        if k < ordered.shape[1]:
            x, y, z = np.unravel_index(ordered[:, k] - ordered[:, 0], shape)
            bits = x + 2 * y + 4 * z
        name = 8 * name + bits
    return np.asarray(name)


def _corners(names: IntArray, shape: tuple[int, ...]) -> IntArray:
    """Return the corners (n, 4) of the simplices with these ``names`` (n); -1 comes first, for none."""
    first, corners = names >> 9, []
    for bits in ((names >> 6) & 7, (names >> 3) & 7, names & 7):
        step = np.ravel_multi_index((bits & 1, (bits >> 1) & 1, bits >> 2), shape)
        corners.append(np.where(bits > 0, first + step, -1))
    return np.sort(np.column_stack([first, *corners]), axis=1)


def _places(names: IntArray, weights: FloatArray, labels: IntArray, shape: tuple[int, ...]) -> FloatArray:
    """Return the places (n, 3), in indices, of the points with these names."""
    places = np.empty((len(names), 3))
    count = (names >= 0).sum(axis=1)
    for size in (2, 3, 4):
        chosen = np.flatnonzero(count == size)
        corners = names[chosen][:, 4 - size :]
        shares = _equal(corners, weights, labels)
        at = np.stack(np.unravel_index(corners, shape), axis=2).astype(np.float64)
        places[chosen] = np.einsum("nk,nki->ni", shares, at)
    return places


def _equal(corners: IntArray, weights: FloatArray, labels: IntArray) -> FloatArray:
    """Return the barycentric coordinates (n, k) of the points in simplices at which the weights of all labels agree.

    They are positive: if there is no such point inside, it is moved there.

    In a tetrahedron with three labels, that is the middle between the points in its two faces with three labels.
    """
    size = corners.shape[1]
    order = np.argsort(labels[corners], axis=1)
    corners = np.take_along_axis(corners, order, axis=1)
    own = labels[corners]
    alike = (own[:, :, None] == own[:, None]).sum(axis=2)
    shares = np.full(corners.shape, 1 / size)
    whole = alike.max(axis=1, initial=1) == 1
    values = weights[own[whole][:, :, None], corners[whole][:, None]].astype(np.float64)
    inner = own[whole][:, 0] > 0
    found = np.empty((len(values), size))
    found[inner] = _inside(_balanced(values[inner]))
    # Points of the body's surface are in the plane of its points on edges, wherever the labels meet.
    outer = values[~inner]
    cuts = _inside(np.stack([-outer[:, 0, 1:], np.broadcast_to(outer[:, 0, :1], outer[:, 0, 1:].shape)], axis=2), 2)
    at_cuts = cuts[:, None, :, 0] * outer[:, 1:, :1] + cuts[:, None, :, 1] * outer[:, 1:, 1:]
    among = _inside(_balanced(at_cuts))
    found[~inner] = np.column_stack([(among * cuts[:, :, 0]).sum(axis=1), among * cuts[:, :, 1]])
    shares[whole] = found
    if size == len(_ALL) and not whole.all():
        shares[~whole] = 0.0
        for face in combinations(_ALL, 3):
            (left_out,) = {*_ALL} - {*face}
            chosen = np.flatnonzero(~whole & (alike[:, left_out] == 2))
            part = _equal(corners[chosen][:, list(face)], weights, labels)
            shares[chosen[:, None], np.array(face)] += part / 2
    return np.asarray(np.take_along_axis(shares, np.argsort(order, axis=1), axis=1))


def _balanced(values: FloatArray) -> FloatArray:
    """Return barycentric coordinates (n, k) at which k functions agree, by their ``values`` (n, k, k) at k corners."""
    count, size = values.shape[:2]
    system = np.concatenate([values[:, :-1] - values[:, -1:], np.ones((count, 1, size))], axis=1)
    shares = np.full((count, size), 1 / size)
    solvable = np.abs(np.linalg.det(system)) > _FLAT
    right = np.broadcast_to(np.eye(size)[-1], (int(solvable.sum()), size))[:, :, None]
    shares[solvable] = np.linalg.solve(system[solvable], right)[:, :, 0]
    return shares


def _inside(shares: FloatArray, axis: int = 1) -> FloatArray:
    """Return barycentric coordinates, along an axis, clipped to the inside."""
    shares = shares / shares.sum(axis=axis, keepdims=True)
    shares = np.clip(shares, _AWAY, 1.0)
    return np.asarray(shares / shares.sum(axis=axis, keepdims=True))
