"""Bodies of triangles: frames of probes on them, their size, and their keys."""

import os
import shutil
from math import hypot, pi

import numpy as np
import pytest
import xarray as xr

from epsmesh.plan.key import case_key, mesh_key
from epsmesh.report.study import study_of
from epsmesh.shapes.bodies.surface import FromSurface
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.triangles import Triangles
from epsmesh.study.problems import StudyError
from tests.cases import study
from tests.organs import AXES, box, ellipsoid, sphere, write_stl


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scanned")
    write_stl(folder / "ellipsoid.stl", *ellipsoid(24))
    write_stl(folder / "box.stl", *box(40e-3, 40e-3, 20e-3))
    return folder


def case(path, **changes):
    return study(
        body={"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-10 mm"}} | changes
    ).case(())


@pytest.fixture(scope="module")
def a_body(folder) -> FromSurface:
    return case(folder / "ellipsoid.stl").body


def outward(point):
    normal = np.array(point) / AXES**2
    return normal / np.linalg.norm(normal)


def test_sizes_are_those_of_the_file(a_body):
    assert a_body.volume == pytest.approx(4 / 3 * pi * AXES.prod(), rel=5e-3)
    assert a_body.extent == pytest.approx(120e-3, rel=2e-3)
    assert a_body.heights == pytest.approx((-30e-3, 30e-3), rel=2e-3)


def test_curvature_of_a_ball_is_that_of_its_radius():
    points, facets = sphere(16)
    assert Triangles(3e-3 * points, facets).curvature == pytest.approx(8 * pi * 3e-3, rel=0.01)


@pytest.mark.parametrize("at", [(10e-3, -8e-3), (-20e-3, 5e-3), (30e-3, 20e-3)])
def test_two_coordinates_name_the_highest_point_and_its_normal(a_body, at):
    frame = a_body.frame(at)
    z = AXES[2] * (1 - (at[0] / AXES[0]) ** 2 - (at[1] / AXES[1]) ** 2) ** 0.5
    assert frame.point == pytest.approx((*at, z), abs=0.05e-3)
    assert frame.axis == frame.normal
    assert np.dot(frame.outward, outward((*at, z))) > 1 - 1e-4
    assert a_body.frame(at, (0.0, 0.0, -1.0)).axis == (0.0, 0.0, -1.0)


def test_three_coordinates_name_the_nearest_point(a_body):
    true = AXES * np.array([0.6, 0.0, -0.8])
    frame = a_body.frame(tuple(true + 5e-3 * outward(true)))
    np.testing.assert_allclose(frame.point, true, atol=0.1e-3)
    assert np.dot(frame.outward, outward(true)) > 1 - 1e-4


def test_lines_along_the_axis_enter_the_near_side(a_body):
    frame = a_body.frame((15e-3, 10e-3))
    local = 6e-3 * np.random.default_rng(1).uniform(-1, 1, (200, 2))
    points, normals = a_body.lift(frame, local)
    np.testing.assert_allclose(frame.local(points)[:, :2], local, atol=1e-15)
    assert np.abs(((points / AXES) ** 2).sum(axis=1) - 1).max() < 4e-3
    assert Skin(a_body.triangles).distance(points).max() < 1e-15
    expected = points / AXES**2
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert (normals * expected).sum(axis=1).min() > 0.997
    assert np.isnan(a_body.lift(frame, np.array([[0.2, 0.0]]))[0]).all()


def test_distances_hold_the_body(a_body):
    frame = a_body.frame((0.0, 0.0), (0.0, 0.0, -1.0))
    assert a_body.thickness(frame) == pytest.approx(60e-3, rel=2e-3)
    assert a_body.reach(frame) == pytest.approx(60e-3, rel=2e-3)
    assert a_body.farthest(frame) == pytest.approx(hypot(60e-3, 30e-3), rel=0.05)
    inside = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 25e-3), (0.0, 0.0, 40e-3)])
    assert a_body.inside(inside) == pytest.approx([30e-3, 5e-3, -10e-3], abs=0.1e-3)


def test_the_normal_is_not_one_facets(tmp_path):
    """Noise of a tenth of the facets' size turns facets by up to 20 degrees, their mean normal by less than one."""
    points, facets = sphere(30)
    noise = np.random.default_rng(2).normal(size=len(points))
    path = write_stl(tmp_path / "noisy.stl", 30e-3 * points * (1 + 3e-3 * noise[:, None]), facets)
    body = case(path).body
    frame = body.frame((5e-3, 5e-3), around=6e-3)
    assert np.dot(frame.outward, np.array(frame.point) / 30e-3) > 0.9998


