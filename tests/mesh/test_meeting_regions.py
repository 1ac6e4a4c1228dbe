"""Regions of an image that meet each other and the body's surface: meshes and forces of cases, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run import meshing
from epsmesh.shapes.files.labels import LabelMap
from epsmesh.study.problems import StudyError
from epsmesh_realtime.export.scope import ExportError, scope_of
from tests.cases import solve, study
from tests.complexes import scene
from tests.organs import write_nifti

pytest.importorskip("nibabel")

PROBE = {"shape": "disc", "radius": "4 mm", "depth": "0.1 mm", "at": ["-4 mm", "4 mm", "20 mm"]}
MESH = {"epsilon": "full", "fine": "12 mm", "coarse": "12 mm", "rim": "1.5 mm", "growth": 1.0}
TISSUE = {"young": "10 kPa", "poisson": 0.4}
ON_BORDER = ("18 mm", "3 mm", "17 mm")
LOBE = {"name": "lobe", "label": 5} | TISSUE
TUMOUR = {"name": "tumour", "label": 7} | TISSUE


def write(path, labels: LabelMap):
    return write_nifti(path, labels.values.astype(np.uint8), np.vstack([1e3 * labels.affine, [0, 0, 0, 1]]))


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Return a function from regions, and the place of the probe, to the sections of a study."""
    image = scene((3, 3, 3))
    path = write(tmp_path_factory.mktemp("image") / "scan.nii.gz", image)
    whole = write(path.with_name("whole.nii.gz"), LabelMap((image.values > 0).astype(int), image.affine))

    def sections(*regions, at=PROBE["at"], **more):
        body = {"shape": "image", "file": str(path if regions else whole), "label": 1, "fixed": {"below": "-9 mm"}}
        body |= {"region": list(regions)} if regions else {}
        return {"body": body | more, "probe": PROBE | {"at": list(at)}, "mesh": MESH, "material": TISSUE}

    return sections


