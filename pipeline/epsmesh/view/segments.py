"""What a label map holds, before a study exists: size, place and surface of each label."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.label_map import LabelMap
from epsmesh.shapes.files.label_surface import march
from epsmesh.shapes.triangles import SurfaceError, enclosed

MOST_LABELS = 250
# Facets of a page, and the least of a label, before it is made coarser.
_FACETS, _FEWEST = 200_000, 4_000
_TABLE = 1_000_000  # largest label of a table
_VOXELS = 3_000_000  # of the slices of a page
# The drawn surface: filter, in its voxels.
_SMOOTH = 0.8
_LOWEST = 0.1  # of a body's height: what the proposed study supports


@dataclass(frozen=True, eq=False)
class Segment:
    """A label of an image; lengths in m, in the patient's frame.

    ``box`` (2, 3) bounds its voxels, ``within`` are their indices, ``share`` is that of the largest of its ``pieces``
    in its volume (m³), and ``cut`` counts the sides of the image that it reaches.
    """

    label: int
    name: str
    volume: float
    box: FloatArray
    pieces: int
    share: float
    cut: int
    within: tuple[slice, ...]

    @property
    def title(self) -> str:
        """The name, or the number."""
        return self.name or f"label {self.label}"

    @property
    def extent(self) -> FloatArray:
        """Extents (3,) along x, y and z."""
        return np.asarray(self.box[1] - self.box[0])


def segments_of(found: LabelMap) -> list[Segment]:
    """Return what is known of each label, in the order of the labels.

    Raises:
        SurfaceError: if there are none, or so many that the file is an image.
    """
    from scipy import ndimage  # noqa: PLC0415

    labels = found.labels
    if not labels:
        raise SurfaceError("all voxels are 0: it is empty")
    if len(labels) > MOST_LABELS:
        raise SurfaceError(
            f"has {len(labels):,} labels, more than {MOST_LABELS}: it is an image; export its segmentation"
        )
    # One byte a voxel, whatever the values: positions among the labels.
    boxes = ndimage.find_objects(numbered(found))
    voxel = float(np.prod(found.spacing))
    half = np.abs(found.affine[:, :3]).sum(axis=1) / 2
    segments = []
    for label, within in zip(labels, boxes, strict=True):
        mask = found.values[within] == label
        parts, pieces = ndimage.label(mask)
        sizes = np.bincount(parts.ravel())[1:]
        places = (_ends(mask) + [part.start for part in within]) @ found.affine[:, :3].T + found.affine[:, 3]
        ends = sum((p.start == 0) + (p.stop == n) for p, n in zip(within, found.values.shape, strict=True))
        box = np.array([places.min(axis=0) - half, places.max(axis=0) + half])
        share = float(sizes.max() / sizes.sum())
        name = found.names.get(label, "")
        segments.append(Segment(label, name, voxel * float(sizes.sum()), box, pieces, share, ends, within))
    return segments


def numbered(found: LabelMap) -> Any:
    """Return the voxels' positions among the labels, from 1, as bytes; 0 is background."""
    if found.labels[-1] > _TABLE:
        return (np.searchsorted(found.labels, found.values) + 1).astype(np.uint8) * (found.values != 0)
    table = np.zeros(found.labels[-1] + 1, np.uint8)
    table[list(found.labels)] = np.arange(1, len(found.labels) + 1)
    return table[found.values.astype(np.intp, copy=False) if found.values.dtype.kind == "f" else found.values]


def _ends(mask: Any) -> Any:
    """Return the indices (n, 3) of the first and the last voxel of each line along the first axis that has any."""
    is_there = np.argwhere(mask.any(axis=0))
    columns = mask[:, is_there[:, 0], is_there[:, 1]]
    first, last = columns.argmax(axis=0), len(mask) - 1 - columns[::-1].argmax(axis=0)
    return np.vstack([np.column_stack([end, is_there]) for end in (first, last)])


def _faces(mask: Any) -> int:
    """Return the number of the voxels' faces that bound a mask."""
    whole = np.pad(mask, 1)
    return int(sum(np.diff(whole, axis=axis).sum() for axis in range(3)))


