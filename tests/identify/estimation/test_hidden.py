"""The second bar is that of all hidden parts that go with the curve, however finely their ranges are covered."""

import numpy as np

from epsmesh_identify.estimation import hidden
from epsmesh_identify.estimation.fit import fit
from epsmesh_identify.estimation.hidden import hidden_bars
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.estimation.start import start
from tests.identify.estimation.synthetic import YOUNG, Ball, measured, noise


class Coating:
    """A factor that a curve can hardly tell from another modulus."""

    kind = "layer"
    unknowns = (Unknown("hidden_stiffness", 0.2, 5.0, "1", True, (1.0, 0.8), False),)

    def factor(self, depth, values):
        return values["hidden_stiffness"] ** (1 - 1e2 * np.minimum(depth, 1e-3))


def test_the_second_bar_does_not_depend_on_the_cells(monkeypatch):
    error = 0.01 * noise(np.random.default_rng(1), 200, 0.6)
    curve = measured(Ball(), {"young": 2e4}, error, 2e-4)
    model = Model.of([hidden.replace(curve, hidden=(Coating(),))], [YOUNG])
    found = fit(model, start(model))
    low, high = (ends[0] for ends in hidden_bars(found, (0,)))
    # The factor's exponent is 0.98 or more: E is 95 % within what its prior leaves.
    span = np.log(1e6 / 1e3)
    assert (high - low) / 2 * span > 1.5 * 0.8
    monkeypatch.setattr(hidden, "_POINTS", {1: 60})
    finer = [ends[0] for ends in hidden_bars(found, (0,))]
    assert np.abs(np.array(finer) - [low, high]).max() < 0.06 * (high - low)
