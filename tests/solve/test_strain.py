"""The largest strain, taken clear of the probe's edge, where it grows as elements shrink."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import conditions_of
from epsmesh.solve import cell_values
from epsmesh.solve.cell_values import CellValues
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from epsmesh.study.problems import StudyError
from tests.cases import solve, study
from tests.solve.test_slit import case_of

ROUND = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "fixed": "bottom"}
MESH = {"fine": "2 mm", "growth": 0.4}


def strain(**changes):
    (record,) = solve(body=ROUND, **changes).values()
    return record.max_strain


def test_converges_as_the_edge_is_refined():
    """It is nearly the depth over the radius, whatever the size of elements at the edge."""
    truth = strain(plan={"without": []})
    assert truth == pytest.approx(0.9 * 0.2 / 3, rel=0.05)
    coarse, fine = (strain(mesh=MESH | {"rim": rim}) for rim in ("0.6 mm", "0.15 mm"))
    assert coarse == pytest.approx(truth, rel=0.25)
    assert fine == pytest.approx(truth, rel=0.1)


def test_strain_at_the_front_of_a_slit_is_left_out_of_its_own_body_only():
    """On one mesh, the mask of clear cells is kept for each front separately."""
    case = case_of()
    mesh = mesh_case(case, ("x", "y"), MPI.COMM_SELF)
    front, law = conditions_of(case).front, MaterialLaw.of_moduli(1.0, 0.3)
    with Spaces(mesh) as spaces:
        u = spaces.get(2, conditions_of(case)).forms.displacement

        def stretched(x):
            along, down = (x.T - np.array(front.point)) @ np.array(front.normal), x[2] + front.depth
            return down * np.exp(-(along**2 + down**2) / 0.2e-3**2) * np.array([[0.0], [0.0], [1.0]])

        u.interpolate(stretched)
        values = CellValues(mesh, u)
        with_front, without, again = (values.largest(law, line)["max_strain"] for line in (front, None, front))
    assert with_front == again < 0.9 * without


def test_an_unknown_value_is_nan_and_not_zero(monkeypatch):
    """The formula of stress for displacement elements is wrong for mixed ones, where it returns NaN."""

    def stress(cells):
        hookes = cells.lame_lambda * cells.principal_strains.sum(axis=1)
        hookes += 2 * cells.lame_mu * cells.principal_strains[:, -1]
        return np.full_like(hookes, np.nan) if cells.is_mixed else hookes

    monkeypatch.setitem(cell_values.CELL_MAXIMA, "stress", stress)
    case = case_of()
    mesh = mesh_case(case, ("x", "y"), MPI.COMM_SELF)
    law, strains = MaterialLaw.of_moduli(10e3, 0.3), np.array([-3e-3, 1e-3, -2e-3])
    with Spaces(mesh) as spaces:
        u = spaces.get(2, conditions_of(case)).forms.displacement
        u.interpolate(lambda x: strains[:, None] * x)
        known, unknown = (CellValues(mesh, u, is_mixed=kind).largest(law) for kind in (False, True))
    pulled = law.lame_lambda[0] * strains.sum() + 2 * law.lame_mu[0] * strains.max()
    assert known["stress"] == pytest.approx(pulled, rel=1e-9)
    assert pulled < 0
    assert np.isnan(unknown["stress"])
    assert unknown["max_strain"] == pytest.approx(3e-3)


@pytest.mark.parametrize(("depth", "allowed"), [("19.9 mm", True), ("20 mm", False), ("30 mm", False)])
def test_a_depth_that_the_body_does_not_have_is_an_error(depth, allowed):
    if allowed:
        assert study(probe={"depth": depth}).shape == ()
        return
    with pytest.raises(StudyError, match="must be below 20 mm, the thickness of the tissue"):
        study(probe={"depth": depth})
