"""Regions of triangles in drawn bodies and CAD solids, whose own surfaces are faces of the geometry kernel."""

import gmsh
import numpy as np
import pytest

from epsmesh.compat import gmsh_session
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.plan import make_plan
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.report.dataset import build
from epsmesh.scene.model import FREE
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.triangles import Triangles
from epsmesh.study.problems import StudyError
from tests.cases import raw, refusal, solve, study
from tests.mesh.test_mesh import volume
from tests.mesh.test_regions import volumes
from tests.organs import sphere, write_stl

STIFF = {"young": "50 kPa", "poisson": 0.3}
AT, SEMI_AXES = np.array([2e-3, 1e-3, -9e-3]), np.array([5e-3, 4e-3, 3e-3])
VOLUME = 4 / 3 * np.pi * 5 * 4 * 3  # mm³
INCLUSION = STIFF | {"name": "tumour", "at": ["2 mm", "1 mm", "-9 mm"], "axes": ["5 mm", "4 mm", "3 mm"]}
OTHER = INCLUSION | {"name": "cyst", "at": ["-9 mm", "1 mm", "-9 mm"]}
REGION = STIFF | {"name": "tumour", "file": "tumour.stl", "unit": "mm"}
HOLLOW = {"name": "tumour", "file": "tumour.stl", "unit": "mm", "hollow": True}
SKIN, FAT, REST = (
    {"name": name, "young": "30 kPa", "poisson": 0.3} | more
    for name, more in (("skin", {"thickness": "2 mm"}), ("fat", {"thickness": "12 mm"}), ("rest", {}))
)
PROBE = {"shape": "disc", "radius": "3 mm", "depth": "0.1 mm"}
MESH = {"epsilon": "full", "fine": "4 mm", "coarse": "8 mm", "rim": "0.8 mm", "growth": 0.6, "model": "3d"}
BOX = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"]}
CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
ROUNDED = 3.0  # mm
CAD = {"shape": "cad", "file": "plate.step", "unit": "mm", "fixed": {"below": "-15 mm"}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three tumours, and a plate with a rounded edge."""
    folder = tmp_path_factory.mktemp("solid")
    points, facets = sphere(12)
    write_stl(folder / "tumour.stl", AT + SEMI_AXES * points, facets)
    write_stl(folder / "touching.stl", AT + [0, 7e-3, 0] + SEMI_AXES * points, facets)
    write_stl(folder / "upper.stl", np.array([2e-3, 1e-3, 9e-3]) + SEMI_AXES * points, facets)
    with gmsh_session():
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        box = occ.addBox(-20, -20, -20, 40, 40, 20)
        occ.synchronize()
        upright = next(tag for _, tag in gmsh.model.getEntities(1) if occ.getMass(1, tag) == pytest.approx(20))
        occ.fillet([box], [upright], [ROUNDED])
        occ.synchronize()
        gmsh.write(str(folder / "plate.step"))
        gmsh.clear()
        occ.dilate([(3, occ.addSphere(2, 1, -9, 1))], 2, 1, -9, 5, 4, 3)
        occ.synchronize()
        gmsh.write(str(folder / "tumour.step"))
    return folder


def held(folder, body, *regions, **more):
    regions = [region | ({"file": str(folder / region["file"])}) for region in regions]
    file = {"file": str(folder / body["file"])} if "file" in body else {}
    return body | file | ({"region": regions} if regions else {}) | more


def case_of(folder, body, *regions, **more):
    return study(body=held(folder, body, *regions, **more), probe=PROBE, mesh=MESH).case(())


def force(body):
    (record,) = solve(body=body, probe=PROBE, mesh=MESH).values()
    assert record.status == "ok", record.message
    return record


def test_files_of_inches_are_read(folder):
    """Millimetres that are taken for inches are 25.4 times as large."""
    mm, inches = (
        case_of(folder, BOX | {"size": size}, REGION | {"unit": unit}).body.region[0].surface.volume
        for unit, size in (("mm", ["40 mm", "40 mm", "20 mm"]), ("in", ["2 m", "2 m", "1 m"]))
    )
    assert inches == pytest.approx(25.4**3 * mm)


@pytest.mark.parametrize("body", [CYLINDER, CAD], ids=lambda body: body["shape"])
def test_an_ellipsoid_as_axes_and_as_surface_has_one_force(folder, body):
    as_axes = force(held(folder, body, inclusion=[INCLUSION]))
    as_surface = force(held(folder, body, REGION))
    off = abs(as_surface.force / as_axes.force - 1)
    assert off < 0.005 < as_surface.force_error + as_axes.force_error < 0.12


def test_a_region_of_the_same_tissue_changes_nothing(folder):
    same = force(held(folder, BOX, REGION | {"young": "10 kPa"}))
    without = force(BOX)
    assert abs(same.force / without.force - 1) < 0.01 < same.force_error + without.force_error < 0.12


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (
            {"layer": [SKIN, FAT], "inclusion": [OTHER], "fixed": {"below": "-9 mm"}},
            {0: 6 * 1600, 1: 2 * 1600, 2: 12 * 1600 - 2 * VOLUME, 3: VOLUME, 4: VOLUME},
        ),
        ({"layer": [SKIN, REST]}, {1: 2 * 1600, 2: 18 * 1600 - VOLUME, 3: VOLUME}),
    ],
    ids=["in a layer, beside an inclusion, across the level of the support", "layers that fill the body"],
)
def test_regions_have_their_cells_and_volumes(folder, more, expected):
    case = case_of(folder, BOX, REGION, **more)
    mesh = mesh_arrays(case, ())
    assert volumes(mesh) == pytest.approx(expected, rel=0.01)
    distance = case.body.region[0].surface.distance(mesh.points[mesh.cells[:, :4]].mean(axis=1))
    clear = np.abs(distance) > 0.2e-3
    np.testing.assert_array_equal((mesh.regions == len(case.body.regions))[clear], (distance < 0)[clear])


def test_a_hollow_region_has_no_cells_and_curved_edges_follow_its_wall_and_the_kernels_faces(folder):
    case = case_of(folder, CAD, HOLLOW)
    mesh, cavity = mesh_arrays(case, ()), case.body.region[0].surface
    assert mesh.regions is None and cavity.distance(mesh.points[mesh.cells[:, :4]].mean(axis=1)).min() > 0
    assert volume(mesh) == pytest.approx(case.body.volume - cavity.volume, rel=2e-3)
    middle, wall = np.unique(mesh.cells[:, 4:]), np.unique(mesh.facets[FREE])
    for nodes in (middle, wall):
        assert (np.abs(cavity.distance(mesh.points[nodes])) < 1e-9).sum() > 100
    (x, y, _), axis = np.abs(mesh.points[middle]).T, 20e-3 - 1e-3 * ROUNDED
    on_edge = np.abs(np.hypot(x - axis, y - axis) - 1e-3 * ROUNDED) < 1e-9
    assert (on_edge & (x > axis) & (y > axis)).sum() > 50


def test_a_solid_is_a_region_by_its_triangles(folder):
    solid, surface = (
        case_of(folder, BOX, REGION | {"file": f"tumour.{kind}"}).body.region[0] for kind in ("step", "stl")
    )
    assert 1e9 * solid.surface.volume == pytest.approx(VOLUME, rel=0.01)
    assert np.abs(surface.surface.distance(solid.surface.sample(500))).max() < 0.1e-3
    with pytest.raises(StudyError, match="`repair` and `smooth` are for files of triangles"):
        case_of(folder, BOX, REGION | {"file": "tumour.step", "repair": True})


def test_a_region_leaves_no_symmetry(folder):
    case = case_of(folder, CYLINDER, REGION)
    assert mirror_planes(case) == () and not case.body.is_round and case.body.half_plane() is None
    assert mirror_planes(case_of(folder, CYLINDER)) == ("x", "y")


def test_what_does_not_fit_is_named_with_its_place(folder):
    crossing = {"name": "b", "file": "touching.stl"}
    for body, regions, more, parts in (
        (BOX, [REGION | {"file": "upper.stl"}], {}, ["tumour must be inside the body", "reaches 12 mm out", "z = 12"]),
        (CAD, [REGION, REGION | crossing], {}, ["b must be", "from tumour, region[1]; they overlap at x = "]),
        (BOX, [REGION], {"layer": [SKIN | {"thickness": "9 mm"}]}, ["from the end of a layer, at z = -9 mm"]),
        (BOX, [REGION], {"inclusion": [INCLUSION | {"name": "a"}]}, ["from a, inclusion[1]; they overlap"]),
    ):
        said = refusal(raw(body=held(folder, body, *regions, **more), probe=PROBE, mesh=MESH))
        assert all(part in said for part in parts), said


def test_a_thin_sheet_is_told_in_the_study_and_in_its_dataset(folder):
    points, facets = sphere(12)
    write_stl(folder / "sheet.stl", AT + [10e-3, 9e-3, 0.8e-3] * points, facets)
    for file, told in (("sheet.stl", "tumour: is thin for its size"), ("tumour.stl", "")):
        checked = study(body=held(folder, BOX, REGION | {"file": file}), probe=PROBE, mesh=MESH)
        assert any("is thin" in str(warning) for warning in checked.warnings) is bool(told)
        dataset = build(make_plan(checked), {})
        assert told in str(dataset["body_message"].values) if told else "body_message" not in dataset


def test_edges_may_cross_where_no_corner_is_inside():
    needle = np.array([[-1, -1, 0.9], [1, -1, 0.9], [0, -1.1, 1.1], [0, 3, 1]])
    facets = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    one = Shell(Triangles(needle, facets))
    across, apart = (needle[:, [1, 0, 2]] + offset for offset in ([0, 0, 0.05], [0, 0, 3]))
    assert one.crossing(Triangles(across, facets[:, ::-1])) is not None
    assert one.crossing(Triangles(apart, facets[:, ::-1])) is None
