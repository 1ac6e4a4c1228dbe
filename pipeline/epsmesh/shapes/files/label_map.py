"""A label map: an integer for each voxel, the positions of the voxels, and the names of the labels."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.loaded import Label
from epsmesh.shapes.triangles import SurfaceError

UNITS = {"m": 1.0, "meter": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "micron": 1e-6}
MOST_VOXELS = 1_000_000_000
# Most bytes of values, also after unpacking: a larger label map does not fit into memory.
LARGEST_IMAGE = 4_000_000_000
_SHOWN = 20
_WALL = 3  # voxels of tissue between a cavity and the outside: two or less count as touching
_MANY = 1_000_000  # labels: numbers beyond are sorted
# Of the patient, towards lower and higher x, y and z.
_SIDES = (("left", "right"), ("back", "front"), ("feet", "head"))


@dataclass(frozen=True)
class LabelMap:
    """``values`` (nx, ny, nz), integers, and the ``affine`` (3, 4) from voxel indices to positions.

    Positions are in m, in the patient's frame: x to the right, y to the front (anterior), z to the head (superior).
    ``names`` are those of labels, as far as known; labels without voxels may have one.
    """

    values: Any
    affine: FloatArray
    notices: tuple[str, ...] = ()
    names: Mapping[int, str] = field(default_factory=dict)

    @property
    def spacing(self) -> FloatArray:
        """Sizes (3,) of a voxel (m)."""
        size: FloatArray = np.linalg.norm(self.affine[:, :3], axis=0)
        return size

    @property
    def labels(self) -> tuple[int, ...]:
        """Labels of voxels, without 0."""
        if self.values.dtype.kind == "f" or (largest := int(self.values.max(initial=0))) > _MANY:
            return tuple(int(k) for k in np.unique(self.values) if k)
        is_there = np.zeros(largest + 1, dtype=bool)
        is_there[self.values] = True  # in one pass: to sort the voxels takes ten times as long
        return tuple(int(k) for k in np.flatnonzero(is_there) if k)

    def number(self, label: int | str) -> int:
        """Return the number of a label that is given by number or name.

        Letters may be capital or small, and spaces may be underscores, if one label alone is then meant.

        Raises:
            SurfaceError: if no label, or more than one, has the name; the message has the names that exist.
        """
        if isinstance(label, int):
            return label
        for same in (str, _simple):
            found = [number for number, name in self.names.items() if same(name) == same(label)]
            if len(found) == 1:
                return found[0]
            if found:
                several = ", ".join(map(str, found))
                raise SurfaceError(f"`{label}` is the name of labels {several}: give the number")
        if not self.names:
            raise SurfaceError(
                f'names no labels, and asked for is label = "{label}": give the number, one of '
                f'{_listed(self.labels)}, or `names`, such as names = "labels.txt"'
            )
        there = [self.names[number] for number in self.labels if number in self.names]
        near = get_close_matches(_simple(label), {_simple(name): name for name in there}, n=3)
        meant = f"; is it {' or '.join(name for name in there if _simple(name) in near)}?" if near else ""
        raise SurfaceError(f"no label has the name `{label}`; names are {_listed(there)}{meant}")

    def sides(self, box: Sequence[slice]) -> list[str]:
        """Return the sides of the image that a box of voxels reaches, with their places in the patient's frame."""
        found = []
        for axis, (part, size) in enumerate(zip(box, self.values.shape, strict=True)):
            column = self.affine[:, axis]
            along = int(np.abs(column).argmax())
            for is_reached, index in ((part.start == 0, -0.5), (part.stop == size, size - 0.5)):
                if is_reached:
                    middle = [(one.start + one.stop - 1) / 2 for one in box]
                    middle[axis] = index
                    place = float(self.affine[along, :3] @ middle + self.affine[along, 3])
                    name = _SIDES[along][int((index > 0) == (column[along] > 0))]
                    found.append(f"{name} ({'xyz'[along]} = {1e3 * place:.4g} mm)")
        return found

    def written(self, label: int) -> str:
        """Return a label with its name, for messages."""
        return f"{label} ({self.names[label]})" if label in self.names else str(label)


