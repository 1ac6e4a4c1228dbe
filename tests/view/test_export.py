"""Files for ParaView hold the fields, in VTK's order of nodes."""

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.solved import solve_alone, solve_fields
from epsmesh.scene.model import PROBE
from epsmesh.view.compute import compute_fields, fields_of
from epsmesh.view.export import write_fields
from tests.cases import study


def fields(mesh_only=False, **mesh):
    made = study(mesh={"epsilon": "8 mm"} | mesh)
    (case,) = made.cases()
    return compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=mesh_only, stress=True)


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


def test_mesh_alone_and_straight_elements(tmp_path):
    found = fields(mesh_only=True, degree=1, rim="0.5 mm")
    read = meshio.read(write_fields(found, tmp_path / "case.vtu"))
    assert set(read.cells_dict) == {"tetra"}
    assert set(read.point_data) == {"on_probe", "on_support"}
    assert set(read.cell_data) == {"element_size", "within_epsilon", "region"}


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_cells_have_the_degree_of_the_displacement_and_the_values_of_the_solution(degree, tmp_path):
    layer = {"name": "skin", "young": "30 kPa", "poisson": 0.3, "thickness": "4 mm"}
    made = study(mesh={"degree": degree, "rim": "1.5 mm"}, body={"layer": [layer]}, probe={"radius": "4 mm"})
    (case,) = made.cases()
    solved = solve_fields(solve_alone(made, case), MPI.COMM_SELF, bar=False)
    read = meshio.read(write_fields(fields_of(solved, stress=True), tmp_path / "case.vtu"))
    ((kind, cells),) = read.cells_dict.items()
    nodes = {1: "tetra", 2: "tetra10", 3: "VTK_LAGRANGE_TETRAHEDRON"}
    assert (kind, cells.shape[1]) == (nodes[degree], {1: 4, 2: 10, 3: 20}[degree])
    if degree == 3:  # VTK's nodes 4 and 5 divide the first edge in three, its node 16 is in the middle of 0, 1 and 3
        corners, edge, middle = (read.points[cells[:, of]] for of in ([0, 1, 2, 3], [4, 5], [16]))
        straight = np.abs(edge[:, 0] * 2 - edge[:, 1] - corners[:, 0]).max(axis=1) < 1e-9
        assert straight.mean() > 0.5
        np.testing.assert_allclose(edge[straight, 0], (2 * corners[straight, 0] + corners[straight, 1]) / 3, atol=1e-9)
        assert (np.abs(middle[:, 0] - corners[:, [0, 1, 3]].mean(axis=1)).max(axis=1) < 1e-9).mean() > 0.3
    volumes = np.linalg.det(read.points[cells[:, 1:4]] - read.points[cells[:, :1]])
    assert (volumes > 0).all()
    which = np.random.default_rng(0).choice(len(read.points), 100)
    values = solved.state.at(read.points[which])
    inside = np.isfinite(values.displacement[:, 0])
    assert inside.mean() > 0.95
    moved = read.point_data["displacement"][which]
    np.testing.assert_allclose(moved[inside], values.displacement[inside], atol=1e-8)
    centre = read.points[cells[:, :4]].mean(axis=1)
    at_centre = solved.state.at(centre)
    stress = read.cell_data["stress"][0]
    straight = np.isclose(stress, at_centre.stress.reshape(-1, 9), rtol=1e-6, atol=1e-6).all(axis=1)
    assert straight.mean() > (0.99 if degree == 1 else 0.3)
    skin = read.cell_data["region"][0] == 1
    np.testing.assert_array_equal(skin, centre[:, 2] > -4e-3)
