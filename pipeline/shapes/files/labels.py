"""Label maps, NIfTI and NRRD: a number for each voxel, and where the voxels are."""

import bz2
import gzip
import zlib
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.shapes.triangles import SurfaceError

ENDINGS = (".nii", ".nii.gz", ".nrrd", ".nhdr")
_UNITS = {"m": 1.0, "meter": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "micron": 1e-6}
# Signs that take the axes of a NRRD file's space to right, anterior, superior.
_SPACES = {
    "right-anterior-superior": (1, 1, 1),
    "ras": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "las": (-1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "lps": (-1, -1, 1),
}
_MOST_VOXELS = 1_000_000_000
# Of the values, and of what a packed file may become: what is larger is no label map that fits into memory.
LARGEST_IMAGE = 4_000_000_000
_MOST_SKIPPED = 1000  # lines before the data of a NRRD file
_CHUNK, _LARGEST_VALUE = 1_000_000, 8  # bytes
_SINGULAR = 1e-9
_SHOWN = 20


@dataclass(frozen=True)
class LabelMap:
    """``values`` (nx, ny, nz), whole numbers, and the ``affine`` (3, 4) that takes indices of voxels to places.

    Places are in m, in the patient's frame: x to the right, y to the front (anterior), z to the head (superior).
    """

    values: Any
    affine: FloatArray
    notices: tuple[str, ...] = ()

    @property
    def spacing(self) -> FloatArray:
        """Sizes (3,) of a voxel (m)."""
        size: FloatArray = np.linalg.norm(self.affine[:, :3], axis=0)
        return size


def is_image(path: Path) -> bool:
    """Tell by its name whether a file is a label map."""
    return path.name.lower().endswith(ENDINGS)


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files that hold a label map: its own, and the one of the data where a NRRD header names another."""
    if not is_image(path) or path.name.lower().endswith(ENDINGS[:2]):
        return (path,)
    import nrrd  # noqa: PLC0415

    try:
        header = nrrd.read_header(str(path))
    except Exception:  # what is wrong with it is told as it is read
        return (path,)
    data = header.get("datafile", header.get("data file"))
    return (path,) if data is None else (path, path.parent / str(data))


def read_labels(path: Path, unit: float | None) -> LabelMap:
    """Return the label map in a file; ``unit`` (m) where the header does not say it.

    Raises:
        SurfaceError: if it is none, or does not say how large its voxels are.
    """
    if not is_image(path):
        raise SurfaceError(f"its name ends in `{path.suffix}`; label maps are read from {', '.join(ENDINGS)}")
    read = _nifti if path.name.lower().endswith(ENDINGS[:2]) else _nrrd
    try:
        found = read(path, unit)
    except (SurfaceError, MemoryError):
        raise
    except Exception as error:  # these libraries raise what their decoders do: zlib's, struct's, the system's
        text = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        kind = "NIfTI" if read is _nifti else "NRRD"
        raise SurfaceError(
            f"cannot be read as {kind} ({text}): truncated or of another kind? export it again"
        ) from error
    if abs(np.linalg.det(found.affine[:, :3] / found.spacing.max())) < _SINGULAR or not np.isfinite(found.affine).all():
        raise SurfaceError("its header gives voxels no volume: export it again with its spacing and directions")
    return found


def _nifti(path: Path, unit: float | None) -> LabelMap:
    import nibabel  # noqa: PLC0415 (a quarter of a second, which studies without images do without)

    image: Any = nibabel.load(path)
    _check_shape(image.shape, image.header.get_data_dtype().itemsize)
    named = image.header.get_xyzt_units()[0]
    size = _unit(named if named in _UNITS else None, unit)
    notices = []
    if not int(image.header["sform_code"]) and not int(image.header["qform_code"]):
        notices.append(
            "its header does not say where it lies: the frame is that of its voxels, its middle at the origin"
        )
    affine = np.asarray(image.affine, dtype=np.float64)[:3] * size
    return LabelMap(_whole(np.asanyarray(image.dataobj).reshape(image.shape[:3])), affine, tuple(notices))


def _nrrd(path: Path, unit: float | None) -> LabelMap:
    import nrrd  # noqa: PLC0415

    header = nrrd.read_header(str(path))
    shape = tuple(int(k) for k in header["sizes"])
    _check_shape(shape)
    skipped = max(0, int(header.get("byteskip", header.get("byte skip", 0))))
    _check_packed(path, header, min(LARGEST_IMAGE, prod(shape) * _LARGEST_VALUE + skipped))
    space = str(header.get("space", "")).lower()
    if space and space not in _SPACES:
        raise SurfaceError(f'its space is "{space}"; known are {", ".join(name for name in _SPACES if "-" in name)}')
    units = {str(name).strip('"') for name in header.get("space units", header.get("units", ()))}
    if len(units) > 1 or not units <= set(_UNITS):
        raise SurfaceError(
            f"its units are {', '.join(sorted(units))}; known are {', '.join(_UNITS)}, the same for all axes"
        )
    # The frames of patients are in mm, DICOM's and 3D Slicer's.
    size = _unit(next(iter(units), "mm" if space else None), unit)
    notices: tuple[str, ...] = ()
    if "space directions" in header:
        directions = np.array(header["space directions"], dtype=np.float64).T
    elif "spacings" in header:
        directions = np.diag(np.array(header["spacings"], dtype=np.float64))
    else:
        raise SurfaceError("its header has neither `space directions` nor `spacings`: how large are its voxels?")
    origin = np.array(header.get("space origin", (0.0, 0.0, 0.0)), dtype=np.float64)
    if not space:
        notices = ("its header does not say where it lies: the frame is that of its voxels",)
    affine = np.array(_SPACES.get(space, (1, 1, 1)))[:, None] * np.column_stack([directions, origin])
    values, _ = nrrd.read(str(path))
    return LabelMap(_whole(values), affine * size, notices)


def _check_packed(path: Path, header: Any, most: int) -> None:
    """Unpack the data of a NRRD file, keeping nothing: a few bytes may have been made to become any number of them.

    Raises:
        SurfaceError: if they become more than ``most``, or lines without end are to be skipped before them.
    """
    import nrrd  # noqa: PLC0415

    lines = int(header.get("lineskip", header.get("line skip", 0)))
    if lines > _MOST_SKIPPED:
        raise SurfaceError(f"its header skips {lines:,} lines before the data: export it again")
    packed: dict[str, Any] = dict.fromkeys(("gzip", "gz"), gzip.open) | dict.fromkeys(("bzip2", "bz2"), bz2.open)
    if (encoding := str(header.get("encoding"))) not in packed:
        return
    _, *data = files_of(path)
    with (data or [path])[0].open("rb") as file:
        if not data:
            nrrd.read_header(file)
        for _ in range(lines):
            file.readline()
        left = most
        # What is broken is told as it is read.
        with suppress(OSError, EOFError, zlib.error), packed[encoding](file) as unpacked:
            while left >= 0 and (made := len(unpacked.read(_CHUNK))):
                left -= made
        if left < 0:
            raise SurfaceError("its data become more than its header says: export it again")


def _check_shape(shape: tuple[int, ...], size: int = 1) -> None:
    """Refuse what is no map of three dimensions, or too large; a voxel's value has a ``size`` (bytes)."""
    if len(shape) < 3 or any(k != 1 for k in shape[3:]):
        sizes = " × ".join(map(str, shape))
        raise SurfaceError(
            f"has {len(shape)} dimensions, {sizes}: wanted is one label map of 3; export one segment or time"
        )
    if min(shape) < 1:
        raise SurfaceError(f"has {' × '.join(map(str, shape))} voxels: export it again")
    voxels = shape[0] * shape[1] * shape[2]
    if voxels > _MOST_VOXELS:
        raise SurfaceError(f"has {' × '.join(map(str, shape))} voxels, more than {_MOST_VOXELS:,}: crop or resample it")
    if voxels * size > LARGEST_IMAGE:
        raise SurfaceError(
            f"has {voxels * size / 1e9:.2g} GB of values, more than {LARGEST_IMAGE / 1e9:g}: export it with whole "
            "numbers of 8 or 16 bits, or crop it"
        )


def _unit(named: str | None, given: float | None) -> float:
    if named is None and given is None:
        raise SurfaceError('its header names no unit of length: write unit = "mm", say')
    if named is not None and given is not None and not np.isclose(_UNITS[named], given):
        raise SurfaceError(f"its header says {named}, and the study another unit: leave `unit` out")
    return _UNITS[named] if named is not None else float(given or 0.0)


def _whole(values: Any) -> Any:
    """Return labels, once they are known to be whole numbers."""
    if values.dtype.kind in "uib":
        return values
    if values.dtype.kind != "f":
        raise SurfaceError("holds colours, not labels: export the segmentation as a label map")
    if not (values == np.floor(values)).all():
        low, high = np.nanmin(values), np.nanmax(values)
        raise SurfaceError(
            f"holds values between {low:g} and {high:g} that are no whole numbers: it is an image, or a probability; "
            "export the segmentation as a label map"
        )
    return values


def of_label(found: LabelMap, label: int) -> Any:
    """Return which voxels have a label.

    Raises:
        SurfaceError: if none has; names the labels that there are.
    """
    mask = found.values == label
    if not mask.any():
        labels = [int(k) for k in np.unique(found.values) if k]
        there = ", ".join(map(str, labels[:_SHOWN])) + (", …" if len(labels) > _SHOWN else "")
        raise SurfaceError(
            f"no voxel has label {label}; " + (f"there are {there}" if labels else "all are 0: it is empty")
        )
    return mask