def _simple(name: str) -> str:
    return name.casefold().replace(" ", "_").replace("-", "_")


def _listed(values: Sequence[Any]) -> str:
    return ", ".join(map(str, values[:_SHOWN])) + (f", … ({len(values)} in all)" if len(values) > _SHOWN else "")


class LabelError(SurfaceError):
    """A ``label`` has no voxel, or is meant twice."""

    def __init__(self, label: Label, what: str):
        super().__init__(what)
        self.label = label


def of_label(found: LabelMap, label: int | str) -> Any:
    """Return a mask of the voxels with a label, given by number or name.

    Raises:
        SurfaceError: if there are none, or no such name; the message names the labels that exist.
    """
    return _check_voxels(found, found.number(label), label)


def _check_voxels(found: LabelMap, number: int, label: Label) -> Any:
    mask = found.values == number
    if not mask.any():
        labels = [found.written(one) for one in found.labels]
        raise LabelError(
            label,
            f"no voxel has label {found.written(number)}; "
            + (f"labels are {_listed(labels)}" if labels else "all are 0: it is empty"),
        )
    return mask


def united(found: LabelMap, labels: Sequence[Label]) -> tuple[LabelMap, list[int]]:
    """Return the map in which each of ``labels``, numbers, names or several of them, is one number; and these numbers.

    Raises:
        SurfaceError: if a label has no voxels, or is meant twice.
    """
    taken: dict[int, Label] = {}
    numbers = []
    for label in labels:
        own = [found.number(one) for one in (label if isinstance(label, tuple) else (label,))]
        if not own:
            raise SurfaceError("label = [] is no label: give at least one")
        for number in own:
            if number in taken:
                both = " and ".join(f"label = {_in_study(one)}" for one in (taken[number], label))
                raise LabelError(
                    label,
                    f"{both} are the same label, {found.written(number)}: the body and its regions have labels of "
                    "their own",
                )
            taken[number] = label
            _check_voxels(found, number, label)
        numbers.append(own)
    if all(len(own) == 1 for own in numbers):
        return found, [own for (own,) in numbers]
    values = found.values.copy()
    for first, *others in numbers:
        values[np.isin(found.values, others)] = first
    return replace(found, values=values), [own[0] for own in numbers]


def cut_off(found: LabelMap, body: Sequence[int], hollow: Sequence[int]) -> LabelMap:
    """Return the map in which ``hollow`` labels that meet the outside end below the surface of the ``body``.

    What is cut off of them is tissue with the first of the body's labels: a cavity has a wall all round.
    """
    from scipy import ndimage  # noqa: PLC0415

    values, notices = found.values, list(found.notices)
    outside = np.isin(values, body, invert=True)
    for label in hollow:
        mask = values == label
        if not (ndimage.binary_dilation(mask) & outside).any() and not found.sides(
            ndimage.find_objects(mask.astype(np.int8))[0]
        ):
            continue
        near = ndimage.binary_dilation(np.pad(outside, 1, constant_values=True), iterations=_WALL)[1:-1, 1:-1, 1:-1]
        part = mask & near
        wall = f"{1e3 * _WALL * float(found.spacing.max()):.3g} mm"
        if part.sum() == mask.sum():
            raise SurfaceError(
                f"label {found.written(label)} is hollow, and nowhere {wall} below the surface of the body"
            )
        values = np.where(part, body[0], values)
        notices.append(f"label {found.written(label)} leaves the body: it ends {wall} below the surface, in tissue")
    return replace(found, values=values, notices=tuple(notices))


def _in_study(label: Label) -> str:
    return json.dumps(label, ensure_ascii=False)


# Voxels of a segment: where they are in the map, an array there, and its value for them.
Piece = tuple[Any, Any, int]


