"""Meshes of bodies of triangles: true to the file, whether it is finer or coarser than the elements."""

import subprocess
import sys
from dataclasses import replace
from math import inf, pi, radians

import numpy as np
import pytest
from basix import CellType, make_quadrature

from epsmesh.mesh.curve import EDGES, curve
from epsmesh.mesh.generate import MeshError, flat_cells
from epsmesh.mesh.of_case import mesh_arrays, sizes_of
from epsmesh.mesh.organ import make
from epsmesh.mesh.organ.base import far_surface
from epsmesh.mesh.organ.contact import set_in
from epsmesh.mesh.organ.make import mesh_organ, mesh_scanned
from epsmesh.mesh.organ.remesh import _closed
from epsmesh.mesh.organ.sheet import FREE, PROBE, Sheet, TangledError, edges_of
from epsmesh.mesh.organ.untangle import bad_facets, untangled
from epsmesh.mesh.size import Sizes
from epsmesh.plan.plan import make_plan
from epsmesh.scene.model import Scene
from epsmesh.shapes.bodies.surface import FromSurface
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.surface import Surface
from epsmesh.study.read import parse
from tests.cases import raw, study
from tests.folded import study_of
from tests.mesh.test_mesh import area, volume
from tests.organs import AXES, box, ellipsoid, sphere, write_stl
from tests.sampling import sampled

BELOW = -10e-3
_NO_EDGES = np.zeros((0, 2), dtype=np.int64)
SIZES = Sizes(epsilon=inf, fine=15e-3, coarse=60e-3, rim=0.4e-3, growth=0.5, column=30e-3)


def surface(path, **changes) -> FromSurface:
    return study(
        body={"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-10 mm"}} | changes,
        probe={"at": ["5 mm", "3 mm"], "radius": "4 mm"},
    ).case(()).body  # fmt: skip


class Placed(Scene):
    """A scene with an upright probe at (5, 3) mm."""

    @property
    def frame(self) -> Frame:
        return self.body.frame((5e-3, 3e-3), (0.0, 0.0, -1.0))


def probe():
    return study(probe={"radius": "4 mm"}).case(()).probe


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return write_stl(tmp_path_factory.mktemp("organ") / "ellipsoid.stl", *ellipsoid())


def scene(path, sizes=SIZES, **changes) -> Placed:
    return Placed(surface(path, **changes), probe(), rim_segments=sizes.rim_segments(probe()))


@pytest.fixture(scope="module")
def meshed(file):
    a_scene = scene(file)
    return a_scene, mesh_organ(a_scene, SIZES, far_surface(a_scene.body))


def qualities(mesh):
    corners = mesh.points[mesh.cells[:, :4]]
    edges = [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i in range(4) for j in range(i)]
    double = np.linalg.det(corners[:, 1:] - corners[:, :1])
    return double * 2**0.5 / (np.square(edges).sum(axis=0) / 6) ** 1.5


def on_border(mesh):
    found = np.zeros(len(mesh.points), dtype=bool)
    found[np.concatenate([facets.ravel() for facets in mesh.facets.values()])] = True
    return found


@pytest.mark.nightly
def test_same_file_same_mesh_in_another_process(file):
    code = (
        "import sys, hashlib; from tests.mesh.test_organ import *; s = scene(sys.argv[1]);"
        "m = curve(mesh_organ(s, SIZES, far_surface(s.body)), s);"
        "print(hashlib.sha256(m.points.tobytes() + m.cells.tobytes()).hexdigest())"
    )
    command = [sys.executable, "-c", code, str(file)]
    outputs = {subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in "ab"}
    assert len(outputs) == 1


