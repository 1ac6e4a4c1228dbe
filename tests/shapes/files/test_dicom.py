"""DICOM segmentation objects and series: the same labels and places as in NIfTI, and what is refused."""

from pathlib import Path

import numpy as np
import pydicom
import pytest
from pydicom.dataset import Dataset
from pydicom.uid import DeflatedExplicitVRLittleEndian

from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.labels import read_labels
from epsmesh.shapes.triangles import SurfaceError
from tests.organs import write_nifti
from tests.shapes.files import dicoms


def _nifti(path: Path) -> Path:
    return write_nifti(path, dicoms.values(), dicoms.affine())


def _same(path: Path, nifti: Path) -> None:
    """Compare labels at their places with those of NIfTI, and the surfaces of both."""
    one, other = read_labels(path, None), read_labels(nifti, None)
    np.testing.assert_allclose(one.affine[:, :3], other.affine[:, :3], rtol=1e-6, atol=1e-12)
    first = np.round(np.linalg.solve(other.affine[:, :3], one.affine[:, 3] - other.affine[:, 3])).astype(int)
    np.testing.assert_allclose(one.affine[:, 3], other.affine @ [*first, 1], atol=1e-9)
    for label in dicoms.NAMES:
        places = np.argwhere(one.values == label) + first
        np.testing.assert_array_equal(places, np.argwhere(other.values == label))
    surfaces = [read_image(file, 3).triangles for file in (path, nifti)]
    assert surfaces[0].volume == pytest.approx(surfaces[1].volume, rel=1e-6)
    np.testing.assert_allclose(surfaces[0].bounds, surfaces[1].bounds, atol=1e-9)


def test_a_segmentation_is_the_nifti_of_the_same_labels(tmp_path: Path):
    path = dicoms.segmentation(tmp_path / "seg.dcm", dicoms.frames(dicoms.values()))
    _same(path, _nifti(tmp_path / "scan.nii"))
    found = read_labels(path, None)
    assert found.names == dicoms.NAMES
    assert any("not known whether the image ends" in notice for notice in found.notices)
    assert read_image(path, "tumour").triangles.hash == read_image(path, 3).triangles.hash


def test_slices_that_were_cropped_to_the_segments_are_no_end_of_the_image(tmp_path: Path):
    inside = np.argwhere(dicoms.values())
    (i, j, _), (m, n, _) = inside.min(axis=0), inside.max(axis=0) + 1
    frames = [(segment, k, pixels[i:m, j:n]) for segment, k, pixels in dicoms.frames(dicoms.values())]
    path = dicoms.segmentation(tmp_path / "cropped.dcm", frames, Columns=int(m - i), Rows=int(n - j))
    cropped, whole = (
        read_image(path, 1, inner=((3, None),)),
        read_image(_nifti(tmp_path / "scan.nii"), 1, inner=((3, None),)),
    )
    assert not any("cut off flat" in notice for notice in cropped.notices)
    assert any("not known whether the image ends at them" in notice for notice in cropped.notices)
    assert cropped.triangles.volume == pytest.approx(whole.triangles.volume, rel=1e-6)
    np.testing.assert_allclose(
        np.ptp(cropped.triangles.bounds, axis=0), np.ptp(whole.triangles.bounds, axis=0), atol=1e-9
    )


def test_a_label_map_is_the_nifti_of_the_same_labels(tmp_path: Path):
    values = dicoms.values()
    frames = [(0, k, np.where(values[:, :, k] == 0, 9, values[:, :, k])) for k in (*range(1, 22), 0)]
    path = dicoms.segmentation(tmp_path / "seg.dcm", frames, "LABELMAP", PixelPaddingValue=9)
    _same(path, _nifti(tmp_path / "scan.nii"))
    assert set(read_labels(path, None).labels) == {1, 3}