def painted(
    shape: tuple[int, ...], segments: Mapping[int, Sequence[Piece]], names: Mapping[int, str]
) -> tuple[Any, tuple[str, ...]]:
    """Return the values (``shape``) of a label map from the pieces of each label's segment, and notices.

    Where segments overlap, the smaller one has the voxel: a tumour within an organ is not lost.

    Raises:
        SurfaceError: if there is no segment.
    """
    if not segments:
        raise SurfaceError("contains no segments: it is empty")
    sizes = {label: sum(int((array == own).sum()) for _, array, own in pieces) for label, pieces in segments.items()}
    values = np.zeros(shape, np.min_scalar_type(max(255, *segments)))
    taken: Counter[tuple[int, int]] = Counter()
    for label in sorted(segments, key=lambda one: -sizes[one]):
        for index, array, own in segments[label]:
            mask = array == own
            part = values[index]
            below, counts = np.unique(part[mask], return_counts=True)
            taken.update({(int(b), label): int(c) for b, c in zip(below, counts, strict=True) if b})
            part[mask] = label
    notices = [
        f"segments {names.get(large, large)} and {names.get(small, small)} overlap in {count:,} voxels, which become "
        f"part of {names.get(small, small)}"
        for (large, small), count in sorted(taken.items())
    ]
    return values, tuple(notices)


def check_shape(shape: tuple[int, ...], size: int = 1) -> None:
    """Refuse a map that is not three-dimensional, or too large; a voxel's value has ``size`` bytes."""
    if len(shape) < 3 or any(k != 1 for k in shape[3:]):
        sizes = " × ".join(map(str, shape))
        raise SurfaceError(
            f"has {len(shape)} dimensions, {sizes}: allowed is one image of 3; export one segment or time"
        )
    if min(shape) < 1:
        raise SurfaceError(f"has {' × '.join(map(str, shape))} voxels: export it again")
    voxels = shape[0] * shape[1] * shape[2]
    if voxels > MOST_VOXELS:
        raise SurfaceError(f"has {' × '.join(map(str, shape))} voxels, more than {MOST_VOXELS:,}: crop or resample it")
    if voxels * size > LARGEST_IMAGE:
        raise SurfaceError(
            f"has {voxels * size / 1e9:.2g} GB of values, more than {LARGEST_IMAGE / 1e9:g}: export it with whole "
            "numbers of 8 or 16 bits, or crop it"
        )


def unit_of(named: str | None, given: float | None) -> float:
    """Return the unit of length (m) that a header has ``named``, or the one ``given`` in the study.

    Raises:
        SurfaceError: if there is none, or both differ.
    """
    if named is None and given is None:
        raise SurfaceError(
            'its header names no unit of length: give one, unit = "mm" of a body or length_unit = "mm" of a modulus in '
            "the study, or `--unit mm`"
        )
    if named is not None and given is not None and not np.isclose(UNITS[named], given):
        raise SurfaceError(f"its header says {named}, and the study another unit: leave that out")
    return UNITS[named] if named is not None else float(given or 0.0)


def whole(values: Any) -> Any:
    """Return labels after checking that they are integers, none of them negative."""
    if values.dtype.kind in "ub" or (values.dtype.kind == "i" and values.min() >= 0):
        return values
    if values.dtype.kind == "f" and np.isnan(values).any():  # of what is outside of the field of view
        values = np.where(np.isnan(values), 0, values)
    if values.dtype.kind == "i" or (values.dtype.kind == "f" and (values.min() < 0 or np.isinf(values).any())):
        raise SurfaceError(
            f"contains values from {values.min():g} to {values.max():g}: it is an image, such as a CT; export its "
            "segmentation as a label map"
        )
    if values.dtype.kind != "f":
        raise SurfaceError("contains colours, not labels: export the segmentation as a label map")
    if not (values == np.floor(values)).all():
        low, high = values.min(), values.max()
        raise SurfaceError(
            f"contains values between {low:g} and {high:g} that are not integers: it is an image, or a probability; "
            "export the segmentation as a label map"
        )
    return values
