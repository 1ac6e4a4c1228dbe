"""Label maps in DICOM: segmentation objects (DICOM PS3.3, A.51), and series whose pixels are labels.

Positions of voxels follow PS3.3, C.7.6.2.1.1: a pixel's column and row along the two vectors of Image Orientation
(Patient), from Image Position (Patient) of its slice. DICOM's frame is LPS; results are in RAS, as all label maps.
"""

import warnings
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.label_map import LabelMap, Piece, check_shape, painted, unit_of, whole
from epsmesh.shapes.files.label_names import clean
from epsmesh.shapes.triangles import SurfaceError

_RAS = np.diag([-1.0, -1.0, 1.0])
_MM = 1e-3
_MOST_FILES = 5000  # of a folder
# Of the distance of slices: how far one may be off its place. Directions of slices and of rows may differ by as much.
_OFF = 0.02
_TURNED = 1e-4
_DEFLATED = "1.2.840.10008.1.2.1.99"
_SERIES = "put the slices of its series, and nothing else, into a folder of their own, and give the folder"


def series_files(folder: Path) -> tuple[Path, ...]:
    """Return the files in a folder, which should be the slices of one series.

    Raises:
        SurfaceError: if there are none, or more than a series has.
    """
    files = tuple(sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith((".", "DICOMDIR"))))
    if not files:
        raise SurfaceError("is a folder without files: allowed is the folder of a DICOM series")
    if len(files) > _MOST_FILES:
        raise SurfaceError(f"is a folder of {len(files):,} files, more than {_MOST_FILES:,}: {_SERIES}")
    return files


def read_dicom(path: Path, unit: float | None) -> LabelMap:
    """Return the label map in a DICOM file, or in the slices of a series in a folder; lengths are in mm by definition.

    Raises:
        SurfaceError: if it does not give a label to each voxel of a regular grid.
    """
    unit_of("mm", unit)
    with warnings.catch_warnings(action="ignore"):  # pydicom's, on values that do not matter here
        return _of_series([_read(file) for file in series_files(path)]) if path.is_dir() else _of_file(_read(path))


def _of_file(data: Any) -> LabelMap:
    if "SegmentSequence" in data:
        return _of_segments(data)
    if int(data.get("NumberOfFrames", 1)) == 1 and "PerFrameFunctionalGroupsSequence" not in data:
        raise SurfaceError(f"is one slice of a DICOM series: {_SERIES}")
    return _of_series([data])


def _read(path: Path) -> Any:
    import pydicom  # noqa: PLC0415 (0.2 s to import; only for studies with DICOM)

    data = pydicom.dcmread(path, defer_size="1 MB")
    if str(data.file_meta.get("TransferSyntaxUID", "")) == _DEFLATED:
        raise SurfaceError("is a deflated DICOM file: export it without compression")
    if "Rows" not in data or "PixelData" not in data:
        raise SurfaceError(f"has no pixels ({data.get('Modality', 'DICOM')}): allowed are segmentations and series")
    check_shape((int(data.Columns), int(data.Rows), int(data.get("NumberOfFrames", None) or 1)))
    if int(data.get("SamplesPerPixel", 1)) != 1:
        raise SurfaceError("contains colours, not labels: export the segmentation as a label map")
    return data


# ---- segmentation objects -----------------------------------------------------------------------------


def _of_segments(data: Any) -> LabelMap:
    frames = _frames(data)
    grid, notices = _grid([_Slice.of_frame(data, k) for k in range(len(frames))], may_miss=True)
    if grid.shape[2] < _source_slices(data):
        grid = grid.padded()
        notices += (
            "slices without a segment are not in the file: it is not known whether the image ends at a segment",
        )
    names = {int(one.SegmentNumber): _name(one) for one in data.SegmentSequence}
    kind = str(data.get("SegmentationType", ""))
    if kind == "LABELMAP":
        padding = data.get("PixelPaddingValue", 0)
        values = _stacked(np.where(frames == padding, 0, frames) if padding else frames, grid)
        return _with_room(LabelMap(values, grid.affine, notices, _without_background(names)))
    if kind == "FRACTIONAL":
        frames = 2.0 * frames >= float(data.MaximumFractionalValue)
        notices += ("a voxel is part of a segment from half of the largest fraction on",)
    elif kind != "BINARY":
        raise SurfaceError(f"is a segmentation of kind {kind!r}; allowed are BINARY, FRACTIONAL and LABELMAP")
    pieces: dict[int, list[Piece]] = {}
    for k, frame in enumerate(frames):
        groups = _group(data, k, "SegmentIdentificationSequence")
        index = (slice(None), slice(None), int(grid.places[k]))
        pieces.setdefault(int(groups.ReferencedSegmentNumber), []).append((index, frame.T, 1))
    values, overlaps = painted(grid.shape, pieces, names)
    return _with_room(LabelMap(values, grid.affine, notices + overlaps, names))


