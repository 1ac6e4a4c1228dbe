"""Label maps: the surface of a label, its position by the header, and refusals."""

import gzip
from pathlib import Path
from typing import Any

import nibabel
import nrrd
import numpy as np
import pytest

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.crossings import crossings
from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.label_surface import default_smooth, filtered
from epsmesh.shapes.triangles import SurfaceError, Triangles, doubled_normals
from tests.organs import write_nifti

AXES = np.array([40.0, 30.0, 20.0])  # mm
CENTRE = np.array([10.31, -20.17, 55.43])  # mm: right, front, head; on no voxel
VOLUME = 4 / 3 * np.pi * AXES.prod() * 1e-9  # m³
LPS = np.diag([-1.0, -1.0, 1.0])


def _affine(spacing: Any, low: Any = (-40, -70, 5)) -> FloatArray:
    affine = np.diag([*np.broadcast_to(spacing, 3), 1.0])
    affine[:3, 3] = low
    return affine


def _ellipsoid(affine: FloatArray, shape: tuple[int, ...], label: int = 2) -> np.ndarray:
    places = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1) @ affine[:3, :3].T + affine[:3, 3]
    return (((((places - CENTRE) / AXES) ** 2).sum(-1) < 1) * label).astype(np.uint8)


def _distances(triangles: Triangles) -> FloatArray:
    """Return distances (m) of its points from the ellipsoid, to first order."""
    place, axes = triangles.points - CENTRE / 1e3, AXES / 1e3
    level = np.sqrt(((place / axes) ** 2).sum(axis=1))
    return (level - 1) * level / np.linalg.norm(place / axes**2, axis=1)


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    affine = _affine(2.0)
    return write_nifti(tmp_path / "scan.nii.gz", _ellipsoid(affine, (51, 51, 51)), affine)


@pytest.mark.parametrize(
    ("voxel", "smooth", "share", "change"),
    [((1, 1, 1), 1.5, 0.1, 5e-3), ((2, 2, 2), 3.0, 0.1, 5e-3), ((1, 1, 5), 5.0, 0.12, 0.01)],
)
def test_the_surface_is_within_a_tenth_of_a_voxel_and_keeps_the_volume(voxel, smooth, share, change, tmp_path: Path):
    """Thick slices are smoothed over their distance."""
    affine, count = _affine(voxel), tuple(100 // size + 1 for size in voxel)
    triangles = read_image(write_nifti(tmp_path / "scan.nii", _ellipsoid(affine, count), affine), 2).triangles
    assert default_smooth(1e-3 * np.array(voxel)) == pytest.approx(1e-3 * smooth)
    assert np.sqrt((_distances(triangles) ** 2).mean()) < share * 1e-3 * max(voxel)
    assert triangles.volume == pytest.approx(VOLUME, rel=change)


def test_without_the_filter_the_steps_between_voxels_stay(scan: Path):
    def normals_off(triangles: Triangles) -> float:
        normal = doubled_normals(triangles.points, triangles.facets)
        area = np.linalg.norm(normal, axis=1)
        middle = triangles.points[triangles.facets].mean(axis=1) - CENTRE / 1e3
        exact = middle / AXES**2
        cosine = np.einsum("ij,ij->i", normal, exact) / area / np.linalg.norm(exact, axis=1)
        return float(np.degrees(np.sqrt((area * np.arccos(np.clip(cosine, -1, 1)) ** 2).sum() / area.sum())))

    assert normals_off(read_image(scan, 2).triangles) < 4
    assert normals_off(read_image(scan, 2, smooth=0.0).triangles) > 15


@pytest.mark.parametrize(("thickness", "least", "most"), [(12, 2, 2), (8, 0.75, 1.9), (2, 0.75, 0.9), (1, 0.5, 0.75)])
def test_the_filter_is_narrowed_for_a_label_that_is_thin_everywhere(thickness: int, least: float, most: float):
    """Sheets of some voxels, and a filter of two."""
    mask, asked = np.zeros((40, 41, 41), bool), np.full(3, 2.0)
    mask[10 : 10 + thickness] = True
    assert least <= filtered(mask, asked, may_narrow=True)[1][0] <= most
    assert filtered(mask, asked, may_narrow=False)[1][0] == 2


def test_voxels_may_be_turned_and_mirrored(tmp_path: Path):
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0] @ np.diag([2.0, 2.0, -2.0])
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = turn, CENTRE - turn @ (40, 40, 40)
    triangles = read_image(write_nifti(tmp_path / "scan.nii", _ellipsoid(affine, (81, 81, 81)), affine), 2).triangles
    assert triangles.volume == pytest.approx(VOLUME, rel=0.005)
    assert abs(_distances(triangles)).max() < 1.2e-3