def test_groups_cover_the_surface(meshed):
    a_scene, mesh = meshed
    corners = mesh.cells
    faces = np.sort(np.concatenate([np.delete(corners, i, axis=1) for i in range(4)]), axis=1)
    _, counts = np.unique(faces, axis=0, return_counts=True)
    assert (counts == 1).sum() == sum(map(len, mesh.facets.values()))
    assert volume(mesh) == pytest.approx(a_scene.body.volume, rel=0.01)
    assert sum(area(mesh, group) for group in mesh.facets) == pytest.approx(a_scene.body.triangles.area, rel=0.01)
    held = mesh.points[np.unique(mesh.facets["fixed"])][:, 2]
    free = mesh.points[np.unique(mesh.facets["free"])][:, 2]
    assert held.max() < BELOW + 1e-9 and free.min() > BELOW - 1e-9
    assert qualities(mesh).min() > 0.1


def test_the_footprint_is_what_projects_into_the_disc(meshed):
    a_scene, mesh = meshed
    curved = curve(mesh, a_scene)
    local = a_scene.frame.local(curved.points)
    rim = np.hypot(*local[mesh.rim, :2].T)
    np.testing.assert_allclose(rim, 4e-3, rtol=1e-12)
    ends, middle = curved.cells[:, :4][:, EDGES].reshape(-1, 2), curved.cells[:, 4:].ravel()
    along = middle[np.isin(ends, mesh.rim).all(axis=1)]
    on_edge = np.abs(np.hypot(*local[along, :2].T) - 4e-3) < 1e-12
    assert len(np.unique(along[on_edge])) == len(mesh.rim)
    skin = a_scene.body.surfaces()["skin"][0]
    assert skin.distance(curved.points[along[on_edge]]).max() < 1e-12
    inner = np.unique(mesh.facets["probe"])
    assert np.hypot(*local[inner, :2].T).max() < 4e-3 * (1 + 1e-12)
    assert skin.distance(mesh.points[inner]).max() < 1e-12
    projected = mesh.points[mesh.facets["probe"]][:, :, :2]
    double = np.linalg.det(projected[:, 1:] - projected[:, :1])
    assert np.abs(double.sum() / 2) == pytest.approx(pi * 16e-6, rel=0.01)


def test_elements_are_as_asked_however_the_file_is(tmp_path, meshed):
    """Files of 1,280, 5,120 and 46,080 facets give similar meshes."""
    counts = []
    for frequency in (8, 48):
        path = write_stl(tmp_path / f"{frequency}.stl", *ellipsoid(frequency))
        a_scene = scene(path)
        counts.append(len(mesh_organ(a_scene, SIZES, far_surface(a_scene.body)).cells))
    assert counts == pytest.approx([len(meshed[1].cells)] * 2, rel=0.15)


class Ellipsoid(Surface):
    """The true ellipsoid."""

    is_curved = True

    def distance(self, points):
        return np.linalg.norm(self.project(points) - points, axis=1)

    def project(self, points):
        square, t = AXES**2, np.zeros(len(points))
        for _ in range(60):
            value = ((AXES * points / (square + t[:, None])) ** 2).sum(axis=1) - 1
            slope = -2 * (square * points**2 / (square + t[:, None]) ** 3).sum(axis=1)
            t = np.maximum(t - value / slope, -0.9 * square.min())
        return square * points / (square + t[:, None])


def test_points_are_on_the_file_not_on_what_was_remeshed(meshed):
    """An ellipsoid's facets are within half a millimetre of it, and elements of 15 mm would be far from both."""
    a_scene, mesh = meshed
    outer = mesh.points[np.unique(np.concatenate([*mesh.facets.values()]))]
    assert a_scene.body.surfaces()["skin"][0].distance(outer).max() < 1e-9
    assert Ellipsoid().distance(outer).max() < 0.2e-3


def test_what_is_sharp_stays_sharp(tmp_path):
    path = write_stl(tmp_path / "box.stl", *box(40e-3, 40e-3, 20e-3))
    a_scene = scene(path)
    mesh = mesh_organ(a_scene, SIZES, far_surface(a_scene.body))
    assert volume(mesh) == pytest.approx(32e-6, rel=1e-9)
    assert area(mesh, "fixed") == pytest.approx(1600e-6 + 4 * 400e-6, rel=1e-9)


