"""Inclusions in bodies of triangles and in CAD solids: regions of cells, and accuracy of their surface."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from epsmesh.mesh.generate import MeshError
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.mesh.organ import make, regions
from epsmesh.mesh.organ.embedded import embedded_surfaces
from epsmesh.plan.key import case_key, mesh_key
from tests.cases import study
from tests.mesh.test_regions import volumes
from tests.organs import ellipsoid, write_stl

TUMOUR = {"name": "tumour", "at": ["-30 mm", "2 mm", "15 mm"], "axes": ["8 mm", "6 mm", "5 mm"], "young": "50 kPa",
          "poisson": 0.45}  # fmt: skip
CYST = {"name": "cyst", "at": ["14 mm", "4 mm", "5 mm"], "radius": "7 mm", "young": "1 kPa", "poisson": 0.3}
PROBE = {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm", "at": ["-36 mm", "0 mm", "24 mm"]}
MESH = {"epsilon": "full", "fine": "15 mm", "coarse": "60 mm", "rim": "1 mm", "growth": 0.7}


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    path = write_stl(tmp_path_factory.mktemp("organ") / "ellipsoid.stl", *ellipsoid(12))
    return {"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-10 mm"}}


def case_of(body, *inclusions, probe=PROBE, mesh=MESH):
    return study(body=body | {"inclusion": [*inclusions]}, probe=probe, mesh=mesh).case(())


@pytest.fixture(scope="module")
def meshed(body):
    case = case_of(body, TUMOUR, CYST)
    return case, mesh_arrays(case, ())


def test_every_inclusion_has_its_volume_and_its_number(meshed):
    case, mesh = meshed
    found = volumes(mesh)
    assert found[1] == pytest.approx(4 / 3 * pi * 8 * 6 * 5, rel=3e-3)
    assert found[2] == pytest.approx(4 / 3 * pi * 7**3, rel=3e-3)
    assert sum(found.values()) == pytest.approx(1e9 * case.body.volume, rel=5e-3)
    for number, inclusion in enumerate(case.body.inclusion, start=1):
        level = inclusion.surface.level(mesh.points[mesh.cells[:, :4]].mean(axis=1))
        clear = np.abs(level - 1) > 0.05  # of its surface, where flat cells are
        np.testing.assert_array_equal((mesh.regions == number)[clear], (level < 1)[clear])


def test_nodes_between_materials_are_on_the_true_ellipsoid(meshed):
    """Except mid nodes of cells so flat that curved edges would fold them."""
    case, mesh = meshed
    for number, inclusion in enumerate(case.body.inclusion, start=1):
        inner, outer = (np.unique(mesh.cells[chosen]) for chosen in (mesh.regions == number, mesh.regions != number))
        shared = np.intersect1d(inner, outer)
        off = np.abs(inclusion.surface.distance(mesh.points[shared])) > 1e-12
        assert len(shared) > 100 and off.mean() < 0.03
        assert not np.isin(shared[off], mesh.cells[:, :4]).any()


def test_elements_on_an_inclusion_and_in_a_narrow_gap_are_small(body):
    """A millimetre below the surface, where elements elsewhere have 15 mm."""
    near = CYST | {"at": ["5 mm", "0 mm", "22.1 mm"]}
    case = case_of(body, near, probe=PROBE | {"at": ["-30 mm", "0 mm", "25 mm"]})
    assert 0.4e-3 < case.body.room(case.body.inclusion[0].surface) < 1.2e-3
    mesh = mesh_arrays(case, ())
    assert volumes(mesh)[1] == pytest.approx(4 / 3 * pi * 7**3, rel=1e-3)
    corners = mesh.points[mesh.cells[:, :4]]
    shape = np.linalg.det(corners[:, 1:] - corners[:, :1]) / np.ptp(corners, axis=1).max(axis=1) ** 3
    assert shape.min() > 0.002


def test_elements_on_a_far_inclusion_may_be_larger_and_keep_its_volume(meshed):
    case, fine = meshed
    coarse = mesh_arrays(replace(case, mesh=case.mesh.with_far_regions(1.0)), ())
    assert (coarse.regions == 2).sum() < 0.7 * (fine.regions == 2).sum()
    assert len(coarse.cells) < len(fine.cells)
    assert volumes(coarse)[2] == pytest.approx(volumes(fine)[2], rel=0.03)
    assert volumes(coarse)[1] == pytest.approx(volumes(fine)[1], rel=0.01)  # below the tool


def test_the_mesh_is_of_places_not_of_materials(body):
    soft, stiff = study(body=body | {"inclusion": [TUMOUR | {"young": ["5 kPa", "50 kPa"]}]}, probe=PROBE).cases()
    assert mesh_key(soft) == mesh_key(stiff) and case_key(soft) != case_key(stiff)
    assert len({mesh_key(case_of(body, *pieces)) for pieces in ((), (TUMOUR,), (CYST,), (TUMOUR, CYST))}) == 4


def test_a_surface_that_meets_the_bodys_is_never_filled(body, monkeypatch):
    """The check of the study refuses it; if that check fails, the mesh must not be another body's."""
    case = case_of(body, CYST)

    def shifted(pieces, field):
        return [(points + np.array([0.0, 0.0, 20e-3]), facets) for points, facets in embedded_surfaces(pieces, field)]

    monkeypatch.setattr(make, "_FINER", (1,))
    monkeypatch.setattr(regions, "embedded_surfaces", shifted)
    with pytest.raises(MeshError, match=r"."):
        mesh_arrays(case, ())


def test_a_solid_of_a_cad_file_holds_one():
    phantom = {"shape": "cad", "file": "meshes/phantom.step", "unit": "mm", "fixed": {"face": "base"}}
    ball = CYST | {"at": ["0 mm", "0 mm", "12 mm"], "radius": "5 mm"}
    probe = {"shape": "disc", "radius": "4 mm", "depth": "0.3 mm", "at": ["10 mm", "12 mm", "18 mm"]}
    case = case_of(phantom, ball, probe=probe, mesh=MESH | {"fine": "8 mm"})
    assert case.body.room(case.body.inclusion[0].surface) == pytest.approx(3e-3, abs=0.1e-3)
    mesh = mesh_arrays(case, ())
    found = volumes(mesh)
    assert found[1] == pytest.approx(4 / 3 * pi * 5**3, rel=2e-3)
    assert sum(found.values()) == pytest.approx(1e9 * case.body.volume, rel=2e-3)
