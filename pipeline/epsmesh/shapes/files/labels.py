"""Reader of label maps, NIfTI, NRRD and DICOM: an integer for each voxel, positions, and names; and of other values."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.class_maps import CLASS_MAPS
from epsmesh.shapes.files.dicom_labels import read_dicom, series_files
from epsmesh.shapes.files.foreign import why_not_read
from epsmesh.shapes.files.label_map import LARGEST_IMAGE, UNITS, LabelMap, check_shape, of_label, unit_of, whole
from epsmesh.shapes.files.label_names import names_of_extensions, read_names
from epsmesh.shapes.files.nrrd_labels import data_file, read_nrrd
from epsmesh.shapes.triangles import SurfaceError

__all__ = ["ENDINGS", "LARGEST_IMAGE", "LabelMap", "files_of", "is_image", "of_label", "read_labels", "read_values"]

_NIFTI = (".nii", ".nii.gz", ".mgz", ".mgh", ".hdr", ".img")  # and what nibabel reads beside it
_NRRD, _DICOM = (".nrrd", ".nhdr"), (".dcm",)
ENDINGS = (*_NIFTI, *_NRRD, *_DICOM)
_SINGULAR = 1e-9
# Positions of corners that are the same, in units of a voxel.
_SAME_PLACE = 0.1


def is_image(path: Path) -> bool:
    """Return whether a file is a label map, by its name; a folder is that of a DICOM series."""
    return path.name.lower().endswith(ENDINGS) or path.is_dir()


def files_of(path: Path, names: str = "") -> tuple[Path, ...]:
    """Return the files of a label map: its own, the data file if a NRRD header names one, and that of ``names``.

    Raises:
        SurfaceError: if it is a folder that is not of a DICOM series.
    """
    data = data_file(path) if path.name.lower().endswith(_NRRD) else _other_half(path)
    own = series_files(path) if path.is_dir() else (path,)
    others = [] if not names or names in CLASS_MAPS else [Path(names)]
    return (*own, *([] if data is None else [data]), *others)


def _other_half(path: Path) -> Path | None:
    """Return the data of a header .hdr, or the header of data .img; None of any other file."""
    other = {".hdr": ".img", ".img": ".hdr"}.get(path.suffix)
    found = path.with_suffix(other) if other else path
    return found if other and found.exists() else None


def read_labels(path: Path, unit: float | None, names: str = "") -> LabelMap:
    """Return the label map in a file; ``unit`` (m) applies if the header names none.

    ``names`` is a file of names, or a word for those of TotalSegmentator, in place of those in the header.

    Raises:
        SurfaceError: if it is no label map, or does not give the size of its voxels.
    """
    if not is_image(path):
        why = why_not_read(path) or f"its name ends in `{path.suffix}`"
        raise SurfaceError(f"{why}; allowed label maps are {', '.join(ENDINGS)}")
    found = _read(path, *_reader(path), unit)
    return replace(found, names=read_names(names)) if names else found


def read_values(path: Path, unit: float | None) -> LabelMap:
    """Return the values of voxels in a file, as floats; ``unit`` (m) applies if the header names none.

    Raises:
        SurfaceError: if it is no image of numbers, or does not give the size of its voxels.
    """
    if not path.name.lower().endswith((*_NIFTI, *_NRRD)):
        raise SurfaceError(f"its name ends in `{path.suffix}`: allowed are {', '.join((*_NIFTI, *_NRRD))}")
    kind, read = ("NIfTI", _nifti) if path.name.lower().endswith(_NIFTI) else ("NRRD", read_nrrd)
    return _read(path, kind, partial(read, values_of=_numbers), unit)


def _numbers(values: Any) -> Any:
    if values.dtype.kind not in "uif":
        raise SurfaceError("contains colours or complex numbers, not one number for each voxel")
    return values.astype(np.float64)


def _read(path: Path, kind: str, read: Callable[[Path, float | None], LabelMap], unit: float | None) -> LabelMap:
    try:
        found = read(path, unit)
    except (SurfaceError, MemoryError, ModuleNotFoundError):
        raise
    except Exception as error:  # these libraries pass on errors of their decoders: zlib, struct, the system
        text = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise SurfaceError(
            f"cannot be read as {kind} ({text}): it is truncated or of another kind; export it again"
        ) from error
    if not _has_volume(found.affine):
        raise SurfaceError("its header gives voxels without volume: export it again with spacing and directions")
    return found


def _reader(path: Path) -> tuple[str, Callable[[Path, float | None], LabelMap]]:
    name = path.name.lower()
    if path.is_dir() or name.endswith(_DICOM):
        return "DICOM", read_dicom
    return ("NIfTI", _nifti) if name.endswith(_NIFTI) else ("NRRD", read_nrrd)


def _nifti(path: Path, unit: float | None, values_of: Callable[[Any], Any] = whole) -> LabelMap:
    import nibabel  # noqa: PLC0415 (0.25 s to import; only for studies with images)

    image: Any = nibabel.load(path)
    check_shape(image.shape, image.header.get_data_dtype().itemsize)
    if isinstance(image, nibabel.AnalyzeImage) and not isinstance(image, nibabel.Nifti1Pair):
        raise SurfaceError(
            "its header is that of Analyze 7.5, which does not say which side is left: save it as .nii.gz, and check "
            "the side"
        )
    is_mgh = isinstance(image, nibabel.MGHImage)  # of FreeSurfer: in mm, with one affine
    named = "mm" if is_mgh else image.header.get_xyzt_units()[0]
    size = unit_of(named if named in UNITS else None, unit)
    position, notices = _position(image)
    affine = position[:3] * size
    extensions = getattr(image.header, "extensions", ())
    names = names_of_extensions(extension.get_content() for extension in extensions)
    return LabelMap(values_of(np.asanyarray(image.dataobj).reshape(image.shape[:3])), affine, notices, names)


def _position(image: Any) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the affine (4, 4) from voxels to positions, in the header's unit, and notices.

    The sform comes before the qform, unless its voxels have no volume.
    """
    affine: FloatArray = np.asarray(image.affine, dtype=np.float64)
    if not hasattr(image, "get_qform"):  # of FreeSurfer
        return affine, ()
    forms = [image.get_sform(coded=True), image.get_qform(coded=True)]
    if not any(code for _, code in forms):
        return affine, (
            "its header does not give a position: the frame is that of its voxels, with their centre as origin",
        )
    (sform, is_sform), (qform, is_qform) = forms
    if not (is_sform and is_qform):
        return affine, ()
    if not _has_volume(sform):
        return np.asarray(qform, dtype=np.float64), ("its sform gives voxels without volume: its qform is used",)
    corners = np.array(list(product(*((0, size - 1) for size in image.shape[:3]))), dtype=np.float64)
    apart = np.linalg.norm(corners @ (sform - qform)[:3, :3].T + (sform - qform)[:3, 3], axis=1).max()
    voxel = np.linalg.norm(sform[:3, :3], axis=0).min()
    if not apart > _SAME_PLACE * voxel:
        return affine, ()
    unit = image.header.get_xyzt_units()[0]
    return affine, (
        f"its sform and its qform differ by up to {apart:.3g} {unit if unit in UNITS else 'units'}: its sform is used",
    )


def _has_volume(affine: FloatArray) -> bool:
    """Return whether an affine gives voxels of a volume."""
    sides = np.linalg.norm(affine[:3, :3], axis=0)
    if not np.isfinite(affine).all() or sides.max() == 0:
        return False
    return bool(abs(np.linalg.det(affine[:3, :3] / sides.max())) > _SINGULAR)