def test_a_blade_has_straight_edges_in_its_own_plane(file):
    """Each edge has several elements."""
    blade = study(probe={"shape": "blade", "length": "8 mm", "width": "2 mm", "depth": "0.1 mm"}).case(()).probe
    a_scene = Placed(surface(file), blade, rim_segments=0)
    mesh = mesh_organ(a_scene, SIZES, far_surface(a_scene.body))
    x, y, _ = a_scene.frame.local(mesh.points[mesh.rim]).T
    np.testing.assert_allclose(np.maximum(np.abs(x) / 4e-3, np.abs(y) / 1e-3), 1.0, atol=1e-9)
    assert len(mesh.rim) >= 20e-3 / SIZES.rim
    assert qualities(mesh).min() > 0.02


def test_a_footprint_over_the_edge_is_refused(file):
    a_scene = scene(file)

    class Aside(Scene):
        frame = a_scene.body.frame((57e-3, 0.0), (0.0, 0.0, -1.0))

    aside = Aside(a_scene.body, probe(), rim_segments=a_scene.rim_segments)
    with pytest.raises(MeshError, match="no connected tissue below it"):
        mesh_organ(aside, SIZES, far_surface(a_scene.body))


def test_a_column_is_refused(file):
    a_scene = replace(scene(file), column=10e-3)
    with pytest.raises(MeshError, match="no column"):
        mesh_organ(a_scene, SIZES, far_surface(a_scene.body))


def test_specks_and_needles_of_the_file_do_not_matter(tmp_path):
    """Marching cubes leaves edges of micrometres, whose facets have arbitrary normals."""
    points, facets = ellipsoid(24)
    taken = np.zeros(len(points), dtype=bool)
    for one, other, _ in facets[::40]:
        if not taken[facets[(facets == one).any(axis=1)]].any():
            points[one] += 0.999 * (points[other] - points[one])
            taken[facets[(facets == one).any(axis=1)]] = True
    a_scene = scene(write_stl(tmp_path / "specks.stl", points, facets))
    mesh = mesh_organ(a_scene, SIZES, far_surface(a_scene.body))
    assert taken.sum() > 100
    assert volume(mesh) == pytest.approx(a_scene.body.volume, rel=0.01)
    assert qualities(mesh).min() > 0.02


def test_a_surface_that_is_not_the_files_is_never_filled(file, monkeypatch):
    """A surface that is too small, drawn out at a point, or open must fail with a message."""
    a_scene = scene(file)
    far = far_surface(a_scene.body)
    to_sizes = make._to_sizes

    def shrunk(*given):
        sheet = to_sizes(*given)
        return replace(sheet, points=0.98 * sheet.points)

    monkeypatch.setattr(make, "_to_sizes", shrunk)
    with pytest.raises(MeshError, match=r"0\.06\d times the body's volume too little"):
        mesh_organ(a_scene, SIZES, far)

    def drawn_out(*given):
        sheet = to_sizes(*given)
        points = sheet.points.copy()
        points[np.argmin(points[:, 2])] *= 1.2
        return replace(sheet, points=points)

    monkeypatch.setattr(make, "_to_sizes", drawn_out)
    with pytest.raises(TangledError, match=r"deviates from the file's by \d"):
        mesh_organ(a_scene, SIZES, far)
    opened = replace(far.sheet, facets=far.sheet.facets[1:], group=far.sheet.group[1:])
    monkeypatch.setattr(make, "_to_sizes", lambda *given: opened)
    with pytest.raises(MeshError, match="not closed"):
        mesh_organ(a_scene, SIZES, far)


@pytest.mark.parametrize("frequency", [20, 24])
def test_a_thin_brim_is_meshed_whatever_the_elements_of_the_ball_are(tmp_path, frequency):
    """A ball with a brim: elements as large as the ball allows would cross in the brim, or be flat."""
    directions, facets = sphere(frequency)
    brim = ((directions / np.array([60e-3, 60e-3, 4e-3])) ** 2).sum(axis=1) ** -0.5
    points = directions * ((35e-3**12 + brim**12) ** (1 / 12))[:, None]
    a_scene = scene(write_stl(tmp_path / "brim.stl", points, facets))
    sizes = replace(SIZES, fine=60e-3, column=a_scene.body.bend)
    mesh = mesh_scanned(a_scene, a_scene.body, sizes)
    assert volume(mesh) == pytest.approx(a_scene.body.volume, rel=0.02)  # by chords
    assert qualities(mesh).min() > 0.05
    (skin,) = a_scene.body.surfaces()["skin"]
    assert skin.distance(mesh.points).max(initial=0.0, where=on_border(mesh)) < mesh.deviation + 1e-9


