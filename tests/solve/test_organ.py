"""Forces on bodies of triangles agree with those on the exact bodies, with inclusions, too."""

from dataclasses import replace
from math import isnan
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.distribute import BodyMesh
from epsmesh.run.meshing import mesh_case
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import solve, study
from tests.organs import box, ellipsoid, write_stl
from tests.solve.test_regions import moduli

MESH = {"accuracy": "0.5 %", "epsilon": None, "fine": None, "coarse": None, "rim": None, "growth": None, "degree": None}
NATIVE = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": {"below": "-15 mm"}}


@pytest.mark.mpi
@pytest.mark.parametrize("contact", ["bonded", "frictionless"])
def test_a_box_given_as_triangles_is_a_box(tmp_path_factory, contact):
    folder = MPI.COMM_WORLD.bcast(str(tmp_path_factory.mktemp("box")) if MPI.COMM_WORLD.rank == 0 else "")
    path = Path(folder) / "box.stl"
    if MPI.COMM_WORLD.rank == 0:
        write_stl(path, *box(40e-3, 40e-3, 20e-3))
    MPI.COMM_WORLD.barrier()
    given = {"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-15 mm"}}
    found = []
    for body in (given, NATIVE):
        (record,) = solve(MPI.COMM_WORLD, body=body, mesh=MESH, probe={"contact": contact}).values()
        assert record.status == "ok", record.message
        found.append(record)
    one, other = found
    assert one.surface_deviation < 1e-9 and isnan(other.surface_deviation)
    assert one.force_error < 0.005
    assert abs(one.force / other.force - 1) < one.force_error + other.force_error
    assert abs(one.force / other.force - 1) < 0.002


@pytest.mark.parametrize(
    ("contact", "axis"), [("bonded", None), ("frictionless", [-0.3, 0.1, -1.0])], ids=["normal", "inclined"]
)
def test_an_ellipsoid_given_as_triangles_is_an_ellipsoid_wherever_it_is_touched(tmp_path, contact, axis):
    """Pressed on its side: force, its direction and balance agree with the exact surface."""
    path = write_stl(tmp_path / "ellipsoid.stl", *ellipsoid(24))
    given = {"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-10 mm"}}
    native = {"shape": "ellipsoid", "axes": ["60 mm", "45 mm", "30 mm"], "fixed": {"below": "-10 mm"}}
    probe = {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm", "at": ["-36 mm", "0 mm", "24 mm"]}
    probe |= {"contact": contact} | ({"axis": axis} if axis else {})
    mesh = {"epsilon": "full", "fine": "15 mm", "coarse": "60 mm", "rim": "0.4 mm", "growth": 0.5}
    found = []
    for body in (given, native):
        (record,) = solve(body=body, probe=probe, mesh=mesh).values()
        assert record.status == "ok", record.message
        found.append(record)
    one, other = found
    assert one.force == pytest.approx(other.force, rel=0.01)
    assert 0.005 < one.force_error < 0.03
    assert abs(one.force / other.force - 1) < max(one.force_error, other.force_error)
    np.testing.assert_allclose(one.force_vector, other.force_vector, atol=0.01 * other.force)
    assert one.balance < 1e-5 and one.energy == pytest.approx(one.force * 0.2e-3 / 2, rel=1e-5)


TUMOUR = {
    "name": "tumour",
    "at": ["-30 mm", "2 mm", "15 mm"],
    "axes": ["8 mm", "6 mm", "5 mm"],
    "young": "50 kPa",
    "poisson": 0.3,
}
PROBE = {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm", "at": ["-36 mm", "0 mm", "24 mm"]}
COARSE = {"epsilon": "full", "fine": "15 mm", "coarse": "60 mm", "rim": "1.5 mm", "growth": 1.0}
PRESS = Movement.along((0.0, 0.0, -0.2e-3))
ELLIPSOID = {"shape": "ellipsoid", "axes": ["60 mm", "45 mm", "30 mm"], "fixed": {"below": "-10 mm"}}


def meshed(body) -> BodyMesh:
    return mesh_case(study(body=body | {"inclusion": [TUMOUR]}, probe=PROBE, mesh=COARSE).case(()), (), MPI.COMM_SELF)


def force(mesh: BodyMesh, law: MaterialLaw, method: str = "iterative") -> float:
    with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, 2, Conditions()) as problem:
        return problem.solve(law, PRESS, method=method).reaction[2]


def test_a_tumour_in_a_file_of_an_ellipsoid_is_one_in_the_ellipsoid(tmp_path):
    path = write_stl(tmp_path / "ellipsoid.stl", *ellipsoid(24))
    given = meshed({"shape": "surface", "file": str(path), "unit": "mm", "fixed": {"below": "-10 mm"}})
    none = force(replace(given, regions=None), moduli((10e3, 0.3)), "direct")
    assert force(given, moduli((10e3, 0.3), (10e3, 0.3)), "direct") == pytest.approx(none, rel=1e-8)
    stiff = moduli((10e3, 0.3), (100e3, 0.3))
    assert force(given, moduli((10e3, 0.3), (1e3, 0.3))) < 0.9 * none < 1.1 * none < force(given, stiff)
    assert force(given, stiff) == pytest.approx(force(meshed(ELLIPSOID), stiff), rel=0.01)
