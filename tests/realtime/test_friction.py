"""Coulomb's friction on a model: its limit, its direction, what sticks, and that no motion gains energy."""

import pickle
from math import inf, nan

import numpy as np
import pytest

from epsmesh_realtime import Friction
from tests.realtime.synthetic import of_place, random_model

BALL, MU = {"tool": "sphere", "radius": 6e-3}, 0.3


def dragged(model, ways, **asked):
    """Return the answers of a ball along ``ways`` (n, 3): x, y and depth."""
    ways = np.asarray(ways, dtype=float)
    at = np.array([[x, y, model.spot(x, y).height] for x, y in ways[:, :2].tolist()]) @ model.axes + model.origin
    return Friction(model, MU).query_many(**BALL | asked, at=at, depth=ways[:, 2]), at


def line(start, end, count):
    return np.linspace(start, end, count)


def test_a_tool_that_slides_has_the_coefficient_times_the_normal_force_against_its_motion():
    for kind in ({}, {"turned": True}, {"curved": True, "turned": True}):
        model = random_model(**kind)
        found, at = dragged(model, line((0, 0, 3e-4), (9e-3, 4e-3, 3e-4), 60))
        last, moved = found[-1], at[-1] - at[-2]
        normal = model.spot(9e-3, 4e-3).normal @ model.axes
        push = last.touch.force @ normal
        assert not last.is_sticking and np.linalg.norm(last.friction) == pytest.approx(MU * push)
        assert last.friction @ normal == pytest.approx(0, abs=1e-12)
        along = moved - moved @ normal * normal
        assert last.friction @ along == pytest.approx(-MU * push * np.linalg.norm(along), rel=1e-3)
        assert last.friction_error == pytest.approx(MU * (last.touch.force_error - beside(model) * push), rel=1e-6)
        np.testing.assert_array_equal(last.force, last.touch.force + last.friction)


def beside(model):
    """Return the share of the normal force by which friction may change it, after Mossakovskii, times 1.5."""
    nu = model.poisson
    return 1.5 * ((1 - nu) * np.log(3 - 4 * nu) / (1 - 2 * nu) - 1)


def test_a_tool_that_sticks_is_as_stiff_as_mindlin_says():
    model, small = of_place(), 1e-8
    rub = Friction(model, MU)
    rub.query(**BALL, at=(0.0, 0.0, 0.0), depth=3e-4)
    found = rub.query(**BALL, at=(small, 0.0, 0.0), depth=3e-4)
    assert found.is_sticking and found.stretch == pytest.approx(small)
    nu = model.poisson
    assert found.friction[0] == pytest.approx(-found.touch.stiffness * 2 * (1 - nu) / (2 - nu) * small)
    # Cattaneo and Mindlin: it slides from its rim inwards, and its friction is less by at most the bar.
    limit = MU * found.touch.force[2]
    for share in (0.3, 0.7, 1.0, 1.2, 1.45, 1.6):
        stretch = share * limit / (found.touch.stiffness * 2 * (1 - nu) / (2 - nu))
        rub = Friction(model, MU)
        for x in (0.0, stretch):
            found = rub.query(**BALL, at=(x, 0.0, 0.0), depth=3e-4)
        exact = limit * (1 - max(0.0, 1 - share / 1.5) ** 1.5)
        assert abs(-found.friction[0] - exact) <= found.friction_error + 1e-12


@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"curved": True, "turned": True}])
@pytest.mark.parametrize("step", [2e-5, 5e-4])
def test_no_motion_gains_energy(kind, step):
    """The work against friction, with the force at the end of each step, is at least what the bristle keeps."""
    model, rng = random_model(**kind), np.random.default_rng(3)
    walk = np.cumsum(rng.uniform(-1, 1, (3000, 3)) * [step, step, step / 10], axis=0)
    half = 0.6 * np.array(model.table.reach)
    ways = np.column_stack([half * np.sin(walk[:, :2] / half), 2e-4 + 3e-4 * np.sin(walk[:, 2] / 3e-4)])
    found, at = dragged(model, ways)
    status = {one.touch.status for one in found}
    assert status <= {"ok", "no contact"} and "ok" in status
    normals = np.array([model.spot(x, y).normal for x, y in ways[:, :2].tolist()]) @ model.axes
    moved = np.diff(at - ways[:, 2:] * normals, axis=0)
    work = -np.cumsum([one.friction @ move for one, move in zip(found[1:], moved, strict=True)])
    nu = model.poisson
    kept = np.array([0.5 * one.touch.stiffness * 2 * (1 - nu) / (2 - nu) * one.stretch**2 for one in found[1:]])
    assert np.all(work >= kept - 1e-12 * work.max()) and work[-1] > 0
    assert any(one.is_sticking and one.stretch for one in found) and any(not one.is_sticking for one in found)


def test_a_lifted_tool_begins_anew():
    model = random_model()
    rub = Friction(model, MU)
    for x in (0.0, 1e-3, 2e-3):
        found = rub.query(**BALL, at=(x, 0.0, 0.0), depth=3e-4)
    assert found.friction[0] < 0
    away = rub.query(**BALL, at=(2e-3, 0.0, 0.0), depth=-1e-4)
    assert away.touch.status == "no contact" and not away.friction.any() and away.stretch == 0
    assert not rub.query(**BALL, at=(3e-3, 0.0, 0.0), depth=3e-4).friction.any()
    refused = rub.query(**BALL, at=(1.0, 0.0, 0.0), depth=3e-4)
    assert refused.touch.status == "outside" and np.isnan(refused.friction).all() and np.isnan(refused.friction_error)
    assert not rub.query(**BALL, at=(3e-3, 0.0, 0.0), depth=3e-4).friction.any()


def test_without_a_coefficient_it_is_the_touch():
    model = random_model()
    rub = Friction(model, 0.0)
    for x in (0.0, 1e-3):
        found, touch = (one(**BALL, at=(x, 0.0, 0.0), depth=3e-4) for one in (rub.query, model.query))
    assert np.array_equal(found.force, touch.force) and found.touch.force_error == touch.force_error
    assert found.friction_error == 0


def test_one_by_one_is_the_same_as_many():
    model = random_model(curved=True)
    ways = line((0, 0, -1e-5), (2e-3, -1e-3, 4e-4), 12)
    found, at = dragged(model, ways)
    rub = Friction(model, MU)
    for one, place, depth in zip(found, at, ways[:, 2].tolist(), strict=True):
        other = rub.query(**BALL, at=place, depth=depth)
        assert np.array_equal(one.force, other.force) and one.friction_error == other.friction_error


def test_what_has_no_friction_is_refused():
    model = random_model()
    for coefficient in (-0.1, nan, inf):
        with pytest.raises(ValueError, match="0 or more"):
            Friction(model, coefficient)
    bonded = Friction(model, MU).query("disc", radius=2e-3, contact="bonded", at=(0.0, 0.0, 0.0), depth=1e-4)
    assert bonded.touch.status == "tool" and np.isnan(bonded.friction).all()
    with pytest.raises(TypeError, match="cannot be copied"):
        pickle.dumps(Friction(model, MU))