def test_the_place_of_a_probe_is_that_of_what_it_covers(tmp_path):
    """A bump under a small footprint tilts it, under a large one it does not."""
    points, facets = sphere(40)
    away = np.linalg.norm(points - np.array([0.1, 0.0, 0.995]), axis=1)
    points = 30e-3 * points * (1 + 0.02 * np.exp(-((away / 0.08) ** 2)))[:, None]
    path = str(write_stl(tmp_path / "bump.stl", points, facets))
    body = {"shape": "surface", "file": path, "unit": "mm", "fixed": {"below": "-10 mm"}}
    tilts = []
    for radius in (1, 8):
        a_case = study(body=body, probe={"shape": "disc", "radius": f"{radius} mm", "depth": "0.1 mm"}).case(())
        frame = a_case.frame
        assert frame.normal == a_case.body.frame(a_case.probe.at, around=1e-3 * radius).normal
        tilts.append(np.hypot(*frame.normal[:2]))
    assert tilts[0] > 0.1 and tilts[1] < 0.05


def test_a_place_beside_the_body_is_refused(a_body):
    with pytest.raises(PlaceError, match="extends from"):
        a_body.frame((70e-3, 0.0))


def test_keys_are_those_of_the_content(folder, tmp_path):
    here = case(folder / "ellipsoid.stl")
    there = case(shutil.copy(folder / "ellipsoid.stl", tmp_path / "other name.stl"))
    assert case_key(here) == case_key(there) and mesh_key(here) == mesh_key(there)
    points, facets = ellipsoid(24)
    moved = case(write_stl(tmp_path / "moved.stl", points * 1.001, facets))
    assert case_key(moved) != case_key(here)
    assert case_key(case(folder / "ellipsoid.stl", fixed={"below": "-11 mm"})) != case_key(here)


TUMOUR = {"name": "tumour", "at": ["0 mm"] * 3, "radius": "3 mm", "young": "1 kPa", "poisson": 0.3}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fixed": "bottom"}, "below"),
        ({"file": "none.stl"}, "cannot be read"),
        ({"unit": "inch"}, "unit"),
        ({"unit": None}, "unit"),
        ({"inclusion": [TUMOUR | {"at": ["0 mm"] * 2 + ["26.9 mm"]}]}, r"0.3 mm .* 0.0\d+ mm below it.*tissue reaches"),
        ({"inclusion": [TUMOUR | {"at": ["0 mm"] * 2 + ["29 mm"]}]}, r"reaches 2(\.0\d*)? mm out of the body"),
        ({"inclusion": [TUMOUR | {"radius": "100 mm"}]}, r"reaches \d+\.?\d* mm out of the body"),
        ({"layer": [TUMOUR]}, r"body.layer"),
        ({"fixed": {"below": "-70 mm"}}, "inside the body"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(folder, changes, words):
    with pytest.raises(StudyError, match=words):
        case(folder / "ellipsoid.stl", **changes)


TEXT = (
    '[body]\nshape = "surface"\nfile = "ellipsoid.stl"\nunit = "mm"\nfixed = {below = "-10 mm"}\n'
    '[material]\nyoung = "1 kPa"\npoisson = 0.3\n[probe]\nshape = "disc"\nradius = "3 mm"\ndepth = "0.1 mm"\n'
    '[mesh]\naccuracy = "2 %"\n'
)


def test_a_file_that_changes_is_read_again_also_with_its_old_time_and_size(tmp_path):
    """Also for the study in a dataset."""
    points, facets = sphere(24)
    path, text = tmp_path / "body.stl", TEXT.replace("ellipsoid.stl", "body.stl")
    dataset = xr.Dataset(attrs={"study": text, "study_file": "s.toml", "study_folder": str(tmp_path)})
    extents = []
    for radius in (30e-3, 33e-3):
        write_stl(path, radius * points, facets)
        os.utime(path, (0, 0))
        extents.append([case(path).body.extent, study_of(dataset).case(()).body.extent])
    assert extents[1] == pytest.approx([1.1 * extent for extent in extents[0]], rel=1e-3)
