"""The same experiment in other units, from another zero, with fewer rows, and rows in another order."""

import numpy as np
import pytest

from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import Measured
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.read import read_curve
from epsmesh_identify.experiment.reading import Reading
from tests.identify.estimation.synthetic import YOUNG, Ball, Punch, measured, noise
from tests.identify.experiment.curves import write

FLAT = Punch(names=("young",))
# A law, its noise and correlation, the tilt of the baseline.
CURVES = {
    "ball": (Ball(), 0.003, 0.6, 0.0),
    "ball, slow noise": (Ball(), 0.01, 0.9, 0.02),
    "punch": (FLAT, 0.005, 0.3, -0.03),
    "without noise": (Ball(), 0.0, 0.0, 0.0),
}


def curve_of(name):
    law, level, correlation, tilt = CURVES[name]
    error = level * noise(np.random.default_rng(3), 240, correlation)
    return measured(law, {"young": 2e4}, error, 2e-4, 0.7, tilt=tilt)


def written(path, curve, length, force, rows=slice(None)):
    """Write a curve in units of a ``length`` and a ``force``, by name and size."""
    columns = {"time (s)": curve.time, f"depth ({length[0]})": curve.depth / length[1]}
    columns |= {f"force ({force[0]})": curve.force / force[1]}
    return write(path, {name: column[rows] for name, column in columns.items()})


@pytest.mark.parametrize("name", CURVES)
def test_units_and_zeros_change_nothing_and_fewer_rows_little(tmp_path, name):
    one = curve_of(name)
    forward = one.forward

    def found(curve):
        fit = identify([Measured(curve, forward)], [YOUNG])
        assert fit.fits
        return fit.estimate[0], fit.low[0], fit.high[0]

    si = read_curve(written(tmp_path / "si.csv", one.curve, ("m", 1.0), ("N", 1.0)), Reading())
    small = read_curve(written(tmp_path / "small.csv", one.curve, ("µm", 1e-6), ("nN", 1e-9)), Reading())
    moved = Curve("moved", si.depth + 0.02, si.force - 0.3 * np.ptp(si.force), si.time + 50.0)
    whole = found(si)
    width = whole[2] - whole[1]
    for other in (small, moved):
        assert found(other) == pytest.approx(whole, abs=0.01 * width)
    thin = found(Curve("thin", si.depth[::2], si.force[::2], si.time[::2]))
    assert abs(thin[0] - whole[0]) < np.hypot(width, thin[2] - thin[1]) / 2
    assert 0.5 < (thin[2] - thin[1]) / width < 2.0
    assert thin[1] <= 2e4 <= thin[2]
