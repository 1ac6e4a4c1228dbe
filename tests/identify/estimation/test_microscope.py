"""Curves of balls on soft gels as force microscopes record them: E of the ball's own formula, Hertz's, and adhesion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from epsmesh.study.read import parse
from epsmesh_identify.estimation.attraction import attraction
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.hertz import hertz_young
from epsmesh_identify.estimation.parts import Measured, Unknown
from epsmesh_identify.estimation.tabulated import tabulated
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.layered.body import RIGID, LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from tests.cases import raw
from tests.identify.estimation.layers import OnLayers
from tests.identify.estimation.synthetic import Ball, measured, noise

RADIUS, TRUTH, DEEPEST = 5e-6, 1200.0, 0.5e-6
SOFT = Unknown("young", 10.0, 1e6, "Pa", is_logarithmic=True)
GEL = raw(
    body={"shape": "cylinder", "radius": "5 mm", "height": "5 mm", "size": None},
    material={"poisson": 0.5},
    probe={"shape": "sphere", "radius": "5 µm", "depth": "0.5 µm", "contact": "unilateral"},
)


def sneddon(depth):
    """Return the force (N) of a sphere on a half-space (I. N. Sneddon, Int. J. Eng. Sci. 3, 47, 1965)."""

    def width(one):
        return brentq(lambda a: a / 2 * np.log((RADIUS + a) / (RADIUS - a)) - one, 0.0, 0.999 * RADIUS)

    a = np.array([width(one) if one > 0 else 0.0 for one in depth])
    shape = (a**2 + RADIUS**2) / 2 * np.log((RADIUS + a) / (RADIUS - a)) - a * RADIUS
    return TRUTH / 0.75 * shape


def hertz(depth):
    """Return the force (N) of a paraboloid on a half-space."""
    return 4 / 3 * TRUTH / 0.75 * np.sqrt(RADIUS) * np.maximum(depth, 0.0) ** 1.5


@pytest.fixture(scope="module")
def ball():
    """Return the force of the ball on a deep gel, by the program's own equation."""
    profile = Profile(lambda r: r / np.sqrt(RADIUS**2 - r**2), limit=0.99 * RADIUS)
    body = lambda values: LayeredBody((Layer(values["young"], 0.5, 5e-3),), RIGID)  # noqa: E731
    return tabulated(OnLayers(profile, body, ("young",)), [SOFT], {"young": TRUTH}, DEEPEST)


def curve(law, level=0.0, seed=1, dip=0.0, rows=400):
    """Return a curve of a law, recorded as the way of a piezo with a spring of 0.05 N/m, and an offset of the force."""
    depth = np.linspace(-DEEPEST, DEEPEST, rows)
    force = law(depth)
    top = force.max()
    force = force - np.where(depth > -0.05e-6, dip * top * np.exp(-(depth + 0.05e-6) / 0.06e-6), 0.0)
    way = depth + force / 0.05 + 1e-5
    return Curve("tip", way, force + top * (0.1 + level * noise(np.random.default_rng(seed), rows, 0.5)), None)


def tip(curve, forward):
    return Measured(curve, forward, 1 / 0.05)


@pytest.mark.parametrize("level", [0.0, 3e-3])
def test_the_modulus_is_that_of_the_balls_own_formula(ball, level):
    found = identify([tip(curve(sneddon, level), ball)], [SOFT])
    assert found.fits
    assert found.low[0] <= TRUTH <= found.high[0]
    assert found.estimate[0] == pytest.approx(TRUTH, rel=1e-3 if level == 0 else 1e-2)


def test_hertzs_modulus_is_what_other_programs_find(ball):
    case = next(parse(GEL).cases())
    one = tip(curve(hertz), ball)
    found = identify([one], [SOFT])
    assert hertz_young(case, one, found) == pytest.approx(TRUTH, rel=1e-5)
    exact = tip(curve(sneddon), ball)
    by_hertz = hertz_young(case, exact, identify([exact], [SOFT]))
    assert 0.98 * TRUTH < by_hertz < 0.995 * TRUTH  # a ball is softer than its paraboloid at a tenth of its radius
    cone = case.probe.model_copy(update={"contact": "bonded"})
    assert hertz_young(replace(case, probe=cone), one, found) is None
    assert hertz_young(case, one, replace(found, unknowns=(*found.unknowns, replace(SOFT, name="poisson")))) is None


def test_much_adhesion_is_no_fit_and_a_little_is_told(ball):
    much = identify([tip(curve(sneddon, 2e-3, dip=0.2), ball)], [SOFT])
    assert "adhesion or a snap" in much.verdict
    assert np.isnan(much.low).all()
    little = identify([tip(curve(sneddon, 2e-3, dip=0.02), ball)], [SOFT])
    assert not little.fits or any("adhesion" in sentence for sentence in little.notes)
    assert not any("adhesion" in sentence for sentence in identify([tip(curve(sneddon, 2e-3), ball)], [SOFT]).notes)


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.99])
def test_noise_is_no_adhesion(correlation):
    false = 0
    for seed in range(150):
        rng = np.random.default_rng((seed, 7))
        error = 0.03 * noise(rng, int(rng.integers(120, 400)), correlation, rng.uniform(0, 0.4))
        false += attraction(measured(Ball(), {"young": 2e4}, error, 2e-4, rng.uniform(0.2, 1.5)).curve) > 0
    assert false <= 3


@pytest.mark.parametrize("onset", [12e-9, 20e-9])
def test_a_rough_contact_is_no_fit_or_within_its_bar(onset):
    """Contact that sets in over some nanometres is no noise: slow noise would absorb it, the baseline off the air."""
    truth, spring, law = 15e3, 0.0435, Ball(10e-6)
    deep = np.linspace(-0.6e-6, 0.3e-6, 20000)
    force = law.force(onset * np.logaddexp(0, deep / onset), {"young": truth})
    way = deep + force / spring
    for seed in (0, 2, 4):
        rng = np.random.default_rng(seed)
        at = np.linspace(-0.48e-6, way[np.searchsorted(force, 3.9e-9)], 290)
        recorded = np.interp(at, way, force) - 0.5e-9 + 0.0125e-9 * rng.normal(size=290)
        height = 3.1e-9 * np.round((at + 3e-9 * rng.normal(size=290)) / 3.1e-9)
        found = identify([Measured(Curve("tip", height, recorded), law, 1 / spring)], [SOFT])
        assert not found.fits or found.low[0] <= truth <= found.high[0]
        if not found.fits:
            assert found.estimate[0] == pytest.approx(truth, rel=0.12)