def test_the_same_place_from_both_formats(scan: Path, tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51))
    header = {
        "space": "left-posterior-superior",
        "space directions": (LPS @ affine[:3, :3]).T,
        "space origin": LPS @ affine[:3, 3],
    }
    nrrd.write(str(tmp_path / "scan.nrrd"), values, header)
    assert read_image(tmp_path / "scan.nrrd", 2).triangles.hash == read_image(scan, 2).triangles.hash


@pytest.mark.parametrize("smooth", [0.0, 2e-3, None])
def test_no_facets_cross_however_ragged_the_label_is(smooth: float | None, tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51))
    random = np.random.Generator(np.random.PCG64(4)).random(values.shape)
    values[random < 0.03] = 0
    values[(np.roll(values, 1, axis=0) > 0) & (random > 0.5)] = 2
    triangles = read_image(write_nifti(tmp_path / "ragged.nii", values, affine), 2, smooth=smooth).triangles
    assert not len(crossings(triangles.points, triangles.facets))


def test_units_of_the_header(tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51))
    metres = affine * np.array([[1e-3]] * 3 + [[1.0]])
    assert read_image(write_nifti(tmp_path / "m.nii", values, metres, "meter"), 2).triangles.volume == pytest.approx(
        VOLUME, rel=0.01
    )
    unknown = write_nifti(tmp_path / "unknown.nii", values, affine, "unknown")
    with pytest.raises(SurfaceError, match="names no unit"):
        read_image(unknown, 2)
    assert read_image(unknown, 2, unit=1e-3).triangles.volume == pytest.approx(VOLUME, rel=0.01)
    with pytest.raises(SurfaceError, match="another unit"):
        read_image(write_nifti(tmp_path / "mm.nii", values, affine), 2, unit=1e-2)
    with pytest.raises(SurfaceError, match=r"2 mm allowed|across, allowed"):
        read_image(write_nifti(tmp_path / "um.nii", values, affine, "micron"), 2)


def test_crumbs_hollows_and_the_image_s_end_are_told(tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51))
    values[0:2, 0:2, 0:2] = 2
    values[25, 25, 25] = 7
    loaded = read_image(write_nifti(tmp_path / "scan.nii", values, affine), 2)
    assert any("1 pieces besides" in notice for notice in loaded.notices)
    assert any("1 voxels that it encloses" in notice for notice in loaded.notices)
    assert loaded.triangles.volume == pytest.approx(VOLUME, rel=0.01)
    half = read_image(write_nifti(tmp_path / "half.nii", values[25:], _affine(2.0, (10, -70, 5))), 2)
    assert any("cut off flat at the image's end: left (x = 9 mm)." in notice for notice in half.notices)
    more = np.pi * AXES[1] * AXES[2] * (CENTRE[0] - 9.0) * 1e-9  # the outermost voxels reach to x = 9 mm
    assert half.triangles.volume == pytest.approx(VOLUME / 2 + more, rel=0.01)


def test_the_sides_that_are_cut_off_are_the_patient_s(tmp_path: Path):
    affine = np.array([[0, -2.0, 0, 20], [0, 0, -2.0, 30], [2.0, 0, 0, -7], [0, 0, 0, 1]])
    values = np.zeros((20, 21, 22), np.uint8)
    values[3:, :15, 4:22] = 1
    (notice,) = read_image(write_nifti(tmp_path / "cut.nii", values, affine), 1).notices
    # The first axis runs to the head, the second one to the left, the third one to the back.
    assert "head (z = 32 mm), right (x = 21 mm), back (y = -13 mm)." in notice


def test_what_is_no_label_map_is_refused(scan: Path, tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51))
    two = values.copy()
    two[0:14, 0:14, 0:14] = 2
    shell = values.copy()
    shell[15:35, 18:32, 20:30] = 0
    broken = gzip.compress(gzip.decompress(scan.read_bytes())[:5000])
    files: dict[str, tuple[Any, int, str]] = {
        "missing.nii": (values, 5, "no voxel has label 5; labels are 2"),
        "nothing.nii": (values * 0, 1, "all are 0"),
        "grey.nii": (values * np.float32(0.37), 1, "not integers"),
        "ct.nii": (values.astype(np.int16) - 1000, 2, "it is an image, such as a CT"),
        "times.nii": (np.stack([values, values], 3), 2, "4 dimensions"),
        "two.nii": (two, 2, "which one is meant"),
        "hollow.nii": (shell, 2, "encloses"),
        "one.nii": ((values * 0)[:1, :1, :1] + 2, 2, "thinner than the width of the filter"),
        "truncated.nii.gz": (scan.read_bytes()[:300], 2, "cannot be read as NIfTI"),
        "short.nii.gz": (broken, 2, "cannot be read as NIfTI"),
        "letter.nrrd": (b"Dear colleague", 2, "cannot be read as NRRD"),
        "empty.nii": (b"", 2, "is empty"),
        "organ.mha": (b"x", 2, "allowed label maps are"),
    }
    for name, (content, label, words) in files.items():
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            write_nifti(path, content, affine)
        with pytest.raises(SurfaceError, match=words):
            read_image(path, label)
    nrrd.write(str(tmp_path / "nowhere.nrrd"), values, {})
    with pytest.raises(SurfaceError, match="names no unit"):
        read_image(tmp_path / "nowhere.nrrd", 2)
    with pytest.raises(SurfaceError, match="voxel size is unknown"):
        read_image(tmp_path / "nowhere.nrrd", 2, unit=1e-3)


