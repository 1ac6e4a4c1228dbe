"""Forces times factors: exact wherever the unknowns are."""

import numpy as np
import pytest

from epsmesh_identify.estimation.tabulated import tabulated
from tests.identify.estimation.synthetic import POISSON, YOUNG, Ball, Punch

DEPTH = np.linspace(-1e-5, 2e-4, 50)


@pytest.mark.parametrize(
    ("forward", "modulus"),
    [(Ball(), "young"), (Punch(layer=1.0), ""), (Ball(names=("young", "poisson")), "")],
)
def test_forces_with_a_factor_are_those_of_the_scene(forward, modulus):
    about = {name: value for name, value in (("young", 2e4), ("poisson", 0.45)) if name in forward.names}
    made = tabulated(forward, [YOUNG, POISSON], about, 2e-4)
    assert made.modulus == modulus
    bent = made.times(1 + 1e3 * made.roots**2)
    for young, poisson in ((2e4, 0.45), (9e5, 0.2), (2e3, 0.5)):
        values = {name: value for name, value in (("young", young), ("poisson", poisson)) if name in forward.names}
        expected = forward.force(DEPTH, values)
        small = 1e-6 * expected.max()
        assert made.force(DEPTH, values) == pytest.approx(expected, rel=1e-3, abs=small)
        assert bent.force(DEPTH, values) == pytest.approx(expected * (1 + 1e3 * DEPTH), rel=2e-3, abs=small)