@pytest.mark.parametrize("growth", [0.3, 0.6])
def test_curved_edges_restore_what_chords_leave_out(file, growth):
    """The faster sizes grow, the fewer facets follow the surface; the body's volume is that of the file."""
    a_scene, sizes = scene(file), replace(SIZES, growth=growth)
    straight = mesh_scanned(a_scene, a_scene.body, sizes)
    curved = curve(straight, a_scene)
    points, weights = make_quadrature(CellType.tetrahedron, 4)
    weight = np.column_stack([1 - points.sum(axis=1), points])
    slope, corners = np.vstack([-np.ones(3), np.eye(3)]), curved.points[curved.cells]
    filled = 0.0
    for w, factor in zip(weight, weights, strict=True):
        at_edges = [4 * (w[i] * slope[j] + w[j] * slope[i]) for i, j in EDGES]
        gradients = np.vstack([(4 * w - 1)[:, None] * slope, at_edges])
        filled += factor * np.linalg.det(np.einsum("nka,kb->nab", corners, gradients)).sum()
    assert filled == pytest.approx(a_scene.body.volume, rel=1e-3)
    assert volume(straight) < (1 - 3e-3) * a_scene.body.volume


@sampled("seed", [7, 8], by_day=1)
def test_a_folded_surface_is_meshed(tmp_path, seed):
    """Large elements cross in its folds: points are moved apart, or the file's own facets are kept."""
    case = make_plan(study_of(tmp_path, seed)).solves[0].case
    mesh = mesh_arrays(case, ())
    outside = np.unique(np.concatenate([*mesh.facets.values()]))
    off = case.body.surfaces()["skin"][0].distance(mesh.points[np.intersect1d(outside, mesh.cells[:, :4])])
    assert volume(mesh) == pytest.approx(case.body.volume, rel=0.03)
    assert not flat_cells(mesh.points, mesh.cells[:, :4]).any()
    assert np.quantile(qualities(mesh), 0.01) > 0.1
    assert np.quantile(off, 0.9) < 1e-9
    assert mesh.deviation == pytest.approx(off.max())


@pytest.mark.parametrize(
    "tool", [{"shape": "sphere", "radius": "8 mm"}, {"shape": "cone", "angle": "75 deg", "radius": "9 mm"}], ids=str
)
def test_elements_are_small_where_found_contact_is_expected_to_end(file, tool):
    """And not at the edge of all that the tool may touch."""
    body = {"shape": "surface", "file": str(file), "unit": "mm", "fixed": {"below": "-10 mm"}}
    ball = tool | {"depth": "0.5 mm", "at": ["5 mm", "3 mm"], "contact": "unilateral"}
    case = make_plan(parse({**raw(body=body, probe=ball), "mesh": {"accuracy": "2 %"}})).solves[0].case
    mesh = mesh_arrays(case, ())
    corners = case.frame.local(mesh.points)[mesh.facets["probe"]]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    radius = np.hypot(*corners.mean(axis=1)[:, :2].T)
    at_end = np.abs(radius / np.mean(case.probe.edge_band) - 1) < 0.2
    at_edge = radius > 0.8 * case.probe.footprint.half_width
    assert size[at_end].mean() < 1.6 * case.mesh.rim
    assert size[at_edge].mean() > 1.5 * size[at_end].mean()