def test_several_labels_are_one_body_and_no_label_is_meant_twice(tmp_path: Path):
    affine = _affine(2.0)
    whole = _ellipsoid(affine, (51, 51, 51))
    parts = whole.copy()
    parts[25:][parts[25:] == 2] = 9
    parts[20:30, 24:28, 22:28][parts[20:30, 24:28, 22:28] > 0] = 4
    one, path = (write_nifti(tmp_path / f"{n}.nii", values, affine) for n, values in enumerate((whole, parts)))
    names = tmp_path / "names.txt"
    names.write_text("2 liver 1 1 1 255\n4 tumour 1 1 1 255\n9 lobe 1 1 1 255\n")
    united = read_image(path, (2, "lobe", 4), names=str(names)).triangles
    np.testing.assert_array_equal(united.points, read_image(one, 2).triangles.points)
    inner = read_image(path, ("liver", 9), names=str(names), inner=((4, None),)).triangles
    np.testing.assert_array_equal(inner.points, united.points)
    for label, region in [("liver", 2), (2, "Liver"), (("tumour", 2), 4), ((2, 2), 4)]:
        with pytest.raises(SurfaceError, match=r"label = .* and label = .* are the same label"):
            read_image(path, label, names=str(names), inner=((region, None),))
    with pytest.raises(SurfaceError, match="no voxel has label 5; labels are 2"):
        read_image(path, (2, 5), names=str(names))


def test_a_sform_without_volume_gives_way_to_the_qform_and_two_that_differ_are_told(scan: Path, tmp_path: Path):
    image: Any = nibabel.load(scan)
    image.set_qform(image.affine, 1)
    image.set_sform(np.diag([0, 0, 0, 1.0]), 1)
    nibabel.save(image, tmp_path / "zero.nii")
    zero, right = read_image(tmp_path / "zero.nii", 2), read_image(scan, 2)
    np.testing.assert_allclose(zero.triangles.points, right.triangles.points, atol=1e-9)
    assert any("its qform is used" in notice for notice in zero.notices)
    image.set_sform(_affine(2.0, (-36, -70, 8)), 1)
    nibabel.save(image, tmp_path / "two.nii")
    two = read_image(tmp_path / "two.nii", 2)
    np.testing.assert_allclose(two.triangles.points, right.triangles.points + np.array([4e-3, 0, 3e-3]), atol=1e-9)
    assert any("its sform and its qform differ by up to 5 mm: its sform is used" in notice for notice in two.notices)
    assert not any("qform" in notice for notice in right.notices)


def test_background_that_is_not_a_number_is_background(scan: Path, tmp_path: Path):
    affine = _affine(2.0)
    values = _ellipsoid(affine, (51, 51, 51)).astype(np.float32)
    values[values == 0] = np.nan
    found = read_image(write_nifti(tmp_path / "nan.nii", values, affine), 2)
    np.testing.assert_array_equal(found.triangles.points, read_image(scan, 2).triangles.points)
    for wrong in (-1.0, np.inf):
        values[0, 0, 0] = wrong
        with pytest.raises(SurfaceError, match="contains values from"):
            read_image(write_nifti(tmp_path / f"{wrong}.nii", values, affine), 2)


def test_other_formats_of_nibabel_are_at_the_same_place_and_analyze_is_refused(scan: Path, tmp_path: Path):
    image: Any = nibabel.load(scan)
    values, affine = np.asarray(image.dataobj), image.affine
    pair = nibabel.Nifti1Pair(values, affine)
    pair.header.set_xyzt_units("mm")
    nibabel.save(nibabel.MGHImage(values, affine), tmp_path / "scan.mgz")
    nibabel.save(pair, tmp_path / "pair.img")
    nibabel.save(nibabel.AnalyzeImage(values, np.diag([-2.0, 2, 2, 1])), tmp_path / "old.img")
    expected = read_image(scan, 2).triangles.points
    for name in ("scan.mgz", "pair.img", "pair.hdr"):
        np.testing.assert_allclose(read_image(tmp_path / name, 2).triangles.points, expected, atol=1e-9)
    with pytest.raises(SurfaceError, match=r"Analyze 7.5.* which side is left: save it as \.nii\.gz"):
        read_image(tmp_path / "old.hdr", 2)