def height_to_fix(segment: Segment) -> float:
    """Return the height z (m) below which a first study supports the body: a tenth of it."""
    low, high = segment.box[:, 2]
    return float(low + _LOWEST * (high - low))


def block(segment: Segment, file: str, unit: str = "", names: str = "") -> str:
    """Return a ``[body]`` of a study, in TOML: the label, supported at its lowest tenth."""
    from epsmesh.study.toml import to_toml  # noqa: PLC0415

    body = {"shape": "image", "file": file, "label": segment.name or segment.label}
    more = {"unit": unit, "names": names}
    body |= {key: value for key, value in more.items() if value}
    return f'{to_toml({"body": body}, file).strip()}\nfixed = {{ below = "{1e3 * height_to_fix(segment):.0f} mm" }}'


def surfaces_of(found: LabelMap, segments: list[Segment]) -> list[tuple[FloatArray, IntArray]]:
    """Return points (n, 3), in m, and facets of each label as a page draws it: all pieces, large labels coarser."""
    masks = [found.values[one.within] == one.label for one in segments]
    faces = np.array([2.0 * _faces(mask) for mask in masks])
    allowed = np.maximum(_FEWEST, _FACETS * faces / faces.sum())
    return [
        _surface(found, one, mask, float(np.sqrt(max(1.0, count / most))))
        for one, mask, count, most in zip(segments, masks, faces, allowed, strict=True)
    ]


def _surface(found: LabelMap, segment: Segment, mask: Any, coarser: float) -> tuple[FloatArray, IntArray]:
    from scipy import ndimage  # noqa: PLC0415

    size = coarser * float(np.prod(found.spacing)) ** (1 / 3)
    stride = np.maximum(1, np.round(size / found.spacing)).astype(int) if coarser > 1 else np.ones(3, dtype=int)
    low = [(0, int(-n % s)) for n, s in zip(mask.shape, stride, strict=True)]
    blocks = np.pad(mask, low).astype(np.float32)
    counts = [n // s for n, s in zip(blocks.shape, stride, strict=True)]
    blocks = blocks.reshape([part for pair in zip(counts, stride, strict=True) for part in pair]).mean(axis=(1, 3, 5))
    blocks = np.pad(blocks, 4)
    smooth = ndimage.gaussian_filter(blocks, _SMOOTH)
    # Thin vessels have nothing above one half.
    points, facets = march(smooth, 0.5 * min(1.0, float(smooth.max())))
    indices = (points - 4) * stride + (stride - 1) / 2 + [part.start for part in segment.within]
    places = indices @ found.affine[:, :3].T + found.affine[:, 3]
    return places, facets if enclosed(places, facets) > 0 else facets[:, ::-1]


def slices_of(found: LabelMap) -> tuple[Any, FloatArray]:
    """Return :func:`numbered` voxels as a page slices them, and their affine (3, 4), in m.

    Axes are turned and mirrored so that they are as near as can be to x, y and z; large maps are thinned.
    """
    values, affine = numbered(found), found.affine.copy()
    order = _nearest_axes(affine[:, :3])
    values, affine[:, :3] = values.transpose(order), affine[:, order]
    for axis in range(3):
        if affine[axis, axis] < 0:
            values = np.flip(values, axis)
            affine[:, 3] += affine[:, axis] * (values.shape[axis] - 1)
            affine[:, axis] *= -1
    size = (values.size / _VOXELS) ** (1 / 3) * float(np.prod(found.spacing)) ** (1 / 3)
    spacing = np.linalg.norm(affine[:, :3], axis=0)
    stride = np.maximum(1, np.ceil(size / spacing - 1e-9)).astype(int) if values.size > _VOXELS else [1, 1, 1]
    affine[:, :3] = affine[:, :3] * stride
    return np.ascontiguousarray(values[:: stride[0], :: stride[1], :: stride[2]]), affine


def _nearest_axes(directions: FloatArray) -> list[int]:
    """Return the voxel axis that is nearest to each of x, y and z."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415

    unit = np.abs(directions) / np.linalg.norm(directions, axis=0)
    return [int(k) for k in linear_sum_assignment(-unit)[1]]
