"""Hollow regions: cells are left out, the wall is free or under pressure."""

from math import pi

import numpy as np
import pytest

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.key import case_key, mesh_key
from epsmesh.run.loads import loads_of
from epsmesh.scene.model import FREE
from tests.cases import raw, refusal, solve, study
from tests.mesh.test_mesh import volume
from tests.organs import sphere, write_stl

# A ball of 20 mm with a concentric cavity of 8 mm.
OUTER, INNER = 20e-3, 8e-3
PROBE = {"shape": "disc", "radius": "3 mm", "depth": "0.01 mm", "at": ["0 mm", "0 mm"]}
MESH = {"epsilon": "full", "fine": "6 mm", "coarse": "60 mm", "rim": "1 mm", "growth": 0.7}
CAVITY = {"name": "vessel", "file": "cavity.stl", "unit": "mm", "hollow": True}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    for name, radius in (("ball", OUTER), ("cavity", INNER)):
        points, facets = sphere(16)
        write_stl(folder / f"{name}.stl", radius * points, facets)
    return folder


def body(folder, **cavity):
    region = [CAVITY | {"file": str(folder / "cavity.stl")} | cavity]
    return {"shape": "surface", "file": str(folder / "ball.stl"), "unit": "mm", "fixed": {"below": "-15 mm"}} | {
        "region": region
    }


def case_of(folder, load=None, **cavity):
    return study(body=body(folder, **cavity), probe=PROBE, mesh=MESH, **({"load": load} if load else {})).case(())


def test_the_cells_of_a_hollow_region_are_left_out(folder):
    case = case_of(folder)
    mesh = mesh_arrays(case, ())
    middle = np.linalg.norm(mesh.points[mesh.cells[:, :4]].mean(axis=1), axis=1)
    assert mesh.regions is None and middle.min() > 0.97 * INNER
    cavity = case.body.region[0].surface
    # Facets follow the file by curved edges; straight ones leave out more.
    assert volume(mesh) == pytest.approx(case.body.volume - cavity.volume, rel=0.03)
    wall = np.unique(mesh.facets[FREE])
    on_wall = wall[np.linalg.norm(mesh.points[wall], axis=1) < 1.5 * INNER]
    assert len(on_wall) > 50 and np.abs(cavity.distance(mesh.points[on_wall])).max() < 1e-9


def test_a_pressure_in_it_is_a_traction_on_its_wall_alone(folder):
    """The resultant on a closed wall is zero, its size is p A; what acts on the free surface is outside."""
    from mpi4py import MPI

    from epsmesh.run.meshing import mesh_case
    from epsmesh.solve.compiled import vector_space
    from epsmesh.solve.loads import apply_loads

    with_pressure, on_name = (
        case_of(folder, pressure="2 kPa"),
        case_of(folder, {"traction": [{"on": "vessel", "pressure": "2 kPa"}]}),
    )
    outside = case_of(folder, {"traction": [{"on": "free", "pressure": "2 kPa"}]})
    assert with_pressure.load == on_name.load and case_key(with_pressure) == case_key(on_name)
    assert mesh_key(with_pressure) == mesh_key(outside) and case_key(with_pressure) != case_key(outside)
    mesh = mesh_case(with_pressure, (), MPI.COMM_SELF)
    space = vector_space(mesh.mesh, 2)
    inside = apply_loads(loads_of(with_pressure), mesh, space)
    assert inside.size == pytest.approx(2e3 * 4 * pi * INNER**2, rel=5e-3)
    assert np.abs(inside.resultant).max() < 1e-3 * inside.size
    free = apply_loads(loads_of(outside), mesh, space)
    cap = 2 * pi * OUTER * 5e-3  # what is fixed
    assert free.size == pytest.approx(2e3 * (4 * pi * OUTER**2 - cap - pi * 3e-3**2), rel=0.01)


def test_an_empty_ball_is_one_of_very_soft_tissue(folder):
    (empty,) = solve(body=body(folder), probe=PROBE, mesh=MESH).values()
    soft_tissue = {"hollow": False, "young": "0.1 Pa", "poisson": 0.0}
    (soft,) = solve(body=body(folder, **soft_tissue), probe=PROBE, mesh=MESH).values()
    (full,) = solve(body=body(folder, hollow=False, young="10 kPa", poisson=0.3), probe=PROBE, mesh=MESH).values()
    assert empty.force == pytest.approx(soft.force, rel=2e-4)
    assert empty.force < 0.95 * full.force


def test_mistakes_are_named(folder):
    for cavity, parts in (
        ({"young": "1 kPa"}, ["body.region[1].young", "hollow region has not"]),
        ({"hollow": False}, ["body.region[1].poisson: is required", "body.region[1].young"]),
        ({"hollow": False, "young": "1 kPa", "poisson": 0.3, "pressure": "1 kPa"}, ["pressure", "`hollow = true`"]),
        ({"pressure": "1 kPa", "name": "free"}, ["free"]),
    ):  # fmt: skip
        said = refusal(raw(body=body(folder, **cavity), probe=PROBE, mesh=MESH))
        assert all(part in said for part in parts), said
