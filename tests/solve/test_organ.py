"""Forces on bodies of triangles are those on the bodies that they stand for."""

from pathlib import Path

import pytest
from mpi4py import MPI

from tests.cases import solve
from tests.organs import box, write_stl

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
    assert one.force_error < 0.005
    assert abs(one.force / other.force - 1) < one.force_error + other.force_error
    assert abs(one.force / other.force - 1) < 0.002
