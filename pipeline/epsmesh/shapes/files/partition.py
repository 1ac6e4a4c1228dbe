"""Surfaces between several labels of a label map, smoothed together: neighbours share them.

The surface of the body, the union of all labels, is that of a single label (:mod:`.label_surface`): labels within it do
not dent it. Inside, the indicator of every label passes a filter, and a point belongs to the label with the largest
one, times a factor by which the label keeps its volume.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi, sqrt
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.complex import OUTSIDE, TISSUE, Complex
from epsmesh.shapes.files.edges import Edges
from epsmesh.shapes.files.label_surface import (
    REACH,
    check_offset,
    default_smooth,
    filtered,
    one_piece,
    shifted_level,
)
from epsmesh.shapes.files.labels import LabelMap, of_label
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.files.marching import march
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.triangles import SurfaceError, doubled_normals
from epsmesh.units import canonical

# Tolerance on volumes in the search for the factors, most steps, and largest step (of a logarithm).
_SAME_VOLUME, _STEPS, _LARGEST = 5e-4, 12, 0.5
# A step's part of what was wanted that is believed.
_LEAST_GAIN, _MOST_GAIN = 0.1, 3.0
# A region must keep its volume within this share; parts below this number of voxels are left to their neighbours.
MOST_VOLUME, CRUMB = 0.01, 8
# Widths of the filter of a label that is too thin for others, in voxels.
_NARROW = (0.5, 0.0)
# Labels meet if there are at most so many voxels between them.
_BETWEEN = 2
# Neighbours of a voxel in the tetrahedra of :func:`march`.
_BESIDE = np.array(
    [[[1, 1, 0], [1, 1, 0], [0, 0, 0]], [[1, 1, 0], [1, 1, 1], [0, 1, 1]], [[0, 0, 0], [0, 1, 1], [0, 1, 1]]]
)
_TINY, _EVEN = 1e-6, 0.5


def do_meet(found: LabelMap, labels: Sequence[int | str]) -> bool:
    """Return whether labels of regions, those after the first, nearly meet each other or what is outside of all."""
    from scipy import ndimage  # noqa: PLC0415

    masks = [of_label(found, label) for label in labels]
    others = np.where(masks[0], TISSUE, OUTSIDE)
    for region, mask in enumerate(masks[1:], start=1):
        others[mask] = region
    for region, mask in enumerate(masks[1:], start=1):
        own = ndimage.find_objects(mask.astype(np.int8))[0]
        if found.sides(own):
            return True
        box = tuple(slice(max(s.start - _BETWEEN, 0), s.stop + _BETWEEN) for s in own)
        near = ndimage.binary_dilation(mask[box], iterations=_BETWEEN)
        if np.isin(others[box][near], (TISSUE, region), invert=True).any():
            return True
    return False


def partition_of(found: LabelMap, labels: Sequence[tuple[int | str, float | None]], offset: float = 0.0) -> Loaded:
    """Return the surface (m) of a body, and those between its label, those of its regions, and what is outside.

    The body, the union of all ``labels``, is one piece without hollows. The first label has the number 0, that of the
    body's own tissue, the others 1 and so on. Each has the standard deviation (m) of its filter, None for the default.
    ``offset`` (m) shifts the body's surface outward; regions that it bounds follow.

    A label that is too thin for its default filter has a narrower one.

    Raises:
        SurfaceError: if a label has no voxels, or is thinner than the filter, or that is too narrow for the offset.
    """
    try:
        return _parted(found, labels, offset)
    except _ThinError as thin:
        narrower = _narrower(found, labels, offset, thin)
        if narrower is None:
            raise SurfaceError(f"{thin}: give its voxels to a neighbour") from None
        length, made = narrower
        if thin.number == 0 or labels[thin.number][1] is not None:
            raise SurfaceError(f'{thin}: give it `smooth = "{in_mm(length)}"`, which suffices') from None
        notice = f"label {labels[thin.number][0]} is thin: its filter is {in_mm(length)} wide"
        return replace(made, notices=(*made.notices, notice))


def _narrower(
    found: LabelMap, labels: Sequence[tuple[int | str, float | None]], offset: float, thin: "_ThinError"
) -> tuple[float, Loaded] | None:
    """Return the widest filter (m) tried with which a thin label keeps its volume, and the surfaces; None if none."""
    voxel = float(np.prod(found.spacing)) ** (1 / 3)
    for share in _NARROW:
        length = canonical(share * voxel)
        own = [(label, length if n == thin.number else given) for n, (label, given) in enumerate(labels)]
        try:
            return length, _parted(found, own, offset)
        except SurfaceError:
            continue
    return None


class _ThinError(SurfaceError):
    """The label of a ``number`` is thinner than its filter."""

    def __init__(self, number: int, what: str):
        super().__init__(what)
        self.number = number


def _parted(found: LabelMap, labels: Sequence[tuple[int | str, float | None]], offset: float) -> Loaded:
    names, lengths = [label for label, _ in labels], [length for _, length in labels]
    masks = [of_label(found, label) for label in names]
    body, start, notices = one_piece(np.logical_or.reduce(masks), found)
    box = tuple(slice(s, s + n) for s, n in zip(start, body.shape, strict=True))
    number = np.where(body, 0, OUTSIDE)
    for region, mask in enumerate(masks[1:], start=1):
        number[mask[box] & body] = region
    default = default_smooth(found.spacing)
    sigmas = [(default if length is None else length) / found.spacing for length in lengths]
    check_offset(offset / found.spacing, sigmas[0])
    margin = np.ceil(REACH * np.max(sigmas, axis=0)).astype(int) + 2
    number = np.pad(number, [(m, m) for m in margin], constant_values=OUTSIDE)
    whole, width = filtered(number != OUTSIDE, sigmas[0], may_narrow=lengths[0] is None)
    weights, said = _without_crumbs(whole, _weights(number, sigmas, [length is None for length in lengths]), names)
    points, facets, sides, level = _keeping_volumes(whole, weights, number, (width, sigmas[0]), names)
    if offset:
        shifted = np.float32(shifted_level(level, offset / found.spacing, width))
        points, facets, sides = march(1 - whole / shifted, weights)
    places = (points + (start - margin)) @ found.affine[:, :3].T + found.affine[:, 3]
    if np.linalg.det(found.affine[:, :3]) < 0:  # a mirrored frame
        facets = np.ascontiguousarray(facets[:, ::-1])
    partition = Complex(places, facets, sides)
    if Edges(partition.skin.facets).shells[0] > 1:
        raise SurfaceError("the body is thinner somewhere than the width of the filter: give a smaller `smooth`")
    return Loaded(partition.skin, (*found.notices, *notices, *said), partition=partition)


def _weights(number: IntArray, sigmas: Sequence[FloatArray], may_narrow: Sequence[bool]) -> FloatArray:
    """Return the filtered indicators (count, nx, ny, nz) of the labels; their sum is 1.

    Labels are continued outside of the body, so that its surface does not bend those between them. A thin label, with
    its narrower filter, comes first; the others share what it leaves.
    """
    if len(sigmas) > 1:
        from scipy.ndimage import distance_transform_edt  # noqa: PLC0415

        nearest = distance_transform_edt(number == OUTSIDE, return_distances=False, return_indices=True)
        number = number[tuple(nearest)]
    passed = [
        filtered(number == label, sigma, may_narrow=may and label > 0)
        for label, (sigma, may) in enumerate(zip(sigmas, may_narrow, strict=True))
    ]
    weights = np.stack([values for values, _ in passed])
    wide = [width.max() >= sigmas[0].max() for _, width in passed]
    if not all(wide):
        left = np.maximum(1 - weights[np.logical_not(wide)].sum(axis=0), 0.0)
        weights[wide] *= left / np.maximum(weights[wide].sum(axis=0), _TINY)
    return np.asarray(weights)


def _without_crumbs(whole: Any, weights: FloatArray, labels: Sequence[int | str]) -> tuple[FloatArray, list[str]]:
    """Return the weights with parts of a few voxels left to their neighbours, and notices of them.

    Loose parts of the ``whole`` body are removed from it, and hollows closed, in place.
    """
    from scipy import ndimage  # noqa: PLC0415

    def parts(mask: Any) -> tuple[Any, Any]:
        part, _ = ndimage.label(mask, _BESIDE)
        sizes = np.bincount(part.ravel())
        sizes[0] = 0
        return part, sizes

    for is_inside in (True, False):
        part, sizes = parts((whole >= _EVEN) == is_inside)
        whole[(part > 0) & (part != sizes.argmax())] = 1.0 - is_inside
    largest, said = weights.argmax(axis=0), []
    inside = whole >= _EVEN
    for label in range(len(weights)):
        part, sizes = parts(inside & (largest == label))
        crumbs = (sizes < CRUMB) & (sizes > 0)
        if crumbs.any():
            weights[label][crumbs[part]] = 0.0
            said.append(
                f"label {labels[label]}: parts of less than {CRUMB} voxels, {sizes[crumbs].sum():,} in all, left to "
                "their neighbours"
            )
    return weights, said


def _keeping_volumes(
    whole: Any,
    weights: FloatArray,
    number: IntArray,
    widths: tuple[FloatArray, FloatArray],
    labels: Sequence[int | str],
) -> tuple[FloatArray, IntArray, IntArray, float]:
    """Return the surfaces (see :func:`march`) at which the body and all labels keep their volumes.

    The weights are multiplied by the factors of the labels, in place. The last result is the level of the body.

    Newton's method: across a plane, the filtered indicator has the slope 1 / (√(2π) σ), so that the logarithm of a
    factor moves it by √(2π) σ / 4. The ``widths`` are σ of the body and of its labels, in voxels.
    """
    count = len(weights)
    wanted = np.bincount(number[number != OUTSIDE], minlength=count).astype(np.float64)
    move, within = (sqrt(2 * pi) * float(np.prod(width)) ** (1 / 3) / 4 for width in widths)
    logarithm, of_body = np.zeros(count), 0.0
    gain, before = np.ones(count), np.full(count, np.nan)
    for _ in range(_STEPS):
        factors = np.exp(logarithm).astype(np.float32)[:, None, None, None]
        points, facets, sides = march(1 - whole * np.float32(1 + np.exp(of_body)), weights * factors)
        shares = _volumes(points, facets, sides, count) / wanted
        if not move or np.abs(shares - 1).max() < _SAME_VOLUME or (shares <= 0).any():
            break
        # Thin labels, and curved surfaces, move by more or less than that.
        with np.errstate(divide="ignore", invalid="ignore"):
            came = (shares - before) / (1 - before)
        known = (came > _LEAST_GAIN) & (abs(before - 1) > _SAME_VOLUME)
        gain, before = np.where(known, gain / np.minimum(came, _MOST_GAIN), gain), shares
        areas = np.linalg.norm(doubled_normals(points, facets), axis=1) / 2
        skin = sides[:, 1] == OUTSIDE
        of_body += float(np.clip((wanted * (1 - shares)).sum() / (move * areas[skin].sum()), -_LARGEST, _LARGEST))
        if count == 1:
            continue
        slope = np.zeros((count, count))
        np.add.at(slope, tuple(sides[~skin].T), -within * areas[~skin])
        slope += slope.T
        slope -= np.diag(slope.sum(axis=1))
        # What the body's surface gives to a label that it bounds.
        excess = (wanted * (1 - shares)).sum() / areas[skin].sum()
        given = excess * np.bincount(sides[skin, 0], areas[skin], minlength=count)
        step = np.linalg.solve(slope[1:, 1:], (gain * (wanted * (1 - shares) - given))[1:])
        logarithm[1:] += np.clip(step, -_LARGEST, _LARGEST)
    off = np.abs(shares - 1)
    if move and (off > MOST_VOLUME).any():
        worst = int(off.argmax())
        change = "by which it would vanish" if shares[worst] <= 0 else f"which changes its volume by {off[worst]:.0%}"
        raise _ThinError(worst, f"label {labels[worst]} is thinner than the width of the filter, {change}")
    weights *= factors
    return points, facets, sides, 1 / (1 + float(np.exp(of_body)))


def _volumes(points: FloatArray, facets: IntArray, sides: IntArray, count: int) -> FloatArray:
    """Return the volumes of the labels, in voxels."""
    a, b, c = (points[facets[:, k]] - points.mean(axis=0) for k in range(3))
    parts = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    behind = np.bincount(sides[:, 0], parts, minlength=count)
    inner = sides[:, 1] != OUTSIDE
    return np.asarray(behind - np.bincount(sides[inner, 1], parts[inner], minlength=count))
