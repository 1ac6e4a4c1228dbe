"""Files for ParaView hold the fields, in VTK's order of nodes."""

from xml.etree import ElementTree as Xml

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from pipeline.run.solved import solve_alone
from pipeline.scene.model import PROBE
from pipeline.view.compute import compute_fields
from pipeline.view.export import write_fields
from tests.cases import study

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="writes files of one process")


def fields(mesh_only=False, **mesh):
    made = study(mesh={"epsilon": "8 mm"} | mesh)
    (case,) = made.cases()
    return compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=mesh_only)


@pytest.fixture(scope="module")
def curved():
    return fields()


def test_vtu_holds_the_fields(curved, tmp_path):
    read = meshio.read(write_fields(curved, tmp_path / "case.vtu"))
    assert set(read.cells_dict) == {"tetra10"}
    np.testing.assert_array_equal(read.points, curved.points)
    np.testing.assert_array_equal(read.point_data["displacement"], curved.displacement)
    np.testing.assert_array_equal(read.cell_data["element_size"][0], curved.sizes)
    np.testing.assert_array_equal(read.cell_data["max_strain"][0], curved.strain)
    assert set(read.cell_data["within_epsilon"][0]) == {0, 1}
    assert list(tmp_path.iterdir()) == [tmp_path / "case.vtu"]


def test_what_is_marked_as_the_probe_s_moves_with_it(curved, tmp_path):
    read = meshio.read(write_fields(curved, tmp_path / "case.vtu"))
    marked = read.point_data["on_probe"] == 1
    assert marked[np.unique(curved.facets[PROBE])].all()
    np.testing.assert_allclose(read.point_data["displacement"][marked, 2], -0.2e-3, rtol=1e-9)
    # Mid nodes are marked, too: about three for each corner of a triangulation.
    assert marked.sum() > 3 * len(np.unique(curved.facets[PROBE]))
    held = read.point_data["on_support"] == 1
    np.testing.assert_allclose(read.points[held, 2], -20e-3, rtol=1e-9)


def test_mid_nodes_lie_between_their_corners(curved, tmp_path):
    read = meshio.read(write_fields(curved, tmp_path / "case.vtu"))
    nodes = read.points[read.cells_dict["tetra10"]]
    for middle, (a, b) in enumerate(((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)), start=4):
        edge = nodes[:, b] - nodes[:, a]
        offset = np.linalg.norm(nodes[:, middle] - (nodes[:, a] + nodes[:, b]) / 2, axis=1)
        # A quarter-point node is a quarter of the edge away from the middle.
        assert (offset < 0.3 * np.linalg.norm(edge, axis=1)).all()


def test_xdmf_holds_the_same_numbers(curved, tmp_path):
    vtu = meshio.read(write_fields(curved, tmp_path / "case.vtu"))
    grid = Xml.parse(write_fields(curved, tmp_path / "case.xdmf")).getroot().find("Domain/Grid")
    numbers = {
        part.get("Name", part.tag): np.fromstring(item.text, sep=" ").reshape(
            tuple(map(int, item.get("Dimensions").split()))
        )
        for part in grid
        if (item := part.find("DataItem")) is not None
    }
    np.testing.assert_array_equal(numbers["Topology"], vtu.cells_dict["tetra10"])
    np.testing.assert_allclose(numbers["Geometry"], vtu.points, rtol=1e-14)
    for name, values in {**vtu.point_data, **{k: v[0] for k, v in vtu.cell_data.items()}}.items():
        np.testing.assert_allclose(numbers[name], values, rtol=1e-14, err_msg=name)


def test_mesh_alone_and_straight_elements(tmp_path):
    found = fields(mesh_only=True, degree=1, rim="0.5 mm")
    read = meshio.read(write_fields(found, tmp_path / "case.vtu"))
    assert set(read.cells_dict) == {"tetra"}
    assert set(read.point_data) == {"on_probe", "on_support"}
    assert set(read.cell_data) == {"element_size", "within_epsilon"}
