"""Bodies that files hold, in studies: keys, what is refused, what is told, and what results are known by."""

from pathlib import Path

import pytest

from epsmesh.plan.key import case_key
from epsmesh.shapes.contact import lifted_edge
from epsmesh.study.check_mesh import held_gaps
from epsmesh.study.problems import StudyError
from tests.cases import study
from tests.shapes.files.solids import ball, both, stl

MESHES = Path(__file__).resolve().parents[2] / "meshes"


def of(body, at=("-25 mm", "0 mm")):
    return study(body={"fixed": {"below": "-10 mm"}} | body, probe={"at": list(at)})


def surface(file, **keys):
    return of({"shape": "surface", "file": str(file), "unit": "mm"} | keys)


def image(**keys):
    return of({"shape": "image", "file": str(MESHES / "liver.nii.gz"), "label": 1} | keys)


@pytest.fixture
def crumbs(tmp_path):
    path = tmp_path / "crumbs.stl"
    path.write_bytes(stl(both(ball(), ball(1, (1.0, 1.0, 1.0), (60.0, 0.0, 0.0)))))
    return path


def test_an_image_is_the_body_that_its_surface_is():
    of_image, of_surface = image().case(()).body, surface(MESHES / "liver.stl").case(()).body
    assert of_image.volume == pytest.approx(of_surface.volume, rel=2e-3)
    place = of_image.frame((-25e-3, 0.0)), of_surface.frame((-25e-3, 0.0))
    assert place[0].point == pytest.approx(place[1].point, abs=0.3e-3)


def test_what_was_done_to_a_file_is_a_warning(crumbs):
    (warning,) = (w for w in surface(crumbs, repair=True).warnings if "repaired" in w)
    assert "1 shells beside the largest one" in warning
    assert any("voxels that it encloses" in warning for warning in image().warnings)
    assert not any("body.file" in warning for warning in surface(MESHES / "liver.stl").warnings)


def test_a_broken_file_and_a_label_that_is_not_there_are_refused_by_key(crumbs):
    with pytest.raises(StudyError, match=r"body\.file.*crumbs\.stl.*2 separate shells"):
        surface(crumbs)
    with pytest.raises(StudyError, match=r"body\.file.*no voxel has label 5; labels are 1, 2"):
        image(label=5)
    with pytest.raises(StudyError, match=r"body\.label"):
        image(label=0)
    with pytest.raises(StudyError, match=r"body\.label.*required"):
        of({"shape": "image", "file": str(MESHES / "liver.nii.gz")})
    with pytest.raises(StudyError, match=r"body\.file.*another unit"):
        image(unit="cm")


def test_results_are_known_by_the_surface_not_by_how_it_was_come_by(crumbs, tmp_path):
    plain = tmp_path / "plain.stl"
    plain.write_bytes(stl(ball()))
    keys = {case_key(s.case(())) for s in (surface(plain), surface(plain, repair=True), surface(crumbs, repair=True))}
    assert len(keys) == 1
    assert case_key(surface(plain, smooth="2 mm").case(())) not in keys


def test_elements_fit_between_a_footprint_and_what_is_held():
    """The gap is at least the height of the footprint's edge above the level."""
    (case,) = surface(MESHES / "liver.stl").cases()
    lowest = float(lifted_edge(case.body, case.probe, case.frame)[:, 2].min())
    near = {"below": f"{1e3 * lowest - 0.3:.6f} mm"}
    body = {"shape": "surface", "file": str(MESHES / "liver.stl"), "unit": "mm", "fixed": near}
    probe = {"at": ["-25 mm", "0 mm"]}
    with pytest.raises(StudyError, match=r"leaves 0\.3 mm between the tool's edge and a fixed face"):
        study(body=body, probe=probe, mesh={"rim": "0.5 mm"})
    (fits,) = study(body=body, probe=probe, mesh={"rim": "0.2 mm"}).cases()
    assert held_gaps(fits.body, fits.probe, fits.mesh)["body.fixed"] == pytest.approx(0.3e-3, rel=1e-3)
    with pytest.raises(StudyError, match="must not reach the support"):
        study(body=body | {"fixed": {"below": f"{1e3 * lowest + 0.3:.6f} mm"}}, probe=probe)
