"""Regions of any shape in bodies of triangles: from surface files, and from labels of the body's image."""

import numpy as np
import pytest

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.describe import summary
from epsmesh.plan.key import case_key, mesh_key
from epsmesh.plan.plan import make_plan
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.triangles import Triangles
from tests.cases import raw, refusal, solve, study
from tests.mesh.test_regions import volumes
from tests.organs import AXES, ellipsoid, sphere, write_labels, write_stl

TISSUE = {"young": "50 kPa", "poisson": 0.45}
AT, SEMI_AXES = np.array([-20e-3, 3e-3, 14e-3]), np.array([10e-3, 8e-3, 6e-3])
PROBE = {"shape": "disc", "radius": "5 mm", "depth": "0.2 mm", "at": ["-20 mm", "0 mm"]}
MESH = {"epsilon": "full", "fine": "15 mm", "coarse": "60 mm", "rim": "1.2 mm", "growth": 0.8}
INCLUSION = TISSUE | {"name": "tumour", "at": ["-20 mm", "3 mm", "14 mm"], "axes": ["10 mm", "8 mm", "6 mm"]}
OF_FILE = TISSUE | {"name": "tumour", "file": "tumour.stl", "unit": "mm"}
OF_LABEL = TISSUE | {"name": "tumour", "label": 2}


def tumour(frequency=12):
    points, facets = sphere(frequency)
    return AT + SEMI_AXES * points, facets


