"""Columns cut out along a tilted axis, or out of a curved body: their volume, and their effect on the force."""

import subprocess
import sys
from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np
import pytest

from epsmesh.mesh.of_case import mesh_arrays
from tests.cases import solve, study
from tests.mesh.test_mesh import area
from tests.mesh.test_regions import volumes
from tests.sampling import sampled

TILT = radians(10)
AXIS = [sin(TILT), 0.0, -cos(TILT)]
EGG = {"shape": "ellipsoid", "axes": ["24 mm", "24 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
SCENES = {
    "tilted": {"probe": {"axis": AXIS}},
    "on a curved body": {"body": EGG},
    "beside its top": {"body": EGG, "probe": {"at": ["6 mm", "4 mm"]}},
    "slides": {"probe": {"shape": "blade", "length": "8 mm", "width": "2 mm", "depth": "0.2 mm", "axis": AXIS}},
    "found": {"body": EGG, "probe": {"shape": "sphere", "radius": "6 mm", "depth": "0.3 mm", "contact": "unilateral"}},
}
RADIUS = 9e-3
# A box with a hollow from side to side, between two plates.
_DRAW = """
import sys, gmsh
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0); occ = gmsh.model.occ
occ.cut([(3, occ.addBox(-20, -20, -20, 40, 40, 20))], [(3, occ.addBox(-15, -20, -14, 30, 40, 6))])
occ.synchronize(); gmsh.write(sys.argv[1])
"""


def volume(**changes) -> float:
    mesh = mesh_arrays(study(mesh={"epsilon": "9 mm", "outside": "free", "fine": "3 mm"}, **changes).case(()), ())
    return 1e-9 * sum(volumes(replace(mesh, regions=np.zeros(len(mesh.cells)))).values())


def test_a_tilted_column_reaches_through_the_body():
    """Its top follows the surface: volume between two planes, pi r² h / cos."""
    assert volume(**SCENES["tilted"]) == pytest.approx(pi * RADIUS**2 * 20e-3 / cos(TILT), rel=2e-4)


def test_a_column_of_a_curved_body_ends_at_its_surface():
    a, c = 24e-3, 20e-3
    exact = 4 / 3 * pi * a * a * c * (1 - (1 - (RADIUS / a) ** 2) ** 1.5)
    assert volume(**SCENES["on a curved body"]) == pytest.approx(exact, rel=2e-4)


@sampled("name", SCENES, by_day=2)
def test_a_free_column_is_softer_than_the_body_and_a_fixed_one_stiffer(name):
    """The removed tissue stored energy, fixed tissue stores none. Wider columns are closer to the whole body."""
    sizes = {"epsilon": ["9 mm", "14 mm", "full"], "outside": ["free", "fixed"]}
    found = solve(mesh=sizes, **SCENES[name])
    assert all(record.status == "ok" for record in found.values()), [record.message for record in found.values()]
    force = np.array([[found[i, j].force for j in range(2)] for i in range(3)])
    assert force[2, 0] == pytest.approx(force[2, 1], rel=1e-9)
    (narrow_free, narrow_fixed), (free, fixed), (whole, _) = force
    assert narrow_free < free < whole < fixed < narrow_fixed


def test_the_sides_of_a_column_are_round():
    mesh = mesh_arrays(
        study(mesh={"epsilon": "9 mm", "outside": "free", "fine": "3 mm"}, **SCENES["tilted"]).case(()), ()
    )
    assert area(mesh, "cut") == pytest.approx(2 * pi * RADIUS * 20e-3 / cos(TILT), rel=0.02)


@pytest.mark.parametrize("axis", [[0.0, 0.0, -1.0], AXIS])
def test_the_column_of_a_hollow_body_is_the_connected_piece_below_the_probe(tmp_path, axis):
    """It is a plate with fixed sides; the part of the column below the hollow is removed."""
    file = tmp_path / "hollow.brep"
    subprocess.run([sys.executable, "-c", _DRAW, str(file)], check=True, capture_output=True)
    hollow = {"shape": "cad", "file": str(file), "unit": "mm", "fixed": {"below": "-16 mm"}}
    plate = {"shape": "box", "size": ["40 mm", "40 mm", "8 mm"], "fixed": "sides"}
    mesh = {"epsilon": "9 mm", "outside": "fixed", "fine": "3 mm"}
    (a,), (b,) = (solve(body=body, mesh=mesh, probe={"axis": axis}).values() for body in (hollow, plate))
    assert (a.status, b.status) == ("ok", "ok"), (a.message, b.message)
    assert a.force == pytest.approx(b.force, rel=2 * (a.force_error + b.force_error))
    mesh = mesh_arrays(study(body=hollow, mesh=mesh, probe={"axis": axis}).case(()), ())
    assert mesh.points[:, 2].min() == pytest.approx(-8e-3, abs=1e-9)
