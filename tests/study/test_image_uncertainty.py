"""A segmentation's boundary shifted, and what it and the smoothing leave open of F: `force_image_uncertainty`."""

from dataclasses import replace
from pathlib import Path

import nibabel
import numpy as np
import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.report.uncertainty import IMAGE, NAME, bars, force_image_uncertainty, unknowns
from epsmesh.run.record import Record
from epsmesh.shapes.files.read import read_surface
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from epsmesh_identify.estimation.dataset import write
from tests.cases import raw, study
from tests.identifications import identification
from tests.organs import box, write_nifti, write_stl

RADIUS, VOXEL = 14.0, (1.5, 1.5, 2.0)  # mm
CUBE_ROOT = np.prod(VOXEL) ** (1 / 3)


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    """A ball (1) with a ball in it (2), mm from the middle."""
    shape = [int(2 * RADIUS / v) + 11 for v in VOXEL]
    affine = np.diag([*VOXEL, 1.0])
    affine[:3, 3] = [-0.5 * v * (n - 1) + 0.1 for v, n in zip(VOXEL, shape, strict=True)]
    places = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1) * VOXEL + affine[:3, 3]
    r = np.linalg.norm(places, axis=-1)
    values = ((r < RADIUS) * 1 + (r < 6)).astype(np.uint8)
    return write_nifti(tmp_path_factory.mktemp("image") / "ball.nii", values, affine)


def body(image, **keys):
    region = [{"name": "inner", "label": 2, "young": "50 kPa", "poisson": 0.45}]
    return {"shape": "image", "file": str(image), "label": 1, "region": region, "fixed": {"below": "-10 mm"}} | keys


def of(given, **changes):
    return study(body=given, probe={"at": ["0 mm", "0 mm"]}, **changes)


def radius(body) -> float:
    """Return the radius (mm) of the ball of the body's volume."""
    return 1e3 * (0.75 * body.volume / np.pi) ** (1 / 3)


@pytest.mark.parametrize("offset", [-1.0, -0.5, 1.5])
def test_an_image_s_surface_is_shifted(image, offset):
    (before,), (case,) = of(body(image)).cases(), of(body(image, offset=f"{offset} mm")).cases()
    assert radius(case.body) - radius(before.body) == pytest.approx(offset, rel=0.05)
    assert case.body.region[0].surface.volume == before.body.region[0].surface.volume
    assert case.body.content != before.body.content


def test_a_surface_is_shifted_along_its_normals(tmp_path):
    write_stl(tmp_path / "box.stl", *box(0.02, 0.03, 0.01))
    before = read_surface(tmp_path / "box.stl", 1e-3)
    for offset in (-2e-3, 1e-3):
        shifted = read_surface(tmp_path / "box.stl", 1e-3, offset=offset).triangles
        sides = np.ptp(shifted.points, axis=0) - np.ptp(before.triangles.points, axis=0)
        np.testing.assert_allclose(sides, 2 * offset, rtol=1e-9)  # planes at right angles: exact
    with pytest.raises(SurfaceError, match="overturns"):
        read_surface(tmp_path / "box.stl", 1e-3, offset=-6e-3)


def test_the_ends_are_cases_like_others(image):
    plan = make_plan(of(body(image, boundary_uncertainty="0.5 voxel")))
    assert sorted(solve.end_of for solve in plan.solves) == ["", "boundary", "boundary", "smoothing", "smoothing"]
    boundary, smoothing = plan.ends
    (own,) = plan.study.cases()
    for end, sign in ((boundary.low, -1), (boundary.high, 1)):
        (case,) = end.study.cases()
        assert radius(case.body) - radius(own.body) == pytest.approx(sign * CUBE_ROOT / 2, rel=0.05)
        # A case of the store: the study that has this offset asks for the same.
        shifted = make_plan(of(body(image, offset=f"{sign * CUBE_ROOT / 2:.15g} mm")))
        assert end.keys == shifted.keys
    for end, factor in ((smoothing.low, 2 / 3), (smoothing.high, 4 / 3)):
        length = factor * max(1.5 * CUBE_ROOT, 2.0)
        assert end.keys == make_plan(of(body(image, smooth=f"{length:.15g} mm"))).keys
    assert not make_plan(plan.study, stored=plan.all_keys).solves


def _dataset(made):
    """Return the dataset of a study whose forces go as the volume and as 1 + ν."""
    plan = make_plan(made)
    records = {
        solve.key: Record(
            solve.key,
            "ok",
            young=solve.case.material.young,
            depth=solve.case.probe.depth,
            force=1e3 * solve.case.body.volume * (1 + solve.case.material.poisson),
            force_error=1e-4,
        )
        for solve in plan.solves
    }
    return plan, build(plan, records)


