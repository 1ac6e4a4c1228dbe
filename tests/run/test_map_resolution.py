"""What `view` says of a stiffness map's voxels: the change of F with an image of voxels twice as wide."""

import nrrd
import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.map_resolution import change_with_wider_voxels
from epsmesh.run.solved import solve_alone, solve_fields
from epsmesh.shapes.files.value_map import ValueMap
from epsmesh.study.read import read_mapping
from tests.cases import raw


def _solved(folder, values, affine, **changes):
    header = {"space": "right-anterior-superior", "space directions": affine[:, :3] * 1e3}
    nrrd.write(str(folder / "map.nrrd"), values, header | {"space origin": affine[:, 3] * 1e3})
    material = {"young": {"file": "map.nrrd", "unit": "kPa"}} | changes
    study = read_mapping(raw(material=material), "study", folder)
    solve = solve_alone(study, study.case(()))
    return solve_fields(solve, MPI.COMM_SELF, bar=True, influence=True)


@pytest.mark.parametrize(
    "law",
    [{}, *(pytest.param(law, marks=pytest.mark.nightly) for law in ({"law": "neo-hookean"}, {"poisson": 0.49}))],
    ids=str,
)
def test_it_is_the_change_of_a_solve_with_wider_voxels(tmp_path, law):
    x, _, z = np.indices((24, 24, 12))
    values = 10.0 + 3.0 * np.exp(-z / 6) * np.sin(2 * x / 3) + 0.5 * z
    affine = np.column_stack([np.eye(3) * 2e-3, [-23e-3, -23e-3, -23e-3]])
    fine = _solved(tmp_path, values, affine, **law)
    size, change = change_with_wider_voxels(fine)
    assert size == pytest.approx(2e-3)
    wider = ValueMap(values, affine).coarsened()
    coarse = _solved(tmp_path, wider.values, wider.affine, **law)
    assert change_with_wider_voxels(coarse)[0] == pytest.approx(4e-3)
    found = coarse.record.force / fine.record.force - 1
    assert abs(found) > 1e-3
    assert change == pytest.approx(found, rel=0.1, abs=2e-4)


def test_without_an_image_nothing_is_said(tmp_path):
    study = read_mapping(raw(material={"young": {"formula": "10 kPa*(1 - z/(10 mm))"}}), "study", tmp_path)
    solved = solve_fields(solve_alone(study, study.case(())), MPI.COMM_SELF, bar=True, influence=True)
    assert change_with_wider_voxels(solved) is None
