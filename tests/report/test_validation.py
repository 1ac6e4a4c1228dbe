"""The table of what the program was compared with."""

import pytest

from epsmesh.report.validation import comparisons, unchecked
from epsmesh.solve.laws import LAWS

TOOLS = {"disc", "sphere", "plate"}


@pytest.mark.parametrize("row", comparisons(), ids=lambda row: row.name)
def test_a_comparison_is_complete_and_its_parts_fit(row):
    assert 0 < row.mesh_bar <= row.ours_bar
    assert row.reference_bar > 0
    assert row.scene.tool in TOOLS
    assert row.scene.law in LAWS
    assert 0 <= row.scene.size <= 1
    assert 0 < row.scene.strain <= row.scene.depth < 1
    assert bool(row.calibrated) == ("young" in row.given) == (row.kind == "experiment")


def test_theory_agrees_and_what_disagrees_has_a_note():
    assert all(row.agrees for row in comparisons() if row.kind == "theory")
    assert all(row.note for row in comparisons() if not row.agrees)
    assert any(not row.agrees for row in comparisons())


def test_names_are_unique_and_sources_are_cited():
    names = [row.name for row in (*comparisons(), *unchecked())]
    assert len(names) == len(set(names))
    assert all(row.source and row.reason for row in unchecked())
