"""Meshes of layers and inclusions: regions of cells, volumes, and the cache."""

from dataclasses import replace
from math import pi

import basix
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.mesh.reflect import reflect
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.run.mesh_cache import MeshCache
from tests.cases import solve, study

SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.3}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-12 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.3}
OVOID = {"name": "cyst", "at": ["0 mm", "12 mm", "-12 mm"], "axes": ["5 mm", "4 mm", "2 mm"], "young": "1 kPa",
         "poisson": 0.3}  # fmt: skip


def case_of(body, **mesh):
    return study(body=body, mesh=mesh).case(())


def volumes(mesh) -> dict[int, float]:
    """Return the volume (mm³) of each region, with curved cells."""
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, 6)
    degree = 1 if mesh.cells.shape[1] == 4 else 2
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, degree, basix.LagrangeVariant.equispaced
    )
    gradients = element.tabulate(1, points)[1:4, :, :, 0]
    jacobians = np.einsum("aqn,cni->cqai", gradients, mesh.points[mesh.cells])
    of_cells = 1e9 * np.abs(np.linalg.det(jacobians)) @ weights
    return {int(region): float(of_cells[mesh.regions == region].sum()) for region in np.unique(mesh.regions)}


def test_a_body_of_one_material_has_no_regions():
    assert mesh_arrays(case_of({}), ()).regions is None


@pytest.mark.parametrize("mirrored", [False, True])
def test_volumes_of_regions_are_those_of_the_study(mirrored):
    case = case_of({"layer": [SKIN], "inclusion": [BALL]}, fine="3 mm")
    mirrors = mirror_planes(case) if mirrored else ()
    assert mirrors in ((), ("x", "y"))
    found, share = volumes(mesh_arrays(case, mirrors)), 0.5 ** len(mirrors)
    ball = 4 / 3 * pi * 4**3
    assert found[1] == pytest.approx(share * 40 * 40 * 2, rel=1e-9)
    assert found[2] == pytest.approx(share * ball, rel=1e-3)
    assert sum(found.values()) == pytest.approx(share * 40 * 40 * 20, rel=1e-9)


def test_ellipsoids_off_centre_have_their_volume_and_leave_one_plane():
    case = case_of({"inclusion": [BALL, OVOID]}, fine="3 mm")
    assert mirror_planes(case) == ("x",)
    found = volumes(mesh_arrays(case, ()))
    # Cells with all corners on an inclusion stay straight: gmsh 4.13 makes more of them than 4.8.
    assert found[1] == pytest.approx(4 / 3 * pi * 4**3, rel=5e-3)
    assert found[2] == pytest.approx(4 / 3 * pi * 5 * 4 * 2, rel=5e-3)


def test_layers_that_fill_a_cylinder_leave_no_other_cell():
    fat = {"name": "fat", "young": "5 kPa", "poisson": 0.3}
    case = case_of({"shape": "cylinder", "radius": "20 mm", "height": "12 mm", "layer": [SKIN, fat]})
    found = volumes(mesh_arrays(case, ()))
    assert list(found) == [1, 2]
    assert found[1] / found[2] == pytest.approx(2 / 10, rel=1e-5)


@pytest.mark.parametrize(("thickness", "longest"), [(0.6, 0.6), (2.0, 1.6)])
def test_elements_along_the_probes_edge_are_no_longer_than_a_layer_below_is_thick(thickness, longest):
    mesh = mesh_arrays(case_of({"layer": [SKIN | {"thickness": f"{thickness} mm"}]}, rim="2 mm", fine="3 mm"), ())
    x, y, _ = mesh.points[np.intersect1d(mesh.rim, mesh.cells[:, :4])].T
    arcs = 1e3 * np.hypot(x, y).max() * np.diff(np.sort(np.arctan2(y, x)))
    assert 0.9 * longest < arcs.max() < longest


@pytest.mark.parametrize("epsilon", ["3.5 mm", "10 mm"])
def test_a_column_cuts_an_inclusion_or_passes_it(epsilon):
    case = case_of({"inclusion": [BALL]}, epsilon=epsilon, outside="free")
    found = volumes(mesh_arrays(case, ()))
    radius, whole = float(epsilon.split()[0]), 4 / 3 * pi * 4**3
    cut = whole - 4 / 3 * pi * (16 - radius**2) ** 1.5 if radius < 4 else whole
    assert found[1] == pytest.approx(cut, rel=2e-3)


def test_the_lowest_layer_has_elements_as_small_as_its_thickness_asks_for():
    """Whether it is the last of the layers, or the rest of the body below them."""
    body = {"shape": "box", "size": ["40 mm", "40 mm", "5 mm"]}
    thick, rest = SKIN | {"thickness": "4 mm"}, {"name": "fascia", "young": "900 kPa", "poisson": 0.3}
    for layers in ([thick], [thick, rest]):
        mesh = mesh_arrays(case_of(body | {"layer": layers}), ())
        low = mesh.points[mesh.cells[mesh.regions != 1][:, :4]]
        near = np.linalg.norm(low.mean(axis=1)[:, :2], axis=1) < 5e-3
        longest = np.linalg.norm(low[near][:, :, None] - low[near][:, None], axis=-1).max(axis=(1, 2))
        assert np.median(longest) < 0.9e-3


