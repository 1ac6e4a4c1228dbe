"""Inclusions in bodies of triangles act on the force as they do in the bodies that these stand for."""

from dataclasses import replace

import pytest
from mpi4py import MPI

from pipeline.mesh.distribute import BodyMesh
from pipeline.run.meshing import mesh_case
from pipeline.solve.movement import Movement
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.spaces import Conditions, Spaces
from tests.cases import study
from tests.organs import ellipsoid, write_stl
from tests.solve.test_regions import moduli

TUMOUR = {"name": "tumour", "at": ["-30 mm", "2 mm", "15 mm"], "axes": ["8 mm", "6 mm", "5 mm"], "young": "50 kPa",
          "poisson": 0.3}  # fmt: skip
PROBE = {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm", "at": ["-36 mm", "0 mm", "24 mm"]}
MESH = {"epsilon": "full", "fine": "15 mm", "coarse": "60 mm", "rim": "1.5 mm", "growth": 1.0}
PRESS = Movement.along((0.0, 0.0, -0.2e-3))
NATIVE = {"shape": "ellipsoid", "axes": ["60 mm", "45 mm", "30 mm"], "fixed": {"below": "-10 mm"}}


def meshed(body) -> BodyMesh:
    return mesh_case(study(body=body | {"inclusion": [TUMOUR]}, probe=PROBE, mesh=MESH).case(()), (), MPI.COMM_SELF)


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
    assert force(given, stiff) == pytest.approx(force(meshed(NATIVE), stiff), rel=0.01)
