"""Valid files in all variants of the formats give the same body."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.files.read import read_surface, space_of
from tests.shapes.files.solids import Surface, ball, obj, ply, stl, stl_text

BALL = ball()
VOLUME = 1e-9 * abs(
    float(np.einsum("ij,ij", BALL[0][BALL[1][:, 0]], np.cross(BALL[0][BALL[1][:, 1]], BALL[0][BALL[1][:, 2]])))
) / 6  # fmt: skip


def _quads() -> Surface:
    """A box of 4 × 3 × 2 squares of 10 mm."""
    sides = []
    for axis, size in enumerate((4, 3, 2)):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        i, j = (k.ravel() for k in np.meshgrid(*(np.arange((4, 3, 2)[k]) for k in (u, v)), indexing="ij"))
        for level, steps in ((0, ((0, 0), (0, 1), (1, 1), (1, 0))), (size, ((0, 0), (1, 0), (1, 1), (0, 1)))):
            corners = np.zeros((len(i), 4, 3))
            for k, (du, dv) in enumerate(steps):
                corners[:, k, axis], corners[:, k, u], corners[:, k, v] = level, i + du, j + dv
            sides.append(corners)
    points, number = np.unique(np.concatenate(sides).reshape(-1, 3), axis=0, return_inverse=True)
    return 10.0 * points, number.reshape(-1, 4)


def _backwards(text: bytes, points: int) -> bytes:
    """The facets of an OBJ file with negative numbers, which count from the last point."""
    lines = text.splitlines()
    turned = [
        b"f " + b" ".join(b"%d" % (int(k) - points - 1) for k in line.split()[1:]) for line in lines if line[:1] == b"f"
    ]
    return b"\n".join([line for line in lines if line[:1] != b"f"] + turned)


WRITTEN: dict[str, Callable[[], bytes]] = {
    "binary.stl": lambda: stl(BALL),
    "solid.stl": lambda: b"solid" + stl(BALL)[5:],
    "text.stl": lambda: stl_text(BALL),
    "capitals.STL": lambda: stl_text(BALL, "Facet normal of a LIVER 3").upper(),
    "windows.stl": lambda: stl_text(BALL).replace(b"\n", b"\r\n"),
    "little.ply": lambda: ply(BALL),
    "big.ply": lambda: ply(BALL, "binary_big_endian"),
    "text.ply": lambda: ply(BALL, "ascii"),
    "quality.ply": lambda: ply(BALL, extra="quality"),
    "plain.obj": lambda: obj(BALL),
    "textures.obj": lambda: obj(BALL, "{0}/{0}"),
    "normals.obj": lambda: obj(BALL, "{0}//{0}"),
    "backwards.obj": lambda: _backwards(obj(BALL), len(BALL[0])),
    "colours.obj": lambda: obj((np.column_stack([BALL[0]]), BALL[1])).replace(b"\nf", b"\n  # points were these\nf", 1),
}


def _load(folder: Path, name: str, data: bytes) -> Loaded:
    (folder / name).write_bytes(data)
    return read_surface(folder / name, 1e-3)


@pytest.mark.parametrize("name", WRITTEN)
def test_the_same_body_however_it_is_written(name: str, tmp_path: Path):
    loaded = _load(tmp_path, name, WRITTEN[name]())
    assert loaded.notices == ()
    assert loaded.triangles.points.shape == (642, 3)
    assert loaded.triangles.facets.shape == (1280, 3)
    assert loaded.triangles.volume == pytest.approx(VOLUME, rel=1e-6)
    assert np.allclose(loaded.triangles.bounds, np.array([(-40, -30, -20), (40, 30, 20)]) * 1e-3, rtol=1e-6)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_polygons_are_cut_into_triangles(form: str, tmp_path: Path):
    loaded = _load(tmp_path, "box.ply", ply(_quads(), form))
    assert loaded.triangles.volume == pytest.approx(24e-6)
    assert loaded.triangles.area == pytest.approx(52e-4)


def test_triangles_and_polygons_mixed(tmp_path: Path):
    """A prism: two triangles, and three sides of five corners each, the last of which fold inwards from one corner."""
    text = (
        b"v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 9\nv 10 0 9\nv 0 10 9\nf 1 3 2\nf 4 5 6\nf 1 2 5 4\nf 2 3 6 5\nf 3 1 4 6\n"
    )
    assert _load(tmp_path, "prism.obj", text).triangles.volume == pytest.approx(0.45e-6)
    body = (
        ply((np.zeros((0, 3)), np.zeros((0, 3), int)), "ascii")
        .replace(b"vertex 0", b"vertex 6")
        .replace(b"face 0", b"face 5")
    )
    rows = b"0 0 0\n10 0 0\n0 10 0\n0 0 9\n10 0 9\n0 10 9\n3 0 2 1\n3 3 4 5\n4 0 1 4 3\n4 1 2 5 4\n4 2 0 3 5\n"
    assert _load(tmp_path, "prism.ply", body + rows).triangles.volume == pytest.approx(0.45e-6)


def test_concave_facets_are_cut_within_themselves(tmp_path: Path):
    arrow: FloatArray = np.array([(0, 0), (20, 10), (0, 20), (5, 10)], dtype=float)
    points = [(x, y, z) for z in (0.0, 10.0) for x, y in arrow]
    lines = [f"v {x} {y} {z}" for x, y, z in points] + ["f 4 3 2 1", "f 5 6 7 8"]
    lines += [f"f {a} {b} {b + 4} {a + 4}" for a, b in ((1, 2), (2, 3), (3, 4), (4, 1))]
    assert _load(tmp_path, "arrow.obj", "\n".join(lines).encode()).triangles.volume == pytest.approx(1.5e-6)


def test_an_inverted_surface_is_turned_and_told(tmp_path: Path):
    loaded = _load(tmp_path, "inverted.stl", stl((BALL[0], BALL[1][:, ::-1])))
    assert loaded.triangles.volume == pytest.approx(VOLUME, rel=1e-6)
    assert any("inverted" in notice for notice in loaded.notices)


def test_copies_of_facets_and_facets_in_a_point_are_left_out_and_told(tmp_path: Path):
    points, facets = BALL
    loaded = _load(tmp_path, "copies.ply", ply((points, np.concatenate([facets, facets[:4], facets[:2, [0, 0, 1]]]))))
    assert loaded.triangles.volume == pytest.approx(VOLUME, rel=1e-6)
    assert any("4 duplicate facets" in notice for notice in loaded.notices)
    assert any("2 facets with two corners in one point" in notice for notice in loaded.notices)


def test_corners_that_differ_by_rounding_are_welded_and_told(tmp_path: Path):
    points, facets = BALL
    corners = points[facets].reshape(-1, 3)
    corners = corners + 1e-5 * np.random.default_rng(0).standard_normal(corners.shape)
    loaded = _load(tmp_path, "soup.ply", ply((corners, np.arange(len(corners)).reshape(-1, 3))))
    assert loaded.triangles.points.shape == (642, 3)
    assert any("joined to their neighbours" in notice for notice in loaded.notices)


def test_a_point_on_an_edge_costs_a_facet_without_area_which_is_turned_and_told(tmp_path: Path):
    """Half of one edge belongs to a facet without area, as drawing programs write it."""
    points, facets = ball(2)
    a, b, c = facets[0]
    middle = len(points)
    points = np.concatenate([points, [(points[a] + points[b]) / 2]])
    facets = np.concatenate([facets[1:], [(a, middle, c), (middle, b, c), (a, b, middle)]])
    loaded = _load(tmp_path, "flat.obj", obj((points, facets)))
    assert any("without area flipped" in notice for notice in loaded.notices)


def test_points_without_facets_and_bytes_after_the_last_one_do_no_harm(tmp_path: Path):
    loaded = _load(tmp_path, "loose.ply", ply((np.concatenate([[(500, 0, 0)], BALL[0]]), BALL[1] + 1)))
    assert loaded.triangles.points.shape == (642, 3)
    assert loaded.triangles.extent == pytest.approx(0.08)
    assert any("are ignored" in notice for notice in _load(tmp_path, "longer.stl", stl(BALL) + b"abc").notices)


def test_the_hash_is_that_of_the_body_and_arrays_cannot_be_written_to(tmp_path: Path):
    one, other = (_load(tmp_path, name, WRITTEN[name]()).triangles for name in ("binary.stl", "solid.stl"))
    assert one.hash == other.hash
    with pytest.raises(ValueError, match="read-only"):
        one.points[0] = 0


def test_a_ring_is_one_piece_of_tissue(tmp_path: Path):
    angle = 2 * np.pi * np.arange(24) / 24
    ring = 30 + 8 * np.cos(angle)[None, :]
    points = np.stack(
        [ring * np.cos(angle)[:, None], ring * np.sin(angle)[:, None], np.broadcast_to(8 * np.sin(angle), (24, 24))],
        axis=2,
    )
    i, j = (k.ravel() for k in np.meshgrid(np.arange(24), np.arange(24), indexing="ij"))
    a, b, c, d = i * 24 + j, (i + 1) % 24 * 24 + j, (i + 1) % 24 * 24 + (j + 1) % 24, i * 24 + (j + 1) % 24
    facets = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    loaded = _load(tmp_path, "ring.stl", stl((points.reshape(-1, 3), facets)))
    assert loaded.triangles.volume == pytest.approx(2 * np.pi**2 * 30 * 64e-9, rel=0.03)


@pytest.mark.parametrize("space", ["LPS", "RAS", ""])
@pytest.mark.parametrize("name", ["a.stl", "text.stl", "a.ply", "a.obj"])
def test_a_surface_in_lps_is_converted_to_the_frame_of_images(name: str, space: str, tmp_path: Path):
    """3D Slicer writes the frame into the header of an STL file, and into comments of others."""
    shift = np.array([40.0, 20.0, 10.0])
    moved = BALL[0] + shift, BALL[1]
    note = f"3D Slicer output. SPACE={space}".encode() if space else b"ball"
    data = {
        "a.stl": lambda: note.ljust(80, b"\0") + stl(moved)[80:],
        "text.stl": lambda: b"solid " + note + b"\n" + stl_text(moved).partition(b"\n")[2],
        "a.ply": lambda: ply(moved).replace(b"\nelement", b"\ncomment " + note + b"\nelement", 1),
        "a.obj": lambda: b"# " + note + b"\n" + obj(moved),
    }[name]()
    (tmp_path / name).write_bytes(data)
    found = read_surface(tmp_path / name, 1e-3)
    middle = np.mean(found.triangles.bounds, axis=0)
    expected = np.mean([BALL[0].min(axis=0), BALL[0].max(axis=0)], axis=0) + shift
    np.testing.assert_allclose(middle, 1e-3 * expected * ((-1, -1, 1) if space == "LPS" else 1), atol=1e-6)
    assert found.triangles.volume == pytest.approx(VOLUME, rel=1e-5)
    assert any("SPACE=LPS" in notice for notice in found.notices) == (space == "LPS")
    assert space_of(tmp_path / name) == space
