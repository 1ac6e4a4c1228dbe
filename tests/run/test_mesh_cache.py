"""The mesh cache: the same mesh back, damage undone, a bounded folder."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh import parts
from epsmesh.mesh.of_case import mesh_arrays, unrefined_arrays
from epsmesh.mesh.refine import NotRefined
from epsmesh.plan import refinement
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.meshing import cached_arrays, mesh_case
from epsmesh.stages import recorded
from tests.cases import study

CASE = study().case(())
PLANES = ("x", "y")


def test_same_mesh_comes_back(tmp_path):
    cache = MeshCache(tmp_path / "meshes")
    path = cache.path(CASE, PLANES)
    assert cache.get(path) is None
    made = mesh_arrays(CASE, PLANES)
    cache.put(path, made)
    found = cache.get(path)
    assert np.array_equal(found.points, made.points)
    assert np.array_equal(found.cells, made.cells)
    assert found.facets.keys() == made.facets.keys()
    assert found.seconds == made.seconds
    assert path != cache.path(CASE, ("x",))
    assert path != cache.path(study(mesh={"rim": "0.9 mm"}).case(()), PLANES)
    assert path == cache.path(study(material={"poisson": 0.4}, probe={"depth": "0.1 mm"}).case(()), PLANES)


def test_a_mesh_that_cannot_be_refined_is_that_of_gmsh(tmp_path, monkeypatch):
    def fails(*_):
        raise NotRefined("flat")

    monkeypatch.setattr(parts, "refined", fails)
    monkeypatch.setattr(refinement, "LEAST", (0, 0))
    refinement._refinements.cache_clear()
    cache, wanted = MeshCache(tmp_path), len(unrefined_arrays(CASE, PLANES).cells)
    found = [mesh_case(CASE, PLANES, MPI.COMM_SELF, cache).cells for _ in range(2)]
    found.append(len(cached_arrays(CASE, PLANES, cache).cells))
    refinement._refinements.cache_clear()
    assert found == 3 * [wanted]


def test_damaged_file_is_made_again(tmp_path):
    cache = MeshCache(tmp_path)
    path = cache.path(CASE, PLANES)
    for damage in (b"no mesh", b""):
        path.write_bytes(damage)
        mesh = mesh_case(CASE, PLANES, MPI.COMM_SELF, cache)
        assert mesh.cells > 0
        assert cache.get(path) is not None


def test_a_mesh_that_is_read_back_counts_with_the_time_that_it_took(tmp_path):
    cache = MeshCache(tmp_path)
    path = cache.path(CASE, PLANES)
    cache.put(path, replace(mesh_arrays(CASE, PLANES), seconds=1e6))
    with recorded() as times:
        mesh_case(CASE, PLANES, MPI.COMM_SELF, cache)
    assert times.mesh == pytest.approx(1e6, rel=1e-3)
    assert times.total == times.mesh


def test_least_recently_used_go_first(tmp_path):
    made = mesh_arrays(CASE, PLANES)
    cache = MeshCache(tmp_path)
    cache.put(tmp_path / "first.npz", made)
    size = (tmp_path / "first.npz").stat().st_size
    small = MeshCache(tmp_path, limit=2.5 * size)
    small.put(tmp_path / "second.npz", made)
    assert small.get(tmp_path / "first.npz") is not None
    small.put(tmp_path / "third.npz", made)
    assert {file.stem for file in tmp_path.glob("*.npz")} == {"first", "third"}


def test_a_folder_that_cannot_be_written_is_no_reason_to_end(tmp_path):
    (tmp_path / "file").write_text("in the way")
    cache = MeshCache(tmp_path / "file" / "meshes")
    mesh = mesh_case(CASE, PLANES, MPI.COMM_SELF, cache)
    assert mesh.cells > 0
