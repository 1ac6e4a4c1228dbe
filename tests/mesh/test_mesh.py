"""Meshes: reproducible bit for bit, true to the geometry, with the required sizes."""

import subprocess
import sys
from dataclasses import replace
from itertools import product
from math import inf, pi

import gmsh
import numpy as np
import pytest

from epsmesh.compat import gmsh_session
from epsmesh.mesh.curve import EDGES, curve
from epsmesh.mesh.generate import MeshArrays, MeshError, generate
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.mesh.reflect import reflect
from epsmesh.mesh.size import Sizes
from epsmesh.scene.model import Scene
from tests.cases import BLADE, NO_SIZES, solve, study
from tests.sampling import sampled

SIZES = Sizes(epsilon=8e-3, fine=2e-3, coarse=8e-3, rim=0.4e-3, growth=0.5)

BALL = {"name": "ball", "at": ["0 mm", "0 mm", "-9 mm"], "radius": "3 mm", "young": "1 kPa", "poisson": 0.3}


def scene(column: float = inf, held: bool = False, straight: bool = False, **changes) -> Scene:
    case = study(**changes).case(())
    return Scene(case.body, case.probe, column, held, SIZES.rim_segments(case.probe), straight)


def volume(mesh: MeshArrays) -> float:
    corners = mesh.points[mesh.cells[:, :4]]
    return float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6)


def area(mesh: MeshArrays, group: str) -> float:
    corners = mesh.points[mesh.facets[group]]
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    )


def test_same_input_same_mesh_in_this_process_and_in_another():
    code = (
        "from tests.mesh.test_mesh import *; import hashlib; m = curve(generate(scene(), SIZES), scene());"
        "print(hashlib.sha256(m.points.tobytes() + m.cells.tobytes()).hexdigest())"
    )
    outputs = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout for _ in "ab"
    }
    here = [curve(generate(scene(), SIZES), scene()) for _ in "ab"]
    assert len(outputs) == 1
    assert np.array_equal(here[0].points, here[1].points)
    assert np.array_equal(here[0].cells, here[1].cells)


@sampled(
    "changes",
    [
        {}, {"column": 6e-3}, {"straight": True}, {"probe": BLADE},
        {"body": {"shape": "ellipsoid", "axes": ["15 mm", "14 mm", "12 mm"], "fixed": {"below": "-2 mm"}}},
        {"body": {"inclusion": [BALL]}},
    ],
    by_day=3,
)  # fmt: skip
def test_a_reused_model_gives_the_same_mesh_as_a_new_one(changes):
    """Whatever was meshed on it before, bit for bit."""
    sizes = [SIZES, replace(SIZES, rim=0.7e-3), replace(SIZES, fine=4e-3, epsilon=inf)]
    found = [generate(scene(**changes), sizes[number]) for number in (0, 1, 2, 0)]
    for number, mesh in zip((0, 1, 2, 0), found, strict=True):
        with gmsh_session():
            pass  # nothing is kept now
        alone = generate(scene(**changes), sizes[number])
        assert np.array_equal(alone.points, mesh.points)
        assert np.array_equal(alone.cells, mesh.cells)
        assert np.array_equal(alone.rim, mesh.rim)
        assert all(np.array_equal(alone.facets[name], mesh.facets[name]) for name in alone.facets | mesh.facets)


@pytest.mark.parametrize("probe", [None, BLADE | {"direction": [1.0, 2.0, 0.0], "at": ["3 mm", "-2 mm"]}])
@pytest.mark.parametrize("body", ["box", "cylinder"])
def test_groups_cover_the_surface(body, probe):
    shapes = {
        "box": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom+sides"},
        "cylinder": {"shape": "cylinder", "radius": "25 mm", "height": "20 mm", "fixed": {"below": "-12 mm"}},
    }
    changes = {"body": shapes[body]} | ({"probe": probe} if probe else {})
    mesh = generate(scene(straight=True, **changes), SIZES)
    footprint = 30e-6 if probe else pi * 9e-6
    held = {"box": 40e-3**2 + 4 * 40e-3 * 20e-3, "cylinder": pi * 25e-3**2 + 2 * pi * 25e-3 * 8e-3}[body]
    top = 40e-3**2 if body == "box" else pi * 25e-3**2
    rest = top - footprint + (0 if body == "box" else 2 * pi * 25e-3 * 12e-3)
    assert area(mesh, "probe") == pytest.approx(footprint, rel=1e-9)
    assert area(mesh, "fixed") == pytest.approx(held, rel=1e-9 if body == "box" else 0.02)
    assert area(mesh, "free") == pytest.approx(rest, rel=1e-9 if body == "box" else 0.02)
    assert volume(mesh) == pytest.approx(top * 20e-3, rel=1e-9 if body == "box" else 0.02)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("column", [3e-3, 6e-3, 25e-3])