def test_a_fraction_counts_from_one_half_on(tmp_path: Path):
    frames = [
        (1, k, 200 * (dicoms.values()[:, :, k] == 1) + 40 * (dicoms.values()[:, :, k] == 3))
        for k in range(dicoms.SHAPE[2])
    ]
    found = read_labels(
        dicoms.segmentation(tmp_path / "seg.dcm", frames, "FRACTIONAL", MaximumFractionalValue=255), None
    )
    assert (found.values == 1).sum() == (dicoms.values() == 1).sum()
    assert any("half of the largest fraction" in notice for notice in found.notices)


def test_segments_that_overlap_and_slices_that_miss_are_told(tmp_path: Path):
    values = dicoms.values()
    organ = [(1, k, values[:, :, k] > 0) for k in range(dicoms.SHAPE[2]) if k not in (9, 10)]
    tumour = [(3, k, values[:, :, k] == 3) for k in range(dicoms.SHAPE[2]) if k not in (9, 10)]
    found = read_labels(dicoms.segmentation(tmp_path / "seg.dcm", organ + tumour), None)
    overlap = int((np.delete(values, (9, 10), axis=2) == 3).sum())
    assert any(f"Liver and Tumour overlap in {overlap} voxels" in notice for notice in found.notices)
    assert any("2 slices between others have no segment" in notice for notice in found.notices)
    assert (found.values == 3).sum() == overlap


def test_a_series_of_labels_is_the_nifti_of_the_same_labels(tmp_path: Path):
    folder = dicoms.series(tmp_path / "series", dicoms.values(), list(range(dicoms.SHAPE[2])))
    _same(folder, _nifti(tmp_path / "scan.nii"))
    found = read_labels(folder, None)
    assert (found.notices, found.labels) == ((), (1, 3))


def test_what_is_no_label_map_is_refused(tmp_path: Path):
    values = dicoms.values()
    slices = list(map(float, range(dicoms.SHAPE[2])))
    uneven = [*slices[:10], 10.4, *slices[11:]]
    named = {
        key: dicoms.series(tmp_path / key, values, places) for key, places in {"a": slices, "uneven": uneven}.items()
    }
    dicoms.series(tmp_path / "missing", np.delete(values, 10, axis=2), slices[:10] + slices[11:])
    dicoms.series(tmp_path / "two", values, slices)
    (tmp_path / "two" / "other").write_bytes((named["a"] / "IM0000").read_bytes())
    data = pydicom.dcmread(tmp_path / "two" / "other")
    data.SeriesInstanceUID = "1.2.4"
    data.save_as(tmp_path / "two" / "other")
    (tmp_path / "empty").mkdir()
    (tmp_path / "one.dcm").write_bytes((named["a"] / "IM0000").read_bytes())
    (tmp_path / "letter.dcm").write_text("Dear colleague")
    whole = dicoms.segmentation(tmp_path / "whole.dcm", dicoms.frames(values))
    (tmp_path / "short.dcm").write_bytes(whole.read_bytes()[:-200])
    data = pydicom.dcmread(whole)
    data.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
    data.save_as(tmp_path / "deflated.dcm")
    dicoms.segmentation(tmp_path / "slide.dcm", dicoms.frames(values), SharedFunctionalGroupsSequence=[Dataset()])
    for name, words in {
        "uneven": "not equally spaced",
        "missing": "1 of its slices are missing, the first at",
        "two": "2 DICOM series",
        "empty": "folder without files",
        "one.dcm": "is one slice of a DICOM series",
        "letter.dcm": "cannot be read as DICOM",
        "short.dcm": "cannot be read as DICOM",
        "deflated.dcm": "deflated",
        "slide.dcm": "does not give the position",
    }.items():
        with pytest.raises(SurfaceError, match=words):
            read_image(tmp_path / name, 1)
    with pytest.raises(SurfaceError, match="names are Liver, Tumour"):
        read_image(whole, "liver lesion")
    with pytest.raises(SurfaceError, match="says mm"):
        read_image(whole, 1, unit=1e-2)
