"""A wrong unit shows as a depth that no tool goes to, or as a modulus that no tissue has."""

import numpy as np
import pytest

from pipeline.experiment.curve import Curve
from pipeline.identify.doubts import doubt_of_modulus, doubts_of_scale
from tests.cases import study


@pytest.mark.parametrize(("factor", "part"), [(1e3, "half widths"), (1e-3, ""), (1e-5, "half widths"), (30.0, "thick")])
def test_depths(factor, part):
    case = study().case(())  # a tool of 3 mm on 20 mm of tissue
    said = doubts_of_scale(Curve("a", factor * np.linspace(0, 1e-3, 20), np.linspace(0, 1, 20)), case)
    assert len(said) == bool(part) and part in "".join(said)
    assert not doubts_of_scale(Curve("a", np.linspace(0, 1e-3, 20), np.linspace(0, 1, 20)), case)


@pytest.mark.parametrize(("young", "doubted"), [(10e3, False), (3e9, False), (10e3 * 1e-3, True), (1e9 * 1e3, True)])
def test_moduli(young, doubted):
    assert ("unit" in doubt_of_modulus(young)) == doubted
