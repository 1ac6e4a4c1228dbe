"""Label maps, NIfTI and NRRD: an integer for each voxel, and the positions of the voxels."""

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
# Signs that turn the axes of a NRRD space into right, anterior, superior.
_SPACES = {
    "right-anterior-superior": (1, 1, 1),
    "ras": (1, 1, 1),
    "left-anterior-superior": (-1, 1, 1),
    "las": (-1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "lps": (-1, -1, 1),
}
_MOST_VOXELS = 1_000_000_000
# Most bytes of values, also after unpacking: a larger label map does not fit into memory.
LARGEST_IMAGE = 4_000_000_000
_MOST_SKIPPED = 1000  # lines before the data of a NRRD file
_CHUNK, _LARGEST_VALUE = 1_000_000, 8  # bytes
_SINGULAR = 1e-9
_SHOWN = 20


@dataclass(frozen=True)
class LabelMap:
    """``values`` (nx, ny, nz), integers, and the ``affine`` (3, 4) from voxel indices to positions.

    Positions are in m, in the patient's frame: x to the right, y to the front (anterior), z to the head (superior).
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
    """Return whether a file is a label map, by its name."""
    return path.name.lower().endswith(ENDINGS)


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files of a label map: its own, and the data file if a NRRD header names one."""
    if not is_image(path) or path.name.lower().endswith(ENDINGS[:2]):
        return (path,)
    import nrrd  # noqa: PLC0415

    try:
        header = nrrd.read_header(str(path))
    except Exception:  # read_labels reports the error
        return (path,)
    data = header.get("datafile", header.get("data file"))
    return (path,) if data is None else (path, path.parent / str(data))


def read_labels(path: Path, unit: float | None) -> LabelMap:
    """Return the label map in a file; ``unit`` (m) applies if the header names none.

    Raises:
        SurfaceError: if it is no label map, or does not give the size of its voxels.
    """
    if not is_image(path):
        raise SurfaceError(f"its name ends in `{path.suffix}`; allowed label maps are {', '.join(ENDINGS)}")
    read = _nifti if path.name.lower().endswith(ENDINGS[:2]) else _nrrd
    try:
        found = read(path, unit)
    except (SurfaceError, MemoryError, ModuleNotFoundError):
        raise
    except Exception as error:  # these libraries pass on errors of their decoders: zlib, struct, the system
        text = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        kind = "NIfTI" if read is _nifti else "NRRD"
        raise SurfaceError(
            f"cannot be read as {kind} ({text}): it is truncated or of another kind; export it again"
        ) from error
    if abs(np.linalg.det(found.affine[:, :3] / found.spacing.max())) < _SINGULAR or not np.isfinite(found.affine).all():
        raise SurfaceError("its header gives voxels without volume: export it again with spacing and directions")
    return found


def _nifti(path: Path, unit: float | None) -> LabelMap:
    import nibabel  # noqa: PLC0415 (0.25 s to import; only for studies with images)

    image: Any = nibabel.load(path)
    _check_shape(image.shape, image.header.get_data_dtype().itemsize)
    named = image.header.get_xyzt_units()[0]
    size = _unit(named if named in _UNITS else None, unit)
    notices = []
    if not int(image.header["sform_code"]) and not int(image.header["qform_code"]):
        notices.append(
            "its header does not give a position: the frame is that of its voxels, with their centre as origin"
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
    # Frames of patients are in mm, in DICOM and in 3D Slicer.
    size = _unit(next(iter(units), "mm" if space else None), unit)
    notices: tuple[str, ...] = ()
    if "space directions" in header:
        directions = np.array(header["space directions"], dtype=np.float64).T
    elif "spacings" in header:
        directions = np.diag(np.array(header["spacings"], dtype=np.float64))
    else:
        raise SurfaceError("its header has neither `space directions` nor `spacings`, so the voxel size is unknown")
    origin = np.array(header.get("space origin", (0.0, 0.0, 0.0)), dtype=np.float64)
    if not space:
        notices = ("its header does not give a position: the frame is that of its voxels",)
    affine = np.array(_SPACES.get(space, (1, 1, 1)))[:, None] * np.column_stack([directions, origin])
    values, _ = nrrd.read(str(path))
    return LabelMap(_whole(values), affine * size, notices)


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
    _, *data = files_of(path)
    with (data or [path])[0].open("rb") as file:
        if not data:
            nrrd.read_header(file)
        for _ in range(lines):
            file.readline()
        left = most
        # read_labels reports broken data.
        with suppress(OSError, EOFError, zlib.error), packed[encoding](file) as unpacked:
            while left >= 0 and (made := len(unpacked.read(_CHUNK))):
                left -= made
        if left < 0:
            raise SurfaceError("has more data than its header says: export it again")


def _check_shape(shape: tuple[int, ...], size: int = 1) -> None:
    """Refuse a map that is not three-dimensional, or too large; a voxel's value has ``size`` bytes."""
    if len(shape) < 3 or any(k != 1 for k in shape[3:]):
        sizes = " × ".join(map(str, shape))
        raise SurfaceError(
            f"has {len(shape)} dimensions, {sizes}: allowed is one label map of 3; export one segment or time"
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
        raise SurfaceError('its header names no unit of length: add one to the study, such as unit = "mm"')
    if named is not None and given is not None and not np.isclose(_UNITS[named], given):
        raise SurfaceError(f"its header says {named}, and the study another unit: leave out `unit`")
    return _UNITS[named] if named is not None else float(given or 0.0)


def _whole(values: Any) -> Any:
    """Return labels after checking that they are integers."""
    if values.dtype.kind in "uib":
        return values
    if values.dtype.kind != "f":
        raise SurfaceError("contains colours, not labels: export the segmentation as a label map")
    if not (values == np.floor(values)).all():
        low, high = np.nanmin(values), np.nanmax(values)
        raise SurfaceError(
            f"contains values between {low:g} and {high:g} that are not integers: it is an image, or a probability; "
            "export the segmentation as a label map"
        )
    return values


def of_label(found: LabelMap, label: int) -> Any:
    """Return a mask of the voxels with a label.

    Raises:
        SurfaceError: if there are none; the message names the labels that exist.
    """
    mask = found.values == label
    if not mask.any():
        labels = [int(k) for k in np.unique(found.values) if k]
        there = ", ".join(map(str, labels[:_SHOWN])) + (", …" if len(labels) > _SHOWN else "")
        raise SurfaceError(
            f"no voxel has label {label}; " + (f"labels are {there}" if labels else "all are 0: it is empty")
        )
    return mask
