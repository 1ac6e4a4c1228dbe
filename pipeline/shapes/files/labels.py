"""Reader of label maps, NIfTI, NRRD and DICOM: an integer for each voxel, positions, and names."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.class_maps import CLASS_MAPS
from pipeline.shapes.files.dicom_labels import read_dicom, series_files
from pipeline.shapes.files.label_map import LARGEST_IMAGE, UNITS, LabelMap, check_shape, of_label, unit_of, whole
from pipeline.shapes.files.label_names import names_of_extensions, read_names
from pipeline.shapes.files.nrrd_labels import data_file, read_nrrd
from pipeline.shapes.triangles import SurfaceError

__all__ = ["ENDINGS", "LARGEST_IMAGE", "LabelMap", "files_of", "is_image", "of_label", "read_labels"]

_NIFTI, _NRRD, _DICOM = (".nii", ".nii.gz"), (".nrrd", ".nhdr"), (".dcm",)
ENDINGS = (*_NIFTI, *_NRRD, *_DICOM)
_SINGULAR = 1e-9


def is_image(path: Path) -> bool:
    """Return whether a file is a label map, by its name; a folder is that of a DICOM series."""
    return path.name.lower().endswith(ENDINGS) or path.is_dir()


def files_of(path: Path, names: str = "") -> tuple[Path, ...]:
    """Return the files of a label map: its own, the data file if a NRRD header names one, and that of ``names``.

    Raises:
        SurfaceError: if it is a folder that is not of a DICOM series.
    """
    data = data_file(path) if path.name.lower().endswith(_NRRD) else None
    own = series_files(path) if path.is_dir() else (path,)
    others = [] if not names or names in CLASS_MAPS else [Path(names)]
    return (*own, *([] if data is None else [data]), *others)


def read_labels(path: Path, unit: float | None, names: str = "") -> LabelMap:
    """Return the label map in a file; ``unit`` (m) applies if the header names none.

    ``names`` is a file of names, or a word for those of TotalSegmentator, in place of those in the header.

    Raises:
        SurfaceError: if it is no label map, or does not give the size of its voxels.
    """
    if not is_image(path):
        raise SurfaceError(f"its name ends in `{path.suffix}`; allowed label maps are {', '.join(ENDINGS)}")
    kind, read = _reader(path)
    try:
        found = read(path, unit)
    except (SurfaceError, MemoryError, ModuleNotFoundError):
        raise
    except Exception as error:  # these libraries pass on errors of their decoders: zlib, struct, the system
        text = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise SurfaceError(
            f"cannot be read as {kind} ({text}): it is truncated or of another kind; export it again"
        ) from error
    if abs(np.linalg.det(found.affine[:, :3] / found.spacing.max())) < _SINGULAR or not np.isfinite(found.affine).all():
        raise SurfaceError("its header gives voxels without volume: export it again with spacing and directions")
    return replace(found, names=read_names(names)) if names else found


def _reader(path: Path) -> tuple[str, Callable[[Path, float | None], LabelMap]]:
    name = path.name.lower()
    if path.is_dir() or name.endswith(_DICOM):
        return "DICOM", read_dicom
    return ("NIfTI", _nifti) if name.endswith(_NIFTI) else ("NRRD", read_nrrd)


def _nifti(path: Path, unit: float | None) -> LabelMap:
    import nibabel  # noqa: PLC0415 (0.25 s to import; only for studies with images)

    image: Any = nibabel.load(path)
    check_shape(image.shape, image.header.get_data_dtype().itemsize)
    named = image.header.get_xyzt_units()[0]
    size = unit_of(named if named in UNITS else None, unit)
    notices = []
    if not int(image.header["sform_code"]) and not int(image.header["qform_code"]):
        notices.append(
            "its header does not give a position: the frame is that of its voxels, with their centre as origin"
        )
    affine = np.asarray(image.affine, dtype=np.float64)[:3] * size
    names = names_of_extensions(extension.get_content() for extension in image.header.extensions)
    return LabelMap(whole(np.asanyarray(image.dataobj).reshape(image.shape[:3])), affine, tuple(notices), names)