def test_a_footprint_next_to_a_fold_is_set_in_with_a_narrower_collar(tmp_path):
    """The surface is folded at a quarter of the radius from the disc; the disc itself fits."""
    case = make_plan(study_of(tmp_path, 402)).solves[0].case

    def lift(places):
        return case.body.lift(case.frame, places)[0]

    far = far_surface(case.body)
    contact = set_in(far.sheet, far.faces, case.frame, case.probe, sizes_of(case), lift)
    edges_of(contact.sheet.facets)
    rim = case.frame.local(contact.sheet.points[contact.rim])
    np.testing.assert_allclose(np.hypot(*rim[:, :2].T), 1.5e-3, rtol=1e-9)


def test_a_tangle_without_a_repair_is_reported_with_its_place(file, monkeypatch):
    """Two surfaces that intersect cannot be separated."""
    points, facets = sphere(6)
    both = np.vstack([points, points + np.array([1.0, 0, 0])])
    sheet = Sheet(both, np.vstack([facets, facets + len(points)]), np.full(2 * len(facets), FREE), _NO_EDGES)
    with pytest.raises(TangledError, match=r"crosses itself at \(") as told:
        untangled(sheet, np.arange(len(both)))
    assert np.abs(np.linalg.norm(told.value.places - [0.5, 0, 0], axis=1) - 0.75**0.5).max() < 0.4


def test_facets_folded_upon_each_other_are_opened():
    """A point of a ball is moved over its neighbours; the footprint's edge must not move."""
    points, facets = sphere(12)
    a, b, c = facets[np.argmax((facets != 0).all(axis=1) & (points[facets][..., 2] < 0).all(axis=1))]
    points = points.copy()
    points[a] += 1.9 * (points[[b, c]].mean(axis=0) - points[a])
    group = np.where((points[facets][..., 2] > 0.5).all(axis=1), PROBE, FREE)
    sheet = Sheet(points, facets, group, _NO_EDGES)
    rim = np.unique(sheet.border(PROBE))
    opened = untangled(sheet, rim)
    assert sharpest(sheet) < radians(10)
    assert sharpest(opened) > radians(10)
    np.testing.assert_array_equal(opened.points[rim], points[rim])
    assert (opened.points != points).any(axis=1).sum() < 10
    assert bad_facets(sheet).any() and not bad_facets(opened).any()


def test_a_facet_without_height_is_opened():
    """A corner of a ball's facet is on the opposite edge: no neighbours are folded, but tetrahedra would fail."""
    points, facets = sphere(12)
    a, b, c = facets[np.argmax((points[facets][..., 2] < 0).all(axis=1))]
    points = points.copy()
    points[a] = points[[b, c]].mean(axis=0)
    sheet = Sheet(points, facets, np.full(len(facets), FREE), _NO_EDGES)
    opened = untangled(sheet, np.empty(0, np.int64))
    assert sheet.heights.min() < 1e-12 and opened.heights.min() > 0.1
    assert bad_facets(sheet).any() and not bad_facets(opened).any()


def test_fins_and_holes_of_the_remesher_are_repaired():
    """A facet connected by one edge is removed, and so is the one behind it; a missing facet is restored."""
    points, facets = sphere(6)
    a, b, _ = facets[0]
    count = len(points)
    fins = [(a, b, count), (b, count + 1, count)]
    broken = Sheet(
        np.vstack([points, 1.2 * points[[a, b]]]),
        np.vstack([facets[:50], facets[51:], fins]),
        np.full(len(facets) + 1, FREE),
        _NO_EDGES,
    )
    with pytest.raises(MeshError, match="not closed"):
        edges_of(broken.facets)
    mended = _closed(broken)
    edges_of(mended.facets)
    assert len(mended.facets) == len(facets) and len(mended.points) == len(points)
    assert mended.volume == pytest.approx(Sheet(points, facets, np.full(len(facets), FREE), _NO_EDGES).volume)


def sharpest(sheet):
    """Return the smallest angle between neighbouring facets, 0 if they overlap."""
    sides = sheet.normals[edges_of(sheet.facets)[1]]
    return pi - np.arccos(np.clip((sides[:, 0] * sides[:, 1]).sum(axis=1), -1, 1)).max()