def _with_room(found: LabelMap) -> LabelMap:
    """Return a segmentation with an empty voxel more on each side if its slices were cropped to its segments."""
    values = found.values
    if not all(side.any() for side in (values[0], values[-1], values[:, 0], values[:, -1])):
        return found
    affine = found.affine.copy()
    affine[:, 3] -= affine[:, 0] + affine[:, 1]
    notice = "its slices are as large as its segments: it is not known whether the image ends at them"
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)))
    return LabelMap(padded, affine, (*found.notices, notice), found.names)


def _source_slices(data: Any) -> float:
    """Return the number of slices of the image that was segmented, infinite if the file does not name them."""
    series = data.get("ReferencedSeriesSequence", [])
    return sum(len(one.get("ReferencedInstanceSequence", [])) for one in series) or inf


def _name(segment: Any) -> str:
    if label := segment.get("SegmentLabel"):
        return clean(label)
    kinds = segment.get("SegmentedPropertyTypeCodeSequence")
    return clean(kinds[0].get("CodeMeaning", "")) if kinds else ""


def _without_background(names: dict[int, str]) -> dict[int, str]:
    return {number: name for number, name in names.items() if number}


# ---- series -------------------------------------------------------------------------------------------


def _of_series(slices: list[Any]) -> LabelMap:
    """Return the label map of the slices of a series, a file each, or of the frames of one file."""
    series = sorted({str(data.get("SeriesInstanceUID", "")) for data in slices})
    if len(series) > 1:
        raise SurfaceError(f"has slices of {len(series)} DICOM series: {_SERIES}")
    if len({(int(data.Rows), int(data.Columns)) for data in slices}) > 1:
        raise SurfaceError(f"has slices of several sizes: {_SERIES}")
    check_shape((int(slices[0].Columns), int(slices[0].Rows), len(slices)))
    every = [(data, k) for data in slices for k in range(int(data.get("NumberOfFrames", None) or 1))]
    grid, notices = _grid([_Slice.of_frame(data, k) for data, k in every], may_miss=False)
    values = np.concatenate([_rescaled(data, _frames(data)) for data in slices])
    return LabelMap(whole(_stacked(values, grid)), grid.affine, notices)


def _rescaled(data: Any, frames: Any) -> Any:
    """Return the values of pixels: CT stores them with a slope and an intercept."""
    slope, intercept = (
        float(data.get(key, default)) for key, default in (("RescaleSlope", 1), ("RescaleIntercept", 0))
    )
    if (slope, intercept) == (1.0, 0.0):
        return frames
    values = slope * frames + intercept
    return values.astype(np.int32) if (values == np.floor(values)).all() else values


# ---- geometry -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Slice:
    """A plane of pixels: ``origin`` (3,), ``across`` (3, 2), from pixel to pixel along columns and rows; mm, in LPS."""

    origin: FloatArray
    across: FloatArray
    distance: float | None
    size: tuple[int, int]

    @classmethod
    def of_frame(cls, data: Any, k: int) -> "_Slice":
        measures = _group(data, k, "PixelMeasuresSequence")
        turned = _group(data, k, "PlaneOrientationSequence").get("ImageOrientationPatient")
        origin = _group(data, k, "PlanePositionSequence").get("ImagePositionPatient")
        spacing = measures.get("PixelSpacing")
        if turned is None or origin is None or spacing is None:
            raise SurfaceError(
                "does not give the position of its slices in the patient (ImagePositionPatient, "
                "ImageOrientationPatient, PixelSpacing): a projection or a slide is no label map"
            )
        axes = np.array(turned, dtype=np.float64).reshape(2, 3)
        if abs(axes @ axes.T - np.eye(2)).max() > _TURNED:
            raise SurfaceError("its ImageOrientationPatient are no two unit vectors normal to each other")
        rows, columns = map(float, spacing)  # the distance of rows comes first
        distance = measures.get("SpacingBetweenSlices") or None
        thickness = measures.get("SliceThickness") or None
        return cls(
            np.array(origin, dtype=np.float64),
            axes.T * np.array([columns, rows]),
            abs(float(distance or thickness or 0.0)) or None,
            (int(data.Columns), int(data.Rows)),
        )


