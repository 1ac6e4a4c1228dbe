"""A wrong unit shows as a depth that no tool goes to, or as a modulus that no tissue has."""

import numpy as np
import pytest
import xarray as xr

from epsmesh.study.read import parse
from epsmesh_identify.estimation.doubts import doubts_of_force, doubts_of_moduli, doubts_of_radius, doubts_of_scale
from epsmesh_identify.estimation.experiment import cases_of
from epsmesh_identify.estimation.parts import Measured, Unknown
from epsmesh_identify.experiment.curve import Curve
from tests.cases import raw
from tests.identify.estimation.synthetic import YOUNG, Ball


@pytest.mark.parametrize(
    ("factor", "part"), [(1.0, ""), (1e3, "half widths"), (1e-3, ""), (1e-5, "half widths"), (30.0, "thick")]
)
def test_depths(factor, part):
    study = parse(raw() | {"measurement": [{"name": "a", "file": "a.csv"}]})  # a tool of 3 mm on 20 mm of tissue
    curve = Curve("a", factor * np.linspace(0, 1e-3, 20), np.linspace(0, 1, 20))
    said = list(doubts_of_scale(cases_of(study), [curve]))
    assert len(said) == bool(part) and part in "".join(said)


@pytest.mark.parametrize("values", [[10e3, 0.4], [[10e3, 0.4], [10e9 * 1e3, 0.4]], [10.0, 0.4]])
def test_moduli(values):
    values = np.array(values)
    rows = ("file", "unknown")[2 - values.ndim :]
    dataset = xr.Dataset(
        {"estimate": (rows, values), "unit": ("unknown", np.array(["Pa", "1"], dtype=object))},
        {"unknown": ["young", "poisson"]},
    )
    said = doubts_of_moduli(dataset)
    assert len(said) == bool((values[..., 0] < 100).any() or (values[..., 0] > 1e10).any())
    assert all("young" in line and "unit" in line for line in said)


BALL = Ball(radius=0.75**4)  # F = E d^1.5 in SI units
MACHINE = Unknown("machine_stiffness", 3.0, 100.0, "N/m", is_logarithmic=True)


@pytest.mark.parametrize(
    ("factor", "part"), [(1.0, ""), (30.0, ""), (1e-3, "is below the"), (1e3, "is above the"), (1e6, "mN for µN")]
)
def test_forces_that_no_modulus_of_the_range_gives(factor, part):
    depth = np.linspace(0, 2e-3, 200)
    curve = Curve("punch", depth + 0.03, factor * BALL.force(depth - 1e-3, {"young": 20e3}))
    said = doubts_of_force([Measured(curve, BALL)], [YOUNG])
    assert len(said) == bool(part) and part in "".join(said)


def test_a_soft_machine_is_no_doubt():
    """The machine has most of the way: on a rigid one the modulus would be far below its range."""
    depth = np.linspace(0, 1e-3, 200)
    force = BALL.force(depth, {"young": 2e3})
    curve = Curve("punch", depth + 0.2 * force, force)
    assert "is below" in doubts_of_force([Measured(curve, BALL)], [YOUNG])[0]
    assert not doubts_of_force([Measured(curve, BALL, machine_compliance=0.2)], [YOUNG])
    assert not doubts_of_force([Measured(curve, BALL, machine_compliance=None)], [YOUNG, MACHINE])


@pytest.mark.parametrize(
    ("probe", "radius", "less"),
    [
        ({"shape": "sphere", "radius": "3 mm", "depth": "0.1 mm"}, "3.00 mm", 5),
        ({"shape": "disc", "radius": "2 mm", "depth": "0.1 mm"}, "2.00 mm", 9),
        ({"shape": "paraboloid", "radius": "3 mm", "shaft": "2 mm", "depth": "0.1 mm"}, "3.00 mm", 5),
        ({"shape": "blade", "length": "4 mm", "width": "1 mm", "depth": "0.1 mm"}, "", 0),
    ],
)
def test_what_an_error_of_the_radius_does(probe, radius, less):
    contact = "unilateral" if probe["shape"] in ("sphere", "paraboloid") else "frictionless"
    case = next(parse(raw(probe={**probe, "contact": contact})).cases())
    said = list(doubts_of_radius([case], [YOUNG]))
    assert len(said) == bool(radius)
    assert not radius or (f"radius of {radius}" in said[0] and f"E is about {less} % less" in said[0])
    assert not list(doubts_of_radius([case], [YOUNG, Unknown("radius of a", 1e-3, 4e-3, "m")]))
