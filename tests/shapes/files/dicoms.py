"""DICOM files for tests: a label map of two labels, oblique and anisotropic, as a segmentation and as a series."""

from pathlib import Path
from typing import Any

import numpy as np
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.pixels import pack_bits
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

LPS = np.diag([-1.0, -1.0, 1.0])
NAMES = {1: "Liver", 3: "Tumour"}
SHAPE, SPACING = (30, 26, 22), (1.5, 1.2, 2.5)  # columns, rows, slices; mm
SEGMENTATION, LABEL_MAP, CT = (f"1.2.840.10008.5.1.4.1.1.{end}" for end in ("66.4", "66.7", "2"))


def affine() -> np.ndarray:
    """Return an oblique affine (4, 4), mm, RAS."""
    turn = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn)) * np.linalg.det(LPS)
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = turn * SPACING, (13.7, -40.1, 88.8)
    return affine


def values() -> np.ndarray:
    places = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), -1) * SPACING
    values = (((places - (22, 15, 27)) ** 2).sum(-1) < 12**2).astype(np.uint8)
    values[((places - (19, 14, 24)) ** 2).sum(-1) < 5**2] = 3
    return values


def file(kind: str) -> FileDataset:
    meta = FileMetaDataset()
    meta.TransferSyntaxUID, meta.MediaStorageSOPClassUID = ExplicitVRLittleEndian, kind
    meta.MediaStorageSOPInstanceUID = generate_uid()
    data = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = kind, meta.MediaStorageSOPInstanceUID
    data.Columns, data.Rows = SHAPE[:2]
    data.SamplesPerPixel, data.PixelRepresentation, data.PhotometricInterpretation = 1, 0, "MONOCHROME2"
    return data


def item(**values: Any) -> Dataset:
    found = Dataset()
    for name, value in values.items():
        setattr(found, name, value)
    return found


def origin(k: float) -> list[float]:
    return list(LPS @ (affine()[:3, 3] + k * affine()[:3, 2]))


def orientation() -> list[float]:
    return [float(f"{v:.14g}") for v in (LPS @ affine()[:3, :2] / np.array(SPACING[:2])).T.ravel()]


def segmentation(path: Path, frames: list[tuple[int, int, np.ndarray]], kind: str = "BINARY", **changes: Any) -> Path:
    """Write frames of (segment, number of the slice, pixels (columns, rows))."""
    data = file(LABEL_MAP if kind == "LABELMAP" else SEGMENTATION)
    data.SegmentationType, data.NumberOfFrames = kind, len(frames)
    data.SegmentSequence = [item(SegmentNumber=n, SegmentLabel=name) for n, name in NAMES.items()]
    measures = item(PixelSpacing=[SPACING[1], SPACING[0]], SpacingBetweenSlices=SPACING[2], SliceThickness=1.0)
    turned = item(ImageOrientationPatient=orientation())
    shared = item(PixelMeasuresSequence=[measures], PlaneOrientationSequence=[turned])
    data.SharedFunctionalGroupsSequence = [shared]
    data.PerFrameFunctionalGroupsSequence = [
        item(
            PlanePositionSequence=[item(ImagePositionPatient=origin(k))],
            SegmentIdentificationSequence=[item(ReferencedSegmentNumber=segment)],
        )
        for segment, k, _ in frames
    ]
    bits = 1 if kind == "BINARY" else 8
    data.BitsAllocated, data.BitsStored, data.HighBit = bits, bits, bits - 1
    pixels = np.stack([frame.T for _, _, frame in frames]).astype(np.uint8)
    data.PixelData = pack_bits(pixels) if bits == 1 else pixels.tobytes()
    for name, value in changes.items():
        setattr(data, name, value)
    data.save_as(path, enforce_file_format=True)
    return path


def frames(values: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Return the frames of each segment, without empty ones, in any order."""
    found = [(n, k, values[:, :, k] == n) for n in NAMES for k in range(SHAPE[2])]
    return [found[i] for i in np.random.default_rng(1).permutation(len(found)) if found[i][2].any()]


def series(folder: Path, values: np.ndarray, slices: list[float], **changes: Any) -> Path:
    folder.mkdir()
    for k, place in enumerate(slices):
        data = file(CT)
        data.SeriesInstanceUID = "1.2.3"
        data.ImagePositionPatient, data.ImageOrientationPatient = origin(place), orientation()
        data.PixelSpacing, data.SliceThickness = [SPACING[1], SPACING[0]], 1.0
        data.BitsAllocated, data.BitsStored, data.HighBit = 16, 16, 15
        data.RescaleSlope, data.RescaleIntercept = 1, -1024
        data.PixelData = (values[:, :, k].T.astype(np.uint16) + 1024).tobytes()
        for name, value in changes.items():
            setattr(data, name, value)
        data.save_as(folder / f"IM{7 * k % 97:04d}", enforce_file_format=True)
    return folder