def test_f_has_the_half_range_over_boundary_and_smoothing(image):
    plan, found = _dataset(of(body(image, boundary_uncertainty="1 mm")))
    (own,) = plan.study.cases()
    ends = [[next(one.study.cases()).body.volume for one in (end.low, end.high)] for end in plan.ends]
    parts = [max(abs(v / own.body.volume - 1) for v in pair) for pair in ends]
    assert parts[0] == pytest.approx(3 / RADIUS, rel=0.15) and parts[1] < 0.01
    assert float(found[IMAGE]) / float(found["force"]) == pytest.approx(np.hypot(*parts), rel=1e-9)
    assert found[IMAGE].attrs["comment"].startswith("boundary ± 1 mm, smoothing ")
    assert "(boundary ± 1 mm" in unknowns(found)
    assert NAME not in found


def test_an_end_that_cannot_be_computed_is_left_out(image):
    made = of(body(image, boundary_uncertainty="1 mm"))
    plan, whole = _dataset(made)
    boundary, smoothing = plan.ends
    half = replace(plan, ends=(replace(boundary, low=None), replace(smoothing, low=None, high=None)))
    force = whole["force"]
    forces = {id(end.high): force * 1.1 for end in plan.ends}
    bar = force_image_uncertainty(replace(half, ends=half.ends[:1]), force, lambda one: forces[id(one)])
    assert float(bar) == pytest.approx(0.1 * float(force), rel=1e-9)
    assert np.isnan(force_image_uncertainty(half, force, lambda one: forces[id(one)]))


def test_it_is_beside_the_bar_of_an_identified_material(image, tmp_path):
    write(identification(), tmp_path / "one.nc")
    content = raw(body=body(image, boundary_uncertainty="1 mm"), probe={"at": ["0 mm", "0 mm"]})
    made = read_mapping(content | {"material": {"from": "one.nc"}}, "using", tmp_path)
    plan, found = _dataset(made)
    assert [(end.unknown, end.of_image) for end in plan.ends][-2:] == [("boundary", True), ("smoothing", True)]
    assert not any(end.low.ends or end.high.ends for end in plan.ends)
    _, alone = _dataset(read_mapping(content | {"material": {"young": "12 kPa", "poisson": 0.4}}, "alone", tmp_path))
    assert float(found[IMAGE]) == pytest.approx(float(alone[IMAGE]), rel=1e-9)
    assert float(found[NAME]) > 0
    assert [one.cause for one in bars(found)] == ["mesh", "tissue's parameters", "image"]


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"boundary_uncertainty": "3 voxels"}, "at most 2"),
        ({"boundary_uncertainty": "-1 mm"}, "must be a positive length"),
        ({"offset": "9 mm"}, "times the smoothing length"),
        ({"offset": "1 mm", "smooth": "0 mm"}, "times the smoothing length"),
        ({"boundary_uncertainty": "1 mm", "smooth": "0 mm"}, "is too large: `offset` is more than"),
    ],
)
def test_what_makes_no_sense_is_refused(image, keys, told):
    with pytest.raises(StudyError, match=told):
        of(body(image, **keys))


def test_a_region_at_the_bodys_surface_moves_with_it(image, tmp_path):
    found = nibabel.load(image)
    values = (np.asarray(found.dataobj) > 0).astype(np.uint8)
    values[: len(values) // 3][values[: len(values) // 3] > 0] = 2
    nibabel.save(nibabel.Nifti1Image(values, found.affine, found.header), tmp_path / "cap.nii")
    whole, cap = [], []
    for offset in ("-0.5 mm", "0.5 mm"):
        moved = of(body(tmp_path / "cap.nii", offset=offset)).case(()).body
        whole.append(moved.volume)
        cap.append(moved.region[0].surface.volume)
    assert 0.15 * (whole[1] - whole[0]) < cap[1] - cap[0] < 0.3 * (whole[1] - whole[0])
    ends = make_plan(of(body(tmp_path / "cap.nii", boundary_uncertainty="0.5 voxel"))).ends
    assert {end.unknown for end in ends} == {"boundary", "smoothing"}


def test_a_surface_has_a_boundary_but_no_voxels_and_a_box_has_neither(tmp_path):
    write_stl(tmp_path / "box.stl", *box(0.02, 0.03, 0.01))
    surface = {"shape": "surface", "file": str(tmp_path / "box.stl"), "unit": "mm", "fixed": {"below": "-1 mm"}}
    plan = make_plan(of(surface | {"boundary_uncertainty": "0.2 mm"}))
    assert [(end.unknown, end.of_image) for end in plan.ends] == [("boundary", True)]
    with pytest.raises(StudyError, match="a surface has no voxels"):
        of(surface | {"boundary_uncertainty": "0.5 voxel"})
    with pytest.raises(StudyError, match="boundary_uncertainty"):
        study(body={"boundary_uncertainty": "1 mm"})
