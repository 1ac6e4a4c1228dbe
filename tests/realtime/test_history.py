"""Relaxing tissue under a tool: closed forms, contact that grows and shrinks, energy, and what is refused."""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import epsmesh
from epsmesh.viscoelastic import Motion, follow, respond
from epsmesh_realtime import History, ModelError, read
from epsmesh_realtime.export.file import write_model
from tests.realtime.synthetic import random_model

TERMS = ((0.4, 2.0), (0.2, 30.0))
AT = (0.01, 0.005, 0.0)
DISC = {"tool": "disc", "radius": 3e-3, "at": AT}
BLADE = {"tool": "blade", "length": 6e-3, "width": 1e-3, "along": (1.0, 2.0, 0.0), "at": AT}
SAME = (DISC, DISC | {"contact": "bonded"}, BLADE)
BALL = {"tool": "sphere", "radius": 8e-3, "at": AT}
CONE = {"tool": "cone", "radius": 5e-3, "angle": 1.1, "at": AT}


@cache
def relaxing(terms=TERMS):
    return replace(random_model(), relaxation=terms)


def pressed(tool, times, depths, terms=TERMS):
    """Return the answers over a motion that is linear between ``times``, from rest."""
    history, steps = History(relaxing(terms)), np.diff(times, prepend=0.0)
    return [history.query(step, **tool, depth=d) for step, d in zip(steps.tolist(), depths.tolist(), strict=True)]


def forces(touches):
    return np.array([touch.force for touch in touches])


@pytest.mark.parametrize("tool", SAME)
def test_constant_contact_is_the_hereditary_integral_of_the_depth(tool):
    motion = Motion((0.0, 1.0, 4.0, 5.0, 9.0), (0.0, 3e-4, 3e-4, 4e-4, 4e-4))
    times = np.unique(np.r_[np.random.default_rng(1).uniform(0, 9, 100), motion.times])[1:]
    depths, (integral, _) = motion.at(times), respond(motion, TERMS, times)
    touches = pressed(tool, times, depths)
    elastic = [relaxing().query(**tool, depth=d) for d in depths.tolist()]
    known = forces(elastic) * (integral / depths)[:, None]
    np.testing.assert_allclose(forces(touches), known, rtol=1e-12, atol=1e-12 * np.abs(known).max())
    shares = [[touch.force_error / touch.force[2] for touch in found] for found in (touches, elastic)]
    assert shares[0] == pytest.approx(shares[1])
    assert [touch.stiffness for touch in touches] == pytest.approx([touch.stiffness for touch in elastic])


@pytest.mark.parametrize(("tool", "exponent"), [(BALL, 1.5), (CONE, 2.0)])
def test_contact_that_grows_and_shrinks_is_that_of_lee_radok_and_ting(tool, exponent):
    motion, nodes = (
        Motion((0.0, 1.0, 3.0, 4.0), (0.0, 4e-4, 4e-4, 0.0)),
        4e-4 * np.array([0.02, 0.08, 0.2, 0.4, 0.7, 1]),
    )
    times = np.linspace(0, 4, 2001)[1:]
    touches = pressed(tool, times, motion.at(times))
    asked = np.array([100, 400, 499, 800, 1450, 1520, 1600, 1700])
    elastic = forces([relaxing().query(**tool, depth=d) for d in nodes.tolist()])
    known = follow(motion, TERMS, times[asked], nodes, exponent).weights @ elastic
    np.testing.assert_allclose(forces(touches)[asked], known, rtol=3e-5, atol=1e-6 * np.abs(known).max())
    assert {touch.status for touch in touches[:1500]} == {"ok"}
    assert touches[-2].status == "no contact"  # before the tool is back


