"""A body segmented in a label map."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from epsmesh.arrays import FloatArray
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.files.loaded import UNITS, Label, LengthUnit, Loaded
from epsmesh.shapes.scanned import Scanned
from epsmesh.shapes.section import Words
from epsmesh.shapes.segmented import Segmented
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.units import Travel

_FEW = 32  # cached surfaces of regions
# Range of the smoothing length, in its units.
_NARROWEST, _WIDEST = 2 / 3, 4 / 3
_UNKNOWN_FRAME = (
    "its file names no frame: taken as that of the image, x to the right, y to the front, z to the head. Of a file in "
    "LPS, x and y are to be negated"
)


class FromImage(Segmented, Scanned):
    """The voxels of one label, in the patient's frame: x to the right, y to the front, z to the head."""

    READ_BY: ClassVar[frozenset[str]] = frozenset({"label", "names", "unit", "smooth", "region", "offset"})

    shape: Literal["image"]
    label: Annotated[
        Label,
        Field(exclude=True),
        Words(
            "Label of the body: the value of its voxels, or its name, as the image or `names` has it. A list is one "
            "body of several labels.",
            '"liver"',
        ),
    ]
    names: Annotated[
        str,
        Field(exclude=True),
        Words(
            "Names of the labels: a file (dataset.json of nnU-Net, label descriptions of ITK-SNAP, a colour table of "
            "3D Slicer or FreeSurfer), its path from the folder of the study; or totalsegmentator, "
            "totalsegmentator_mr for the labels of its tasks total and total_mr.",
            '"labels.txt"',
            "those in the image",
        ),
    ] = ""
    unit: Annotated[
        LengthUnit | None,
        Field(exclude=True),
        Words("Unit of length, if the image's header has none.", '"mm"', "the header's"),
    ] = None
    smooth: Annotated[
        Travel | None,
        Field(exclude=True),
        Words(
            "Smoothing length: standard deviation of the filter that removes the steps of the voxels. "
            "The volume does not change.",
            '"2 mm"',
            "one and a half voxels, or the slice distance if larger",
        ),
    ] = None
    file: Annotated[
        str,
        Words(
            "File of a label map (NIfTI, MGH, NRRD, DICOM), or folder of a DICOM series: its path from the folder "
            "of the study.",
            '"liver.nii.gz"',
        ),
    ]

    @classmethod
    def read(cls, file: str, given: Mapping[str, Any]) -> Loaded:
        """Return the surface of the label, together with the labels of its regions."""
        from epsmesh.shapes.files.image import read_image  # noqa: PLC0415 (only when a file is read)
        from epsmesh.shapes.files.label_map import LabelError  # noqa: PLC0415

        def surface(
            label: Label,
            smooth: float | None,
            inner: tuple[tuple[Label, float | None], ...] = (),
            offset: float = 0.0,
            hollow: tuple[Label, ...] = (),
            around: tuple[Label, ...] = (),
        ) -> Loaded:
            unit = UNITS[given["unit"]] if given["unit"] else None
            return read_image(Path(file), label, unit, smooth, given["names"], inner, offset, hollow, around)

        labelled = {piece.label: piece for piece in given["region"] if piece.label is not None}
        smooth = {n: given["smooth"] if piece.smooth is None else piece.smooth for n, piece in labelled.items()}
        try:
            hollow = tuple(label for label, piece in labelled.items() if piece.hollow)
            whole = surface(given["label"], given["smooth"], tuple(smooth.items()), given["offset"], hollow=hollow)
        except LabelError as error:
            if piece := labelled.get(error.label):
                raise SurfaceError(f"{piece.name}, label {error.label}: {error}") from error
            raise
        for number, (label, piece) in enumerate(labelled.items(), start=1):
            if whole.partition is not None:
                piece.load(_part_of(whole.partition, number), is_part=True)
                continue
            try:
                cut = ((label,), (given["label"], *labelled)) if piece.hollow else ((), ())
                piece.load(surface(label, smooth[label], (), 0.0, *cut))
            except SurfaceError as error:
                raise SurfaceError(f"{piece.name}, label {label}: {error}") from error
        return whole

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices about what was read, and about surfaces whose frame is not known to be that of the image."""
        from epsmesh.shapes.files.read import space_of  # noqa: PLC0415

        unknown = [piece.name for piece in self.region if piece.file and not space_of(Path(piece.file))]
        return *super().notices, *(f"{name}: {_UNKNOWN_FRAME}" for name in unknown)

    @property
    def _spacing(self) -> FloatArray:
        from epsmesh.shapes.files.image import spacing_of  # noqa: PLC0415

        path = Path(self.file)
        return np.array(spacing_of(path, UNITS[self.unit] if self.unit else None, path.stat().st_ctime_ns))

    @property
    def voxel(self) -> float | None:
        """Size of a voxel (m), the cube root of its volume."""
        return float(np.prod(self._spacing)) ** (1 / 3)

    @property
    def finest_step(self) -> float:
        """Smallest distance (m) of voxels."""
        return float(self._spacing.min())

    @property
    def smoothing_range(self) -> tuple[float, float] | None:
        """Two thirds and four thirds of the smoothing length: 1 and 2 voxels of the default; None without smoothing."""
        from epsmesh.shapes.files.label_surface import default_smooth  # noqa: PLC0415

        length = default_smooth(self._spacing) if self.smooth is None else self.smooth
        return (length * _NARROWEST, length * _WIDEST) if length else None


@lru_cache(_FEW)
def _part_of(partition: Complex, number: int) -> Loaded:
    return Loaded(partition.surface(number), ())
