"""Corrections near a fit: a thousandth of the force there, by few cases, which fits near each other share."""

import numpy as np
import pytest

from epsmesh.plan.cost import CostModel
from epsmesh.study.read import read_mapping
from epsmesh_identify.estimation.forward import SceneForce
from epsmesh_identify.surrogate.build import build
from epsmesh_identify.surrogate.cases import domain_of
from epsmesh_identify.surrogate.forecast import forecast
from epsmesh_identify.surrogate.near import smaller
from tests.identify.surrogate.scenes import LAYERED, solved_by

PUNCH = {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "bonded"}
SCENE = LAYERED | {"probe": PUNCH}
BOUNDS = {"young": (1e3, 1e5), "skin_young": (1e4, 1e6), "poisson": (0.0, 0.5)}
FIT = {"young": 9e3, "skin_young": 7e4, "poisson": 0.42}


def _force(case):
    return _of(case.material.young, case.body.layer[0].young, case.material.poisson, case.probe.depth)


def _of(young, skin, poisson, depth):
    """Return the force of a punch that feels a skin, the more the stiffer that is."""
    ratio = np.log(skin / young)
    return young / (1 - poisson**2) * depth * 4e-3 * (1 + 0.5 * np.tanh(ratio) * (1 + poisson**4)) * np.exp(ratio / 5)


def _fit(**changes):
    centre = FIT | changes
    low = {name: 0.95 * value for name, value in centre.items()}
    return low, {name: 1.05 * value for name, value in centre.items()}


@pytest.fixture(scope="module")
def rough():
    """A table with an error of percents, and what was asked for it."""
    domain, asked = domain_of(read_mapping(SCENE, "scene"), BOUNDS, 1e-4), []
    solve = solved_by(_force, bar=1e-5, asked=asked)
    return SceneForce(domain, solve, build(domain, solve, 5e-2)), asked


def test_errors_near_the_fit_are_a_thousandth_and_hold(rough):
    force, asked = rough
    before = len(asked)
    near = force.corrected(force.ranges(*_fit()))
    assert 0 < len(asked) - before < before
    random, depth = np.random.default_rng(2), np.array([3e-5, 1e-4])
    low, high = _fit()
    for _ in range(50):
        values = {name: random.uniform(low[name], high[name]) for name in low}
        exact = _of(values["young"], values["skin_young"], values["poisson"], depth)
        wrong = abs(near.force(depth, values) / exact - 1)
        assert np.all(wrong <= near.error(depth, values)) and np.all(near.error(depth, values) <= 1.01e-3)
    assert force.error(depth, FIT)[0] > 5e-3


def test_beyond_it_the_force_is_that_of_the_table_without_a_step(rough):
    force, _ = rough
    near, depth = force.corrected(force.ranges(*_fit())), np.array([1e-4])
    (ratio, _) = near.near.ranges
    sides = [FIT | {"young": FIT["skin_young"] / (ratio.high * (1 + by))} for by in (-1e-7, 1e-7)]
    inside, outside = (near.force(depth, values)[0] for values in sides)
    assert outside == pytest.approx(inside, rel=1e-6)
    far = FIT | {"young": 2e3}
    assert near.error(depth, far) == force.error(depth, far)


def test_fits_that_are_near_each_other_have_the_same_cases(rough):
    force, asked = rough
    force.corrected(force.ranges(*_fit()))
    before = len(asked)
    force.corrected(force.ranges(*_fit(young=9.1e3)))
    assert len(asked) == before


def test_smaller_ranges_have_the_bar_and_are_within_the_whole_one(rough):
    force, _ = rough
    for poisson in (0.0, 0.2, 0.33, 0.49, 0.5):
        low, high = _fit(poisson=poisson)
        own = dict(zip(("ratio", "poisson"), smaller(force.table, low, high), strict=True))["poisson"]
        assert own.low <= low["poisson"] and min(high["poisson"], 0.5) <= own.high
        assert 0.0 <= own.low < own.high <= 0.5 and own.high - own.low <= 0.26


def test_an_exact_table_has_no_correction(rough):
    force, _ = rough
    bounds = {"young": (8e3, 1e4), "skin_young": (6e4, 8e4), "poisson": (0.3, 0.5)}
    domain = domain_of(force.domain.scene, bounds, 1e-4)
    exact = SceneForce(domain, force.solve, build(domain, force.solve, 5e-4))
    assert exact.ranges(*_fit()) == ()


def test_the_forecast_has_the_correction():
    domain = domain_of(read_mapping(SCENE, "scene"), BOUNDS, 1e-4)
    whole, corrected = (forecast(domain, CostModel(), corrected=also) for also in (False, True))
    assert corrected.most == whole.most + 5