@pytest.mark.parametrize("tool", [BALL, CONE])
@pytest.mark.parametrize("terms", [((0.3, 0.03), (0.3, 1.0)), ((0.7, 0.2),)])
def test_the_bar_holds_what_long_steps_miss(tool, terms):
    def over(count):
        times = np.linspace(0, 2, count + 1)[1:]
        history = History(replace(relaxing(terms), bar=(0.0,) * 4))  # without the error of the elastic force
        depths = np.interp(times, (0, 0.8, 1.2, 2.0), (0, 4e-4, 4e-4, 1e-4))
        touches = [history.query(2 / count, **tool, depth=depth) for depth in depths.tolist()]
        return forces(touches)[:, 2], np.array([touch.force_error for touch in touches])

    fine, _ = over(4000)
    for count in (5, 20, 50):
        force, bar = over(count)
        known = fine[4000 // count - 1 :: 4000 // count]
        held = known > 0.02 * known.max()
        assert np.all(np.abs(force - known)[held] <= bar[held] + 1e-6 * known.max())
        assert (bar[held] / known[held]).max() < 0.05


@pytest.mark.parametrize("tool", [*SAME, BALL, CONE])
def test_closed_loops_dissipate(tool):
    """The work of the tool, by quadrature between the corners of random motions, in units of what is stored at most."""
    rng, (points, weights) = np.random.default_rng(3), np.polynomial.legendre.leggauss(6)
    grows, seen = tool["tool"] in ("sphere", "cone"), []
    for _ in range(20):
        terms = rng.integers(1, 5)
        shares, taus = rng.dirichlet(np.ones(terms + 1))[:terms], 10 ** rng.uniform(-3, 3, terms)
        up = np.sort(rng.uniform(0, 4e-4, 3)) if grows else rng.uniform(0, 4e-4, 6)
        corners = np.r_[0.0, up, up[-1], 0.0, 0.0]
        moments = np.r_[0.0, np.cumsum(10 ** rng.uniform(-4, 2, len(corners) - 1))]
        fine = np.linspace(0, 1, 20 * (len(corners) - 1) + 1) * (len(corners) - 1)
        moments, corners = (np.interp(fine, np.arange(len(each)), each) for each in (moments, corners))
        spread = np.r_[(1 + points) / 2, 1.0]
        times = (moments[:-1, None] + np.diff(moments)[:, None] * spread).ravel()
        depths = (corners[:-1, None] + np.diff(corners)[:, None] * spread).ravel()
        touches = pressed(tool, times, depths, tuple(zip(shares.tolist(), taus.tolist(), strict=True)))
        assert {touch.status for touch in touches} <= {"ok", "no contact"}
        force = forces(touches)[:, 2]
        work = np.cumsum(force * (np.diff(corners)[:, None] * np.r_[weights / 2, 0.0]).ravel())
        stored = force.max() * depths.max() / 2
        assert work.min() >= -1e-12 * stored
        seen.append(work[-1] / stored)
    assert min(seen) >= -1e-12
    assert max(seen) > 0.1


def test_a_disc_waits_in_its_dent_until_the_tissue_has_come_back_to_it():
    times = np.r_[1e-3, 100.0, 100.001, np.linspace(101, 1000, 900)]
    depths = np.r_[4e-4, 4e-4, np.full(901, 1e-4)]
    touches = pressed(DISC, times, depths)
    force, rest = forces(touches)[:, 2], relaxing().query(**DISC, depth=1e-4).force[2]
    assert touches[2].status == "no contact"
    back = next(number for number in range(3, 903) if touches[number].status == "ok")
    assert back > 3
    assert np.all(force[2:back] == 0)
    assert np.all(np.diff(force[back:]) > 0)
    assert force[-1] == pytest.approx(0.4 * rest, rel=1e-6)


@pytest.mark.parametrize(
    "change",
    [{"at": (0.011, 0.005, 0.0)}, {"young": 2e4}, {"poisson": 0.4}, {"radius": 2e-3}, {"tool": "cone", "angle": 1.0}],
)
def test_what_changes_in_contact_is_refused_until_tissue_is_at_rest(change):
    history = History(relaxing())
    assert history.query(0.1, **BALL, depth=1e-4).status == "ok"
    assert history.query(0.1, **BALL | change, depth=1e-4).status == "history"
    assert history.query(0.1, **BALL, depth=1e-4).status == "history"
    history = History(relaxing())
    assert history.query(0.1, **BALL, depth=1e-4).status == "ok"
    assert history.query(0.1, **BALL, depth=-1e-4).status == "no contact"
    assert history.query(2000.0, **BALL, depth=-1e-4).status == "no contact"
    assert history.query(0.1, **BALL | change, depth=1e-4).status == "ok"


def test_contact_that_grows_again_has_used_up_its_room_or_was_refused_has_no_force():
    history = History(relaxing())
    statuses = [history.query(0.1, **BALL, depth=d).status for d in (1e-4, 2e-4, 1.5e-4, 1.8e-4, 0.0)]
    assert statuses == ["ok", "ok", "ok", "history", "history"]
    history = History(relaxing(), room=4)
    statuses = [history.query(0.1, **BALL, depth=d * 1e-5).status for d in range(1, 6)]
    assert statuses[2:] == ["ok", "history", "history"]
    for depth, status in ((0.1, "deep"), (5e-3, "large"), (np.nan, "input")):
        history = History(relaxing())
        assert [history.query(0.1, **BALL, depth=d).status for d in (1e-4, depth, 1e-4)] == ["ok", status, "history"]
    assert History(relaxing()).query(-1.0, **BALL, depth=1e-4).status == "input"
    history = History(relaxing())
    axes = ((0.0, 0.0, -1.0), (0.5, 0.0, -1.0), (0.0, 0.0, -1.0))
    assert [history.query(0.1, **BALL, depth=1e-4, axis=axis).status for axis in axes] == ["ok", "tilted", "history"]


def test_a_wrong_query_says_what_is_wrong_and_one_above_the_tissue_is_no_past():
    for wrong, status in (
        ({"radius": np.nan}, "tool"),
        ({"at": (np.nan, 0.0, 0.0)}, "input"),
        ({"young": -1.0}, "input"),
    ):
        history = History(relaxing())
        assert history.query(0.1, **BALL | wrong, depth=-1e-4).status == status
        assert history.query(0.1, **BALL, depth=1e-4).status == "ok"
        assert History(relaxing()).query(0.1, **BALL | wrong, depth=1e-4).status == status


def test_a_history_is_not_copied():
    with pytest.raises(TypeError, match="begin a new one"):
        deepcopy(History(relaxing()))


def test_tissue_that_does_not_relax_has_no_history():
    model = relaxing(())
    history = History(model)
    for depth in (1e-4, 3e-4, 2e-4, 2.5e-4):
        touch, elastic = (each.query(*step, **BALL, depth=depth) for each, step in ((history, (0.1,)), (model, ())))
        assert np.array_equal(touch.force, elastic.force)


def test_a_file_has_the_relaxation_and_none_that_gains_modulus(tmp_path):
    write_model(tmp_path / "model.epsm", relaxing(), {}, {})
    assert read(tmp_path / "model.epsm").relaxation == TERMS
    data = epsmesh.open(tmp_path / "model.epsm")
    assert list(zip(data["relaxation_share"].values, data["relaxation_time"].values, strict=True)) == [*TERMS]
    assert data["relaxation_time"].attrs["units"] == "s"
    for wrong in (((0.6, 1.0), (0.5, 2.0)), ((-0.1, 1.0),), ((0.1, 0.0),), ((0.01, 1.0),) * 7):
        write_model(tmp_path / "model.epsm", replace(random_model(), relaxation=wrong), {}, {})
        with pytest.raises(ModelError, match="relaxation"):
            read(tmp_path / "model.epsm")


@pytest.mark.parametrize("tool", [DISC, BALL])
def test_many_queries_in_order_are_those_of_many_calls(tool):
    times = np.linspace(0.1, 3.0, 30)
    depths = np.interp(times, (0, 1, 2, 3), (0, 3e-4, 3e-4, -1e-5))
    known = pressed(tool, times, depths)
    found = History(relaxing()).query_many(np.diff(times, prepend=0.0), **tool, depth=depths)
    assert {*found.status} == {"ok", "no contact"}
    assert [*found.status] == [touch.status for touch in known]
    np.testing.assert_array_equal(found.force, forces(known))
    np.testing.assert_array_equal(found.force_error, [touch.force_error for touch in known])
    for steps in (np.zeros(29), np.zeros((30, 1))):
        with pytest.raises(ValueError, match="shape"):
            History(relaxing()).query_many(steps, **tool, depth=depths)