def test_column(column, held):
    """A column of 25 mm extends beyond the sides of the box, and cuts its corners off; 3 mm is the disc's radius."""
    mesh = generate(scene(column, held), replace(SIZES, column=column))
    assert ("cut" in mesh.facets) is not held
    assert volume(mesh) == pytest.approx({25e-3: 31.14e-6}.get(column, pi * column**2 * 20e-3), rel=0.06)


@sampled("gap, rim", product((1e-9, 1e-7, 1e-6, 1e-5, 1e-4), ("0.4 mm", "0.1 mm")), by_day=3)
def test_a_free_column_a_hair_wider_than_the_disc_is_meshed(gap, rim):
    body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
    sizes = {"epsilon": f"{2 * (1 + gap):.12g} mm", "fine": "4 mm", "rim": rim, "growth": 0.5, "outside": "free"}
    mesh = mesh_arrays(study(body=body, probe={"radius": "2 mm"}, mesh=sizes).case(()), ("x", "y"))
    assert area(mesh, "probe") == pytest.approx(pi * 1e-6, rel=0.01)  # a polygon's


@pytest.mark.parametrize("rim, growth", [("0.25 mm", 0.55), ("0.2 mm", 0.5)])
def test_a_thin_cylinder_with_large_elements_at_its_side_is_whole(rim, growth):
    """gmsh folded triangles of the side: a half or a third of the body was left out, and F was 2.3 times as large."""
    body = {"shape": "cylinder", "radius": "4.609 mm", "height": "1.175 mm", "fixed": "bottom+sides"}
    sizes = {"epsilon": "2.175 mm", "fine": "0.5875 mm", "coarse": "7.8 mm", "rim": rim, "growth": growth}
    probe = {"radius": "1 mm", "depth": "0.01 mm", "at": ["2.043 mm", "0 mm"]}
    mesh = mesh_arrays(study(body=body, probe=probe, mesh={**sizes, "outside": "coarse"}).case(()), ("y",))
    assert volume(mesh) == pytest.approx(pi * 4.609e-3**2 * 1.175e-3 / 2, rel=0.02)


def test_a_part_of_an_ellipsoid_whose_area_the_geometry_kernel_does_not_know_is_not_folded():
    """For the held part of this scene it says three quarters of the area."""
    tumour = {"name": "tumour", "at": ["7 mm", "-4 mm", "10 mm"], "radius": "5 mm", "young": "80 kPa", "poisson": 0.4}
    body = {
        "shape": "ellipsoid",
        "axes": ["40 mm", "30 mm", "20 mm"],
        "fixed": {"below": "-5 mm"},
        "inclusion": [tumour],
    }
    probe = {"radius": "2 mm", "depth": "0.2 mm", "contact": "frictionless", "at": ["0 mm", "-15 mm"]}
    sizes = {"epsilon": "8 mm", "fine": "2 mm", "coarse": "9 mm", "rim": "0.25 mm", "outside": "coarse"}
    mesh = mesh_arrays(study(body=body, probe=probe, mesh=sizes).case(()), ())
    assert volume(mesh) == pytest.approx(4 / 3 * pi * 24e-6, rel=0.02)
    assert area(mesh, "fixed") == pytest.approx(4450e-6, rel=0.01)


def test_curved_rim_and_sides_are_round():
    mesh = scene(column=10e-3)
    curved = curve(generate(mesh, SIZES), mesh)
    assert curved.cells.shape[1] == 10
    radius = np.hypot(curved.points[:, 0], curved.points[:, 1])
    corners = np.unique(curved.cells[:, :4])
    on_side = np.abs(radius - 10e-3) < 1e-9
    assert np.setdiff1d(np.flatnonzero(on_side), corners).size > 50
    assert np.setdiff1d(np.flatnonzero(np.abs(radius - 3e-3) < 1e-9), corners).size >= SIZES.rim_segments(mesh.probe)


def test_quarter_points_lie_on_edges_that_end_on_the_rim():
    mesh = scene()
    plain = generate(mesh, SIZES)
    curved = curve(plain, mesh)
    ends = curved.cells[:, :4][:, EDGES].reshape(-1, 2)
    middle = curved.cells[:, 4:].reshape(-1)
    one = np.isin(ends, plain.rim).sum(axis=1) == 1
    at_rim = np.where(np.isin(ends[:, 0], plain.rim), ends[:, 0], ends[:, 1])
    lengths = np.linalg.norm(curved.points[ends[:, 0]] - curved.points[ends[:, 1]], axis=1)
    share = np.linalg.norm(curved.points[middle] - curved.points[at_rim], axis=1) / lengths
    assert np.median(share[one]) == pytest.approx(0.25, abs=1e-3)
    assert np.median(share[~one]) >= 0.4