@dataclass(frozen=True)
class _Grid:
    """``affine`` (3, 4), in m and RAS, ``shape``, and the number of each frame's slice."""

    affine: FloatArray
    shape: tuple[int, int, int]
    places: IntArray

    def padded(self) -> "_Grid":
        """Return the grid with an empty slice more at both ends."""
        affine = self.affine.copy()
        affine[:, 3] -= affine[:, 2]
        return _Grid(affine, (*self.shape[:2], self.shape[2] + 2), self.places + 1)


def _group(data: Any, k: int, name: str) -> Any:
    """Return attributes of frame k: of its functional group, of the shared one, or of the file."""
    for groups in (
        data.get("PerFrameFunctionalGroupsSequence", [])[k : k + 1],
        data.get("SharedFunctionalGroupsSequence"),
    ):
        found = groups[0].get(name) if groups else None
        if found:
            return found[0]
    return data


def _grid(slices: list[_Slice], *, may_miss: bool) -> tuple[_Grid, tuple[str, ...]]:
    """Return the regular grid that slices are of, and notices; those that miss are empty, if they ``may_miss``.

    Raises:
        SurfaceError: if the slices are not parallel, or not equally spaced.
    """
    first = slices[0]
    if any(abs(one.across - first.across).max() > _TURNED * abs(first.across).max() for one in slices):
        raise SurfaceError("has slices of several directions or pixel sizes: export one volume")
    normal = np.cross(first.across[:, 0], first.across[:, 1])
    normal /= np.linalg.norm(normal)
    origins = np.array([one.origin for one in slices])
    heights = origins @ normal
    order = np.argsort(heights)
    low, high = origins[order[0]], origins[order[-1]]
    gaps = np.diff(heights[order])
    distinct = gaps[gaps > _OFF * float(np.linalg.norm(first.across, axis=0).min())]
    if len(distinct):
        # A segmentation leaves out slices without a segment: the smallest distance is that of neighbours.
        step = float(distinct.min())
        if (
            may_miss
            and first.distance
            and abs(distinct / first.distance - np.round(distinct / first.distance)).max() < _OFF
        ):
            step = first.distance
        along = (high - low) / (high - low).dot(normal)  # not the normal's, where the gantry was tilted
    elif first.distance:
        step, along = first.distance, normal
    else:
        raise SurfaceError("has one slice without a thickness: export a volume")
    places = np.round((heights - heights.min()) / step).astype(int)
    off = np.linalg.norm(origins - low - (places * step)[:, None] * along, axis=1)
    if off.max() > _OFF * step * max(1, places.max()) ** 0.5:
        said = ", ".join(f"{gap:.4g}" for gap in sorted(set(distinct.round(4)))[:5])
        raise SurfaceError(
            f"its slices are not equally spaced (distances {said} mm): resample it, or export all slices"
        )
    if not may_miss and len(set(places)) < len(places):
        raise SurfaceError(f"has several slices at one position: {_SERIES}")
    missing = sorted(set(range(int(places.max()) + 1)) - set(places.tolist()))
    if missing and not may_miss:
        where = heights.min() + step * missing[0]
        raise SurfaceError(
            f"{len(missing)} of its slices are missing, the first at {where:.4g} mm along its normal: copy them, too"
        )
    # The grid's distance, more accurately than the header's.
    step = float((heights.max() - heights.min()) / places.max()) if places.max() else step
    affine = _RAS @ np.column_stack([first.across, step * along, low]) * _MM
    notices = (f"{len(missing)} slices between others have no segment: they are empty",) if missing else ()
    shape = (*first.size, int(places.max()) + 1)
    check_shape(shape)
    return _Grid(affine, shape, places), notices


def _frames(data: Any) -> Any:
    """Return the pixels (frames, rows, columns)."""
    return data.pixel_array.reshape(-1, int(data.Rows), int(data.Columns))


def _stacked(frames: Any, grid: _Grid) -> Any:
    values = np.zeros(grid.shape, frames.dtype)
    values[:, :, grid.places] = frames.transpose(2, 1, 0)
    return values