@pytest.mark.parametrize(("contact", "poisson"), [("frictionless", 0.3), ("bonded", 0.49)])
def test_a_column_without_the_inclusion_is_one_of_the_other_tissue(contact, poisson):
    """From the study to the force, with displacement elements and with mixed ones."""
    changes = {
        "mesh": {"epsilon": ["6 mm", "full"], "outside": "free"},
        "material": {"poisson": poisson},
        "probe": {"contact": contact},
    }
    aside = BALL | {"at": ["15 mm", "0 mm", "-10 mm"], "poisson": poisson}
    stiff, same = (solve(body={"inclusion": [aside | {"young": young}]}, **changes) for young in ("50 kPa", "10 kPa"))
    assert {record.status for record in (*stiff.values(), *same.values())} == {"ok"}
    assert stiff[0,].force == pytest.approx(same[0,].force, rel=1e-8)
    assert stiff[1,].force > (1 + 1e-5) * same[1,].force


def test_cells_of_a_kept_column_have_their_regions_whichever_it_reaches(tmp_path):
    aside = BALL | {"at": ["15 mm", "0 mm", "-10 mm"]}
    case = case_of({"inclusion": [aside]}, epsilon="6 mm", outside="free")
    cache, made = MeshCache(tmp_path), mesh_arrays(case, ())
    cache.put(path := cache.path(case, ()), made)
    for mesh in (made, cache.get(path)):
        assert mesh.regions.shape == (len(mesh.cells),)
        assert not mesh.regions.any()


def test_an_inclusion_near_the_surface_is_resolved():
    near = BALL | {"at": ["0 mm", "0 mm", "-4.4 mm"], "radius": "4 mm"}
    mesh = mesh_arrays(case_of({"inclusion": [near]}), ("x", "y"))
    corners = mesh.points[mesh.cells[:, :4]]
    shape = np.linalg.det(corners[:, 1:] - corners[:, :1]) / np.ptp(corners, axis=1).max(axis=1) ** 3
    assert shape.min() > 0.005
    assert volumes(mesh)[1] == pytest.approx(pi / 3 * 4**3, rel=1e-3)


def test_cells_keep_their_region_in_images_in_the_cache_and_on_ranks(tmp_path):
    case = case_of({"layer": [SKIN], "inclusion": [BALL]})
    quarter = mesh_arrays(case, ("x", "y"))
    whole = reflect(quarter, ("x", "y"))
    assert whole.regions is not None
    assert volumes(whole) == pytest.approx({region: 4 * volume for region, volume in volumes(quarter).items()})
    cache = MeshCache(tmp_path)
    path = cache.path(case, ("x", "y"))
    cache.put(path, quarter)
    assert np.array_equal(cache.get(path).regions, quarter.regions)
    cache.put(path, replace(quarter, regions=None))
    assert cache.get(path).regions is None


@pytest.mark.mpi
def test_local_cells_know_their_region():
    arrays = mesh_arrays(case_of({"layer": [SKIN], "inclusion": [BALL]}), ()) if MPI.COMM_WORLD.rank == 0 else None
    body = distribute(MPI.COMM_WORLD, arrays)
    middles = body.mesh.geometry.x[compat.geometry_dofs(body.mesh)[:, :4]].mean(axis=1)
    expected = np.where(middles[:, 2] > -0.002, 1, 0)
    expected[np.linalg.norm(middles - [0, 0, -0.012], axis=1) < 0.0036] = 2
    sure = np.abs(np.linalg.norm(middles - [0, 0, -0.012], axis=1) - 0.004) > 0.0004
    assert body.regions is not None
    assert len(body.regions) == len(middles)
    assert np.array_equal(body.regions[sure], expected[sure])


@pytest.mark.mpi
@pytest.mark.parametrize("number", [7, 300, 70_000])
def test_a_rank_may_have_no_cells(number):
    """One cell on all ranks together: it, its region, whatever its number, and its faces are there once."""
    points, cell, rim = np.vstack([np.zeros(3), np.eye(3)]), np.arange(4), np.arange(3)
    faces = {"free": np.array([np.delete(cell, corner) for corner in cell])}
    one = MeshArrays(points, cell[None], faces, rim, 0.0, regions=np.array([number]))
    body = distribute(MPI.COMM_WORLD, one if MPI.COMM_WORLD.rank == 0 else None)
    mine = [int((body.regions == number).sum()), len(body.facets["free"]), compat.geometry_dofs(body.mesh).size]
    assert compat.geometry_dofs(body.mesh).shape[1] == 4
    assert MPI.COMM_WORLD.allreduce(np.array(mine)).tolist() == [1, 4, 4]
