"""Verification itself: the quick rows are right, and a wrong number is called out."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from typer.testing import CliRunner

from epsmesh import cli, verify
from epsmesh.verify import Row
from tests.verification import contacts, known, rollers, table
from tests.verification.bodies import body_rows
from tests.verification.boundary import rectangle_stiffness
from tests.verification.capsules import capsule_rows
from tests.verification.loads import load_rows


@pytest.fixture(scope="module")
def installed():
    return list(verify.rows(MPI.COMM_SELF))


def test_the_installed_rows_are_right(installed):
    assert len(installed) == 10
    assert not [row for row in installed if not row.is_right]
    assert {row.path for row in installed} == {"2D", "3D"}


def test_a_force_two_bars_off_is_out(installed):
    for row in installed:
        wrong = row.reference * (1 + 2 * (row.bar + row.reference_bar))
        assert not replace(row, value=wrong).is_right
        assert not replace(row, value=float("nan")).is_right


@pytest.mark.parametrize("rows", [load_rows, body_rows, pytest.param(capsule_rows, marks=pytest.mark.nightly)])
def test_loads_and_bodies_have_their_closed_forms(rows):
    assert not [row for row in rows(MPI.COMM_SELF, quick=True) if not row.is_right]


@pytest.mark.nightly
def test_quick_rows_of_the_table_are_right():
    assert not [row for row in table.rows(MPI.COMM_SELF, quick=True) if not row.is_right]


@pytest.mark.parametrize(("ratio", "published"), known.RECTANGLE.items())
def test_boundary_elements_agree_with_published_rectangles(ratio, published):
    value, error = rectangle_stiffness(ratio)
    assert value == pytest.approx(published, rel=error + 5e-4)


def test_closed_forms_meet_in_their_limits():
    """A round ellipse is a disc, a long one a line; incompressible tissue does not feel whether a disc is bonded."""
    disc, _ = known.half_space_disc(1e4, 0.3, 1e-3, 1e-5, "frictionless")
    assert known.half_space_ellipse(1e4, 0.3, (1e-3, 1e-3), 1e-5)[0] == pytest.approx(disc)
    wide = [known.half_space_ellipse(1e4, 0.3, axes, 1e-5)[0] for axes in ((1e-3, 2e-3), (2e-3, 1e-3), (1e-3, 1e-3))]
    assert wide[0] == wide[1] > wide[2]
    bonded, free = (known.half_space_disc(1e4, 0.5, 1e-3, 1e-5, contact)[0] for contact in ("bonded", "frictionless"))
    assert bonded == pytest.approx(free)


def test_command_fails_if_a_row_is_out(monkeypatch):
    right = Row("scene", "3D", 1.0, "source", np.float64(1.001), 0.01)
    for few, status in (([right], 0), ([right, replace(right, value=1.1)], 1)):
        monkeypatch.setattr(verify, "rows", lambda *_, few=few, **__: iter(few))
        result = CliRunner().invoke(cli.app, ["verify"])
        assert result.exit_code == status
        assert ("1 out" in result.output) == bool(status)
        told = json.loads(CliRunner().invoke(cli.app, ["verify", "--json"]).stdout)
        assert [row["right"] for row in told] == [True, False][: len(few)]


def test_a_roller_on_a_block_is_hertzian():
    """On a coarse mesh, its width and pressure are within its bars of those of two half-spaces in plane strain."""
    found = rollers.pressed(MPI.COMM_SELF, {"rim": 0.8, "growth": 0.8})
    half, pressure = rollers.hertz(found.load)
    assert found.load == pytest.approx(rollers.LOAD, rel=found.load_bar)
    assert abs(found.half / half - 1) < found.half_bar + 5e-3 < 0.05
    assert found.pressure == pytest.approx(pressure, rel=0.03)


@pytest.mark.nightly
def test_rows_of_the_roller_are_within_half_a_per_cent():
    found = list(rollers.roller_rows(MPI.COMM_SELF))
    assert len(found) == 3
    assert all(row.is_right and abs(row.error) < 5.5e-3 for row in found)


@pytest.mark.nightly
def test_rows_of_two_elastic_bodies_are_within_half_a_per_cent():
    found = list(contacts.elastic_rows(MPI.COMM_SELF))
    assert len(found) == 6
    assert all(row.is_right and abs(row.error) < 4e-3 for row in found)