def test_sizes_are_as_asked():
    mesh = generate(scene(straight=True), SIZES)
    edges = mesh.points[mesh.cells][:, EDGES]
    length = np.linalg.norm(edges[:, :, 0] - edges[:, :, 1], axis=2).mean(axis=1)
    centre = mesh.points[mesh.cells].mean(axis=1)
    far = np.linalg.norm(centre, axis=1)
    rim = np.hypot(np.hypot(centre[:, 0], centre[:, 1]) - 3e-3, centre[:, 2])
    assert np.median(length[rim < 0.4e-3]) == pytest.approx(0.6e-3, rel=0.3)
    assert np.median(length[(far < 8e-3) & (rim > 4e-3)]) == pytest.approx(2e-3, rel=0.4)
    assert np.median(length[far > 18e-3]) > 4e-3


def test_blade_corners_are_refined():
    mesh = generate(scene(probe=BLADE), SIZES)
    corners = np.array([[x, y, 0] for x in (-5e-3, 5e-3) for y in (-1.5e-3, 1.5e-3)])
    for corner in corners:
        distance = np.linalg.norm(mesh.points - corner, axis=1)
        assert np.sort(distance)[1] < 0.6e-3


@pytest.mark.parametrize("straight", [True, False])
def test_reflection_joins_without_a_seam(straight):
    """The whole has twice the volume, its surface is closed, and the plane of symmetry is inside."""
    half = replace(scene(straight=straight), mirrors=("x", "y"))
    part = generate(half, SIZES) if straight else curve(generate(half, SIZES), half)
    whole = reflect(part, ("x", "y"))
    assert volume(whole) == pytest.approx(4 * volume(part), rel=1e-12)
    assert area(whole, "probe") == pytest.approx(4 * area(part, "probe"), rel=1e-12)
    assert set(whole.facets) == {"probe", "fixed", "free"}
    assert len(np.unique(np.round(whole.points, 12), axis=0)) == len(whole.points)
    corners = whole.cells[:, :4]
    faces = np.sort(np.concatenate([np.delete(corners, i, axis=1) for i in range(4)]), axis=1)
    _, counts = np.unique(faces, axis=0, return_counts=True)
    assert counts.max() == 2
    assert (counts == 1).sum() == sum(map(len, whole.facets.values()))


def test_a_scene_that_cannot_be_built_is_refused_at_once(monkeypatch):
    """No element sizes fix tissue that floats."""
    begun = []
    session = gmsh.initialize
    monkeypatch.setattr("gmsh.initialize", lambda *args, **more: (begun.append(1), session(*args, **more)))
    with pytest.raises(MeshError, match="the tissue would float"):
        generate(scene(column=8e-3, body={"fixed": "sides"}), SIZES)
    assert len(begun) == 1


def test_a_mesh_that_fails_is_made_with_other_sizes(monkeypatch):
    made, attempts = gmsh.model.mesh.generate, []

    def fails_once(dim):
        attempts.append(dim)
        if len(attempts) == 1:
            raise Exception("overlapping facets")
        made(dim)

    monkeypatch.setattr("gmsh.model.mesh.generate", fails_once)
    assert len(generate(scene(), SIZES).cells) > 0
    assert len(attempts) == 2


def test_a_face_that_gmsh_cannot_mesh_is_a_failed_case():
    """gmsh threw its error where nothing caught it, and the process ended."""
    balls = {
        "region-0": (["-19.78 mm", "-1.305 mm", "-13.66 mm"], ["2.078 mm"] * 3),
        "region-1": (["-14.49 mm", "13.72 mm", "-8.786 mm"], ["0.8495 mm", "1.373 mm", "1.238 mm"]),
        "region-2": (["-19.79 mm", "-4.197 mm", "-9.807 mm"], ["1.971 mm", "1.112 mm", "0.9323 mm"]),
    }
    tissue = {"young": "5 kPa", "poisson": 0.4}
    regions = [{"name": name, "at": at, "axes": axes, **tissue} for name, (at, axes) in balls.items()]
    body = {"size": ["53.95 mm", "31.89 mm", "20.18 mm"], "inclusion": regions}
    probe = {"radius": "2.781 mm", "depth": "0.1814 mm", "at": ["-1.433 mm", "4.366 mm"]}
    (record,) = solve(body=body, probe=probe, mesh=NO_SIZES | {"accuracy": "1.83 %"}).values()
    assert record.status == "ok" or record.message.startswith("gmsh: ")