def faces(corners):
    return map(tuple, corners[[(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]].tolist())


def volumes(mesh):
    corners = mesh.points[mesh.cells[:, :4]]
    return np.bincount(mesh.regions, np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6)


def test_regions_that_meet_are_meshed_with_their_volumes_below_a_tool_on_one_of_them(given):
    case = study(**given(TUMOUR, LOBE, at=("28 mm", "3 mm", "12 mm"))).case(())
    parts, mesh = case.body.partition, mesh_arrays(case, ())
    assert len(case.body.meeting) == 2
    np.testing.assert_allclose(volumes(mesh), [parts.volume(region) for region in (0, 1, 2)], rtol=0.03)
    centres = mesh.points[mesh.cells[:, :4]].mean(axis=1)
    for number, piece in enumerate(case.body.region, start=1):
        depth = -piece.surface.distance(centres)
        clear = np.abs(depth) > 1.5e-3
        np.testing.assert_array_equal((mesh.regions == number)[clear], (depth > 0)[clear])
    below = np.unique(mesh.facets["probe"])
    assert {*mesh.regions[np.isin(mesh.cells, below).any(axis=1)].tolist()} == {2}


@pytest.mark.parametrize(
    "probe",
    [
        pytest.param({}, marks=pytest.mark.nightly),
        {
            "shape": "blade",
            "length": "9 mm",
            "width": "3 mm",
            "direction": [0, 1, 0],
            "at": ["19.57 mm", "3 mm", "17 mm"],
        },
    ],
    ids=["disc", "along a blade's side"],
)
def test_elements_follow_a_border_below_the_footprint(given, probe):
    """They have its tissues, on the true border; the footprint keeps its edge."""
    sections = given(TUMOUR, LOBE, at=ON_BORDER)
    sections["probe"] |= probe
    if "shape" in probe:
        del sections["probe"]["radius"]
    case = study(**sections).case(())
    parts, mesh = case.body.partition, mesh_arrays(case, ())
    np.testing.assert_allclose(volumes(mesh), [parts.volume(region) for region in (0, 1, 2)], rtol=0.03)
    facets = mesh.facets["probe"]
    owner = {tuple(facet): cell for cell, corners in enumerate(np.sort(mesh.cells[:, :4])) for facet in faces(corners)}
    region = mesh.regions[[owner[tuple(facet)] for facet in np.sort(facets).tolist()]]
    centres = mesh.points[facets].mean(axis=1)
    depth = -case.body.region[1].surface.distance(centres + 1e-5 * np.array(case.frame.axis))
    clear = np.abs(depth) > 1e-4
    assert {*region.tolist()} == {0, 2}
    np.testing.assert_array_equal((region == 2)[clear], (depth > 0)[clear])
    a, b, c = np.moveaxis(case.frame.local(mesh.points)[facets, :2], 1, 0)
    area = abs(np.linalg.det(np.stack([b - a, c - a], axis=1))).sum() / 2
    x, y = case.probe.outline().T
    assert area == pytest.approx(abs(x[:-1] @ y[1:] - y[:-1] @ x[1:]) / 2, rel=0.03)


def test_a_border_of_an_image_has_the_force_of_a_layer_that_the_kernel_draws(tmp_path):
    """A disc on the side of a box, across the end of its upper layer."""
    count, voxel = np.array([20, 20, 20]), 2.0
    labels = np.zeros(count + 8, dtype=int)
    labels[4:-4, 4:-4, 4:-4] = 1
    labels[4:-4, 4:-4, 14:-4] = 2
    affine = 1e-3 * np.column_stack([voxel * np.eye(3), [-27.0, -27.0, -47.0]])
    image = {"shape": "image", "file": str(write(tmp_path / "box.nii", LabelMap(labels, affine))), "label": 1}
    upper = TISSUE | {"name": "upper", "young": "100 kPa"}
    box = {"shape": "box", "size": ["40 mm"] * 3, "layer": [upper | {"thickness": "20 mm"}]}
    probe = PROBE | {"at": ["20 mm", "0 mm", "-20 mm"]}

    def found(body):
        body |= {"fixed": {"below": "-30 mm"}}
        (record,) = solve(body=body, probe=probe, mesh=MESH | {"rim": "1 mm"}, material=TISSUE).values()
        return record

    drawn, meshed = found(box), found(image | {"region": [upper | {"label": 2}]})
    assert meshed.force == pytest.approx(drawn.force, rel=0.02)
    assert max(drawn.force_error, meshed.force_error) < 0.1


@pytest.mark.nightly
def test_a_map_across_a_border_has_the_force_of_every_place(given):
    """It grows from that of the softer tissue to that of the stiffer one."""
    sections = given(TUMOUR, LOBE | {"young": "40 kPa"})
    del sections["probe"]["at"]
    sections["probe"]["path"] = {"points": [[f"{x} mm", "3 mm", "17 mm"] for x in (12, 18, 27)]}
    soft, across, stiff = (record.force for record in solve(**sections).values())
    assert soft < across < stiff
    assert 2 < stiff / soft < 4


def test_parts_of_one_material_have_the_force_of_the_whole(given, monkeypatch):
    """Also below a tool across their border."""
    made = []

    def kept(case, mirrors, _cache):
        made.append(mesh_arrays(case, mirrors))
        return made[-1]

    monkeypatch.setattr(meshing, "_cached_unrefined", kept)

    def found(*regions):
        (record,) = solve(**given(*regions, at=ON_BORDER)).values()
        return record

    parts, whole = (found(*regions) for regions in ((TUMOUR, LOBE), ()))
    assert made[0].regions is not None and made[1].regions is None
    assert abs(parts.force / whole.force - 1) < parts.force_error + whole.force_error
    undivided = replace(made[0], regions=np.zeros_like(made[0].regions))
    monkeypatch.setattr(meshing, "_cached_unrefined", lambda *_: undivided)
    assert parts.force == pytest.approx(found(TUMOUR, LOBE).force, rel=1e-6)


def test_a_hollow_region_leaves_its_neighbours_alone(given):
    hollow = {"name": "vessel", "label": 7, "hollow": True}
    case = study(**given(hollow, LOBE)).case(())
    parts, mesh = case.body.partition, mesh_arrays(case, ())
    found = volumes(mesh)
    np.testing.assert_allclose(found[[0, 2]], [parts.volume(0), parts.volume(2)], rtol=0.03)
    assert found[1] == 0


def test_a_hollow_region_that_leaves_the_body_ends_below_its_surface(given):
    """The body has the surface that it had, and a cavity in it."""
    solid, vessel = study(**given(TUMOUR, LOBE)).case(()).body, {"name": "vessel", "label": 5, "hollow": True}
    found = study(**given(TUMOUR, vessel))
    assert any("label 5 leaves the body: it ends 9 mm below the surface" in said for said in found.warnings)
    case = found.case(())
    (cavity,) = case.body.cavities.values()
    assert 0 < cavity.volume < 0.5 * solid.region[1].surface.volume
    assert case.body.volume == pytest.approx(solid.volume, rel=0.01)
    mesh = mesh_arrays(case, ())
    inside = -cavity.distance(mesh.points[mesh.cells[:, :4]].mean(axis=1))
    assert inside.max() < 1.5e-3
    walls = np.abs(cavity.distance(mesh.points[np.unique(mesh.facets["free"])])) < 1e-4
    assert walls.sum() > 20  # points of the cavity's wall, which nothing holds


def test_a_skin_of_two_voxels_is_meshed_and_one_of_one_voxel_is_refused_with_the_way_out(tmp_path):
    """As the skin, and as what is around another label."""
    axes, steps = np.array([18.0, 15.0, 12.0]), 2.0
    count = np.ceil(2 * axes / steps).astype(int) + 8
    x = (np.moveaxis(np.indices(count), 0, -1) - (count - 1) / 2) * steps
    affine = 1e-3 * np.column_stack([steps * np.eye(3), -(count - 1) / 2 * steps])

    def sections(skin, label, other):
        labels = (((x / axes) ** 2).sum(axis=-1) < 1) * 2
        labels[((x / (axes - skin)) ** 2).sum(axis=-1) < 1] = 1
        file = write(tmp_path / f"skin{skin}.nii", LabelMap(labels, affine))
        body = {"shape": "image", "file": str(file), "label": label, "fixed": {"below": "-6 mm"}}
        body["region"] = [{"name": "other", "label": other} | TISSUE]
        return {"body": body, "probe": PROBE | {"at": ["0 mm", "0 mm"]}, "mesh": MESH, "material": TISSUE}

    for label, other, told in ((1, 2, r"body\.region\[1\]\.label = 2: other"), (2, 1, r"body\.label = 2: tissue")):
        with pytest.raises(StudyError, match=rf"{told} is 2\.\d+ mm thick, 1\.0 voxels.* voxels of half the size"):
            study(**sections(2, label, other))
    case = study(**sections(4, 1, 2)).case(())
    parts = case.body.partition
    np.testing.assert_allclose(volumes(mesh_arrays(case, ())), [parts.volume(0), parts.volume(1)], rtol=0.03)


def test_what_cannot_be_is_refused_by_name_and_place(given):
    disc = {"probe": PROBE | {"contact": "frictionless", "at": ["-4 mm", "4 mm"]}}
    with pytest.raises(ExportError, match=r"body\.region meets the surface"):
        scope_of(study(**given(TUMOUR, LOBE) | disc))
    with pytest.raises(StudyError, match=r"footprint of the disc misses.*`smooth` removes those of voxels"):
        study(**given(TUMOUR, LOBE, smooth="0 mm"))
