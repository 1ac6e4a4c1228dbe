"""Label maps in NRRD files, also segmentations of 3D Slicer with their names and layers."""

import bz2
import gzip
import zlib
from collections.abc import Callable
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.label_map import LARGEST_IMAGE, UNITS, LabelMap, check_shape, painted, unit_of, whole
from epsmesh.shapes.files.label_names import segments_of_header
from epsmesh.shapes.triangles import SurfaceError

# Signs that turn the axes of a NRRD space into right, anterior, superior.
_SPACES = {
    "right-anterior-superior": (1, 1, 1),
    "ras": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "las": (-1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "lps": (-1, -1, 1),
}
_MOST_SKIPPED = 1000  # lines before the data of a NRRD file
_CHUNK, _LARGEST_VALUE = 1_000_000, 8  # bytes


def data_file(path: Path) -> Path | None:
    """Return the data file that a NRRD header names, if there is one."""
    import nrrd  # noqa: PLC0415

    try:
        header = nrrd.read_header(str(path))
    except Exception:  # read_nrrd reports the error
        return None
    data = header.get("datafile", header.get("data file"))
    return None if data is None else path.parent / str(data)


def read_nrrd(path: Path, unit: float | None, values_of: Callable[[Any], Any] = whole) -> LabelMap:
    """Return the label map in a NRRD file; ``unit`` (m) applies if the header names none.

    ``values_of`` checks the values: by default, that they are labels.
    Layers of 3D Slicer, an axis before the three of space, become one map: segments then have the labels 1, 2, ….
    """
    import nrrd  # noqa: PLC0415

    header = nrrd.read_header(str(path))
    sizes = tuple(int(k) for k in header["sizes"])
    segments = segments_of_header(header)
    is_layered = len(sizes) == 4 and bool(segments)
    shape = sizes[1:] if is_layered else sizes
    check_shape(shape, sizes[0] if is_layered else 1)
    skipped = max(0, int(header.get("byteskip", header.get("byte skip", 0))))
    _check_packed(path, header, min(LARGEST_IMAGE, prod(sizes) * _LARGEST_VALUE + skipped))
    affine, notices = _affine(header, unit)
    values, _ = nrrd.read(str(path))
    if not is_layered:
        return LabelMap(values_of(values), affine, notices, {label: name for _, label, name in segments})
    if any(layer >= sizes[0] for layer, _, _ in segments):
        raise SurfaceError(f"its segments name more layers than the {sizes[0]} that it has: export it again")
    names = {number: name for number, (_, _, name) in enumerate(segments, start=1)}
    pieces = {n: [(..., values[layer], label)] for n, (layer, label, _) in enumerate(segments, start=1)}
    one, overlaps = painted(shape, pieces, names)
    return LabelMap(one, affine, (*notices, *overlaps), names)


def _affine(header: Any, unit: float | None) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the affine (3, 4), in m, that a header gives, and notices."""
    space = str(header.get("space", "")).lower()
    if space and space not in _SPACES:
        raise SurfaceError(f'its space is "{space}"; known are {", ".join(name for name in _SPACES if "-" in name)}')
    units = {str(name).strip('"') for name in header.get("space units", header.get("units", ()))}
    if len(units) > 1 or not units <= set(UNITS):
        raise SurfaceError(
            f"its units are {', '.join(sorted(units))}; known are {', '.join(UNITS)}, the same for all axes"
        )
    # Frames of patients are in mm, in DICOM and in 3D Slicer.
    size = unit_of(next(iter(units), "mm" if space else None), unit)
    if "space directions" in header:
        # The rows of axes that are not of space, such as layers, are empty.
        rows = [row for row in header["space directions"] if row is not None and np.isfinite(row).all()]
        directions = np.array(rows, dtype=np.float64).T
    elif "spacings" in header:
        directions = np.diag(np.array(header["spacings"], dtype=np.float64)[-3:])
    else:
        raise SurfaceError("its header has neither `space directions` nor `spacings`, so the voxel size is unknown")
    origin = np.array(header.get("space origin", (0.0, 0.0, 0.0)), dtype=np.float64)
    notices = () if space else ("its header does not give a position: the frame is that of its voxels",)
    return np.array(_SPACES.get(space, (1, 1, 1)))[:, None] * np.column_stack([directions, origin]) * size, notices


def _check_packed(path: Path, header: Any, most: int) -> None:
    """Check the unpacked size of a NRRD file without storing it: a few bytes may unpack to any number.

    Raises:
        SurfaceError: if it exceeds ``most``, or too many lines precede the data.
    """
    import nrrd  # noqa: PLC0415

    lines = int(header.get("lineskip", header.get("line skip", 0)))
    if lines > _MOST_SKIPPED:
        raise SurfaceError(f"its header skips {lines:,} lines before the data: export it again")
    packed: dict[str, Any] = dict.fromkeys(("gzip", "gz"), gzip.open) | dict.fromkeys(("bzip2", "bz2"), bz2.open)
    if (encoding := str(header.get("encoding"))) not in packed:
        return
    data = data_file(path)
    with (data or path).open("rb") as file:
        if data is None:
            nrrd.read_header(file)
        for _ in range(lines):
            file.readline()
        left = most
        # nrrd.read reports broken data.
        with suppress(OSError, EOFError, zlib.error), packed[encoding](file) as unpacked:
            while left >= 0 and (made := len(unpacked.read(_CHUNK))):
                left -= made
        if left < 0:
            raise SurfaceError("has more data than its header says: export it again")
