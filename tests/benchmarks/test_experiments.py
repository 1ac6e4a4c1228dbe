"""Comparisons with published measurements: the table, calibration, and one published case."""

import tomllib
from math import pi

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.experiments import STUDIES, between, fitted_young, plates, table, with_bar
from benchmarks.machine import ROOT
from epsmesh.report.validation import comparisons
from tests.verification.compare import record_of


def force_of(compression):
    """F (N) of a column that slides at both ends: neo-Hookean, E = 1 Pa."""
    stretch = 1 - compression / 30e-3
    return np.pi * 25e-3**2 / 3 * (stretch**-2 - stretch)


COLUMN = force_of(np.array([0.5e-3, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3]))


def test_the_table_is_that_of_the_comparisons():
    written = (ROOT / "benchmarks" / "results" / "experiments.md").read_text(encoding="utf-8")
    assert table() in written
    trust = (ROOT / "docs" / "why" / "trust.md").read_text(encoding="utf-8")
    assert all(row.name.split(",")[0] in written for row in comparisons())
    assert "results/experiments.md" in trust


def test_e_and_the_contact_point_are_those_of_a_made_curve():
    depth = np.linspace(0.5e-3, 3e-3, 40)
    force = 40e3 * force_of(np.clip(depth - 0.15e-3, 0, None))
    assert fitted_young(COLUMN, depth, force) == pytest.approx(40e3, rel=1e-3)
    found = plates((COLUMN, 0.02 * COLUMN), 40e3, 1e3, 40e3 * force_of(2e-3), 40e3 * force_of(5e-3))
    assert found.value == pytest.approx(3.0, rel=1e-3)
    # A mesh whose force is off by the same share everywhere changes E alone.
    assert found.mesh_bar < 0.01 < found.bar


def test_between_reads_the_first_passage_through_noise():
    depth = np.linspace(0, 1e-3, 11)
    force = np.array([0, 1, 2, 1.5, 3, 4, 5, 6, 7, 8, 9.0])
    assert between(depth, force, 1.0, 8.0) == pytest.approx(0.8e-3)


def test_a_bar_has_two_digits():
    assert with_bar(0.13294, 0.00221) == "0.1329 ± 0.0022"
    assert with_bar(231.2, 12.3) == "231 ± 12"


@pytest.mark.nightly
def test_a_published_punch_has_its_force_at_the_tabulated_depth():
    """With the displacement of the aluminium, and the shortening of the steel, F is that of the benchmark."""
    smooth, rough = (row for row in comparisons() if row.source.startswith("A. Konter"))
    study = tomllib.loads((STUDIES / "rounded-punch.toml").read_text(encoding="utf-8"))
    force = pi * 50e-3**2 * 100e6
    assert study["probe"].pop("force") == f"{force / 1e3:.3f} kN"
    # A rod of steel shortens by p H / E = 0.0476 mm under a uniform pressure.
    study["probe"] |= {"depth": f"{smooth.ours + 0.0466} mm", "friction": 0}
    found = record_of(MPI.COMM_SELF, study | {"solve": {"exact": False}})
    assert found.force == pytest.approx(force, rel=found.force_error + smooth.mesh_bar / smooth.ours)
    assert found.force_error < 5e-3
    shortening = 1e3 * found.largest["tool_shortening"]
    assert shortening == pytest.approx(100 / 210e3 * 100, rel=0.05)
    assert 0.0466 + smooth.ours - shortening == pytest.approx(smooth.ours, abs=smooth.mesh_bar)
    assert smooth.agrees
    assert rough.agrees
