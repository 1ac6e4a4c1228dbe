"""The integral equation that wedges on strips are held against, where strips are very thick and very thin."""

from math import log, pi

import pytest

from tests.verification.layer_wedge import layer_wedge


def test_a_very_thick_strip_is_a_half_plane():
    """F = E* m b, and between two thicknesses the depth grows by 2/π m b times the logarithm of their ratio."""
    (first, force), (second, _) = (layer_wedge(0.1, 2.0, h, 0.3) for h in (1e4, 2e4))
    assert force == pytest.approx(0.2, rel=1e-6)
    assert second - first == pytest.approx(2 / pi * 0.2 * log(2), rel=1e-6)


def test_a_very_thin_strip_is_a_bed_of_springs():
    """Each point bears its depth times E (1 - ν) / ((1 + ν) (1 - 2 ν) h): d = m b, F = M m b² / h."""
    depth, force = layer_wedge(0.1, 1.0, 0.1, 0.3)
    confined = (1 - 0.3) ** 2 / (1 - 2 * 0.3)  # M / E*
    assert depth == pytest.approx(0.1, rel=0.03)
    assert force == pytest.approx(confined * 0.1 / 0.1, rel=0.05)