def bent_tube(radius=5e-3, bend=22e-3):
    """Return a tube, closed at both ends, along a third of a circle."""
    along, around = np.linspace(0, 2 * np.pi / 3, 60), np.linspace(0, 2 * np.pi, 24, endpoint=False)
    s, t = (grid.ravel() for grid in np.meshgrid(along, around, indexing="ij"))
    out = bend + radius * np.cos(t)
    points = np.column_stack([out * np.cos(s), out * np.sin(s), radius * np.sin(t)])
    n, rows = len(around), np.arange(len(along) - 1)[:, None] * len(around)
    k, m = np.arange(n), (np.arange(n) + 1) % n
    quads = np.stack(np.broadcast_arrays(rows + k, rows + n + k, rows + n + m, rows + m), axis=-1).reshape(-1, 4)
    facets = [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    ends = bend * np.array([[1, 0, 0], [np.cos(along[-1]), np.sin(along[-1]), 0]])
    first, last = len(points), len(points) + 1
    facets += [np.column_stack([np.full(n, first), k, m])]
    facets += [np.column_stack([np.full(n, last), m + (len(along) - 1) * n, k + (len(along) - 1) * n])]
    facets = np.vstack(facets)
    points = np.vstack([points, ends]) - np.array([5e-3, 8e-3, 0])
    inward = np.einsum("ij,ij->", points[facets[:, 0]], np.cross(points[facets[:, 1]], points[facets[:, 2]])) < 0
    return points, facets[:, ::-1] if inward else facets


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("organ")
    write_stl(folder / "organ.stl", *ellipsoid(16))
    write_stl(folder / "tumour.stl", *tumour())
    write_stl(folder / "vessel.stl", *bent_tube())
    for name, voxel in (("coarse", 2e-3), ("fine", 1e-3)):
        write_labels(folder / f"{name}.nii.gz", voxel, [(np.zeros(3), AXES), (AT, SEMI_AXES)])
    write_labels(folder / "whole.nii.gz", 1e-3, [(np.zeros(3), AXES)])
    return folder


def body(folder, *regions, file="organ.stl", **given):
    own = {"shape": "surface", "unit": "mm"} if file.endswith("stl") else {"shape": "image", "label": 1}
    regions = [region | ({"file": str(folder / region["file"])} if "file" in region else {}) for region in regions]
    region = {"region": regions} if regions else {}
    return own | {"file": str(folder / file), "fixed": {"below": "-10 mm"}} | region | given


@pytest.mark.parametrize(("semi_axes", "expected"), [((10, 10, 10), 10), ((20, 20, 2), 2), ((20, 4, 4), 4)])
def test_half_of_the_thickness_of_a_ball_a_sheet_and_a_rod(semi_axes, expected):
    points, facets = sphere(16)
    noise = 0.02 * np.random.default_rng(3).normal(size=points.shape)
    shell = Shell(Triangles(1e-3 * (points * semi_axes + noise), facets.astype(np.int64)))
    _, half = shell.thin
    assert 1e3 * np.median(half) == pytest.approx(expected, rel=0.12)
    assert 0.5 * expected < 1e3 * shell.least <= expected


def test_distances_to_a_surface_of_triangles_are_those_to_the_true_one():
    points, facets = tumour(24)
    shell, true = Shell(Triangles(points, facets.astype(np.int64))), Ovoid(tuple(AT), tuple(SEMI_AXES))
    places = AT + 1.5 * np.random.default_rng(4).uniform(-1, 1, (500, 3)) * SEMI_AXES
    np.testing.assert_allclose(shell.distance(places), true.distance(places), atol=4e-5)
    assert shell.volume == pytest.approx(true.volume, rel=2e-3)


@pytest.mark.parametrize("which", ["file", "label"])
def test_a_region_has_its_cells_and_its_volume(folder, which):
    vessel = TISSUE | {"name": "vessel", "file": "vessel.stl", "unit": "mm"}
    held = {
        "file": body(folder, vessel, inclusion=[INCLUSION]),
        "label": body(folder, OF_LABEL, vessel, file="coarse.nii.gz"),
    }[which]
    asked = study(body=held, probe=PROBE, mesh=MESH)
    case = asked.case(())
    extent, told = summary(make_plan(asked))["notes"]
    assert extent.startswith("Body: x from ")
    mesh = mesh_arrays(case, ())
    found = volumes(mesh)
    for number, piece in enumerate(case.body.embedded, start=1):
        assert found[number] == pytest.approx(1e9 * piece.surface.volume, rel=0.01)
        assert f"{piece.name} {1e6 * piece.surface.volume:.3g} cm³" in told
        middle = mesh.points[mesh.cells[:, :4]].mean(axis=1)
        distance = piece.surface.distance(middle)
        clear = np.abs(distance) > 0.3e-3
        np.testing.assert_array_equal((mesh.regions == number)[clear], (distance < 0)[clear])
    assert sum(found.values()) == pytest.approx(1e9 * case.body.volume, rel=5e-3)


@pytest.mark.nightly
def test_an_ellipsoid_as_axes_as_surface_and_as_label_has_one_force(folder):
    """The body's surface is that of the same voxels."""
    found = []
    for held in (
        body(folder, file="whole.nii.gz", inclusion=[INCLUSION]),
        body(folder, OF_FILE, file="whole.nii.gz"),
        body(folder, OF_LABEL, file="fine.nii.gz"),
        body(folder, OF_LABEL, file="coarse.nii.gz"),
    ):
        (record,) = solve(body=held, probe=PROBE, mesh=MESH).values()
        assert record.status == "ok", record.message
        found.append(record)
    true, *others = found
    for other, most in zip(others, (0.009, 0.009, 0.015), strict=True):
        assert abs(other.force / true.force - 1) < most < true.force_error + other.force_error < 0.12


def test_the_key_of_a_region_is_its_shape_not_its_file(folder):
    (folder / "copy.stl").write_bytes((folder / "tumour.stl").read_bytes())
    changes = {}, {"file": "copy.stl"}, {"file": "vessel.stl"}, {"young": "1 kPa"}
    one, copy, tube, softer = (
        study(body=body(folder, OF_FILE | change), probe=PROBE, mesh=MESH).case(()) for change in changes
    )
    assert case_key(one) == case_key(copy) and mesh_key(one) == mesh_key(softer)
    assert mesh_key(one) != mesh_key(tube) and case_key(one) != case_key(softer)


def test_values_of_a_region_are_swept(folder):
    held = body(folder, OF_FILE | {"young": ["5 kPa", "50 kPa"], "file": "tumour.stl"})
    assert [axis.name for axis in study(body=held, probe=PROBE).axes] == ["tumour_young"]


def test_mistakes_are_named(folder):
    image = "fine.nii.gz"
    for held, parts in (
        (body(folder, TISSUE | {"name": "a"}), ["body.region[1]", "`file`", "`label`"]),
        (body(folder, {k: v for k, v in OF_FILE.items() if k != "unit"}), ["body.region[1].unit", 'unit = "mm"']),
        (body(folder, OF_LABEL), ["body.region[1].label = 2", "needs a body from an image"]),
        (body(folder, OF_LABEL | {"label": 7}, file=image), ["tumour, label 7: no voxel", "labels are 1, 2"]),
        (body(folder, OF_LABEL | {"label": 1}, file=image), ["body.region[1].label = 1", "label of the body"]),
        (body(folder, OF_LABEL | {"unit": "mm"}, file=image), ["body.region[1].unit", "is for `file`"]),
        (body(folder, OF_FILE | {"file": "none.stl"}), ["body.region[1].file", "cannot be read"]),
        (body(folder, OF_FILE | {"unit": "cm"}), ["body.region[1].file", "out of the body", "This is at x = "]),
        (body(folder, OF_FILE, OF_FILE | {"name": "b"}), ["body.region[2].file", "from tumour, region[1]", "overlap"]),
        ({"region": [OF_LABEL]}, ["body.region[1].label = 2", "needs a body from an image"]),
    ):  # fmt: skip
        said = refusal(raw(body=held, probe=PROBE, mesh=MESH))
        assert all(part in said for part in parts), said
