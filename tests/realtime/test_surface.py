"""What is seen of a touch: closed forms held against each other and against the tool; files that are none."""

from dataclasses import replace
from math import pi, tan

import numpy as np
import pytest

from pipeline.export.file import write_model
from pipeline.realtime import ModelError, read
from pipeline.realtime.blade import blade
from pipeline.realtime.contact import Bonded, Disc, ball, cone
from pipeline.realtime.near import Footprint, boussinesq, on_face
from pipeline.realtime.place import MOMENTS, Place, Shape
from pipeline.realtime.surface import surface_of
from tests.realtime.synthetic import random_surface, write_random, write_surface

POISSON = 0.4
PLANE = 1 / (1 - POISSON**2)
SHAPES = {"disc": Disc(2e-3), "sphere": ball(0.4), "cone": cone(1.2, 5e-3)}
# F/(E* d) of a frictionless rectangle six times as long as wide, in units of 2 (l w)^½ (half sides).
RECTANGLE_6 = 1.354
AT = (0.011, 0.007, 0.0)


@pytest.mark.parametrize("name", SHAPES)
def test_the_face_leaves_the_tool_without_a_step(name):
    none = np.zeros(2)
    depth = 2e-6 if name == "sphere" else 2e-4  # of a large ball, which Hertz's paraboloid is
    contact = SHAPES[name].press(depth, Place(0.0, 0.0, 0.0, none, none, none, PLANE), 1.0)
    a = contact.radius
    sunk, share = on_face(name, np.array([a]), a, PLANE)
    rise = {"disc": 0.0, "sphere": a**2 / 0.8, "cone": a / tan(1.2)}[name]
    assert contact.force * sunk[0] == pytest.approx(depth - rise, rel=1e-4)
    assert share[0] == pytest.approx(1.0)
    assert contact.mean_square == pytest.approx(MOMENTS[name] * a**2, rel=1e-4)


@pytest.mark.parametrize("tool", [*SHAPES.values(), Bonded(2e-3), blade(6e-3, 1e-3, 0.4)], ids=str)
def test_what_is_told_of_a_contact_is_that_of_its_pressure(tool):
    flat, none = np.zeros(2), ((0.0, 0.0), (0.0, 0.0))
    shape = Shape((0.0, 0.0), none, (0.0, 0.0), none, ((0.0,) * 3,) * 3)
    place = Place(0.0, 0.0, 0.0, flat, flat, flat, PLANE, shape=shape, poisson=POISSON)
    for depth in (1e-6, 2e-6):  # of a large ball, which Hertz's paraboloid is
        contact = tool.press(depth, place, 1.0)
        mean, power = tool.moment(contact.force, PLANE)
        assert mean == pytest.approx(contact.mean_square, rel=1e-4)
        spread = tool.spread_of(contact.radius)
        assert np.trace(spread) == pytest.approx(mean, rel=1e-4)
        np.testing.assert_allclose(mean * tool.tensor, spread, rtol=1e-4)
        more, _ = tool.moment(1.01 * contact.force, PLANE)
        assert more == pytest.approx(1.01**power * mean)


@pytest.mark.parametrize("name", SHAPES)
def test_far_from_a_contact_its_force_and_second_moment_are_what_is_seen(name):
    a, rho = 1e-3, np.array([4e-3, 8e-3])
    sunk, share = on_face(name, rho, a, PLANE)
    away = np.column_stack([rho, 0 * rho, 0 * rho])
    found = boussinesq(away, POISSON, MOMENTS[name] * a**2)
    aside = (1 - 2 * POISSON) * (1 + POISSON) / (2 * pi) * share / rho
    np.testing.assert_array_less(np.abs(found[:, 2] + sunk) / sunk, 0.4 * (a / rho) ** 4)
    np.testing.assert_allclose(-found[:, 0], aside, rtol=1e-9)
    on_plane = Footprint.of(SHAPES[name], a).field(away, POISSON, 1e-9)
    np.testing.assert_allclose(on_plane, np.column_stack([found[:, :2], -sunk]), rtol=1e-9)


def test_below_the_face_a_ring_of_forces_does_what_its_second_moment_tells():
    away, a = np.array([[0.02, 0.01, -0.015], [0.004, -0.02, -0.02]]), 2e-3
    angle = 2 * pi * np.arange(24) / 24
    ring = np.stack([a * np.cos(angle), a * np.sin(angle), 0 * angle], axis=1)
    known = np.mean([boussinesq(away - place, POISSON, 1e-30) for place in ring], axis=0)
    point, found = (boussinesq(away, POISSON, square) for square in (1e-30, a**2))
    assert np.abs(found - known).max() < 0.03 * np.abs(point - known).max()


@pytest.mark.parametrize("turned", [False, True])
def test_the_contact_has_the_shape_of_the_tool_in_any_frame(turned):
    surface = random_surface(turned=turned)
    model = surface.model
    at = model.origin + model.axes.T @ np.array(AT)
    at = surface.points[np.argmin(np.linalg.norm(surface.points - at, axis=1))]
    touch, moved = surface.press("sphere", at=at, depth=3e-4, radius=6e-3)
    assert touch.status == "ok"
    rho = np.linalg.norm(surface.points - at, axis=1)
    assert (moved @ model.axes[2])[rho.argmin()] == pytest.approx(-3e-4)
    plain = random_surface()
    local = model.axes @ (at - model.origin)
    _, other = plain.press("sphere", at=local, depth=3e-4, radius=6e-3)
    np.testing.assert_allclose(moved @ model.axes.T, other, atol=1e-9)


def test_a_blade_is_seen_as_what_presses_along_its_edge():
    foot = Footprint.of(blade(6e-3, 1e-3, 0.4), 0.0)
    along, across = np.array([np.cos(0.4), np.sin(0.4)]), np.array([-np.sin(0.4), np.cos(0.4)])
    own = foot.centres @ along
    assert np.abs(foot.centres @ across).max() < 1e-15
    assert own.mean() == pytest.approx(0.0, abs=1e-15)
    assert (own**2).mean() + foot.a**2 / 3 == pytest.approx(along @ foot.spread @ along)
    assert foot.a == pytest.approx(0.5e-3)
    # On the edge's line, and across it, the sum of discs goes over into a force and its second moments.
    for direction in (along, across):
        away = np.append(3.99 * foot.reach * direction, 0.0)
        near, far = (foot.field(np.array([scale * away]), POISSON, 0.0)[0, 2] for scale in (1.0, 1.01))
        assert 1.01 * far == pytest.approx(near, rel=0.03)
    # Beside its long edge the face is nearly as deep as it is below, by the force of a rectangle (E = 1, d = 1).
    force = 2 * np.sqrt(3e-3 * 0.5e-3) * PLANE * RECTANGLE_6
    beside = np.outer([-1.5e-3, 0.0, 1.5e-3], along) + 0.55e-3 * across
    sunk = -foot.field(np.column_stack([beside, np.zeros(3)]), POISSON, 1e-9)[:, 2] * force
    assert np.all((sunk > 0.7) & (sunk < 1.0)), sunk
    # It covers its rectangle, and nothing beside.
    shares = np.array([(x, y) for x in (-1.01, -0.99, 0.0, 0.99, 1.01) for y in (-1.1, -0.9, 0.0, 0.9, 1.1)])
    places = np.column_stack([shares * (3e-3, 0.5e-3) @ np.array([along, across]), np.zeros(len(shares))])
    assert list(foot.within(places)) == list(np.flatnonzero((np.abs(shares) < 1).all(axis=1)))


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)], ids=str)
def test_a_force_that_is_spread_does_far_away_what_its_parts_do(way):
    table, step = random_surface().table, 2e-4 * np.array(way)
    at = np.array(AT[:2])
    one, before, after = (table.amounts_at(*(at + share * step), 0.35) for share in (0, -1, 1))
    parts = (before + after) / 2 - one
    spread = table.amounts_at(*at, 0.35, np.outer(step, step)) - one
    np.testing.assert_allclose(spread, parts, atol=1e-2 * np.abs(parts).max())


def test_tissue_that_sticks_is_not_drawn_to_the_edge_and_is_far_away_like_any_other():
    a = 2e-3
    plain, bonded = (Footprint.of(tool(a), a) for tool in (Disc, Bonded))
    rho = np.array([a, 1.5 * a, 40 * a])
    away = np.column_stack([rho, 0 * rho, 0 * rho])
    slides, sticks = (foot.field(away, POISSON, 1e-9) for foot in (plain, bonded))
    assert sticks[0, 0] == 0.0
    np.testing.assert_array_less(np.abs(sticks[:, 0]), np.abs(slides[:, 0]))
    np.testing.assert_allclose(sticks[2], slides[2], rtol=1e-3)


def test_a_bent_face_has_the_plane_next_to_the_tool_and_the_half_space_far_away():
    a = 2e-3
    foot = Footprint.of(Disc(a), a)
    rho = np.array([1.2 * a, 2 * a])
    bent = np.column_stack([rho, 0 * rho, -(rho**2) / 0.08])
    flat = bent * (1, 1, 0)
    less = boussinesq(bent, POISSON, 2 / 3 * a**2) - boussinesq(flat, POISSON, 2 / 3 * a**2)
    np.testing.assert_allclose(foot.field(bent, POISSON, 1e-9), foot.field(flat, POISSON, 1e-9) + less)
    edge = np.array([[4 * a - 1e-9, 0, -1e-4], [4 * a + 1e-9, 0, -1e-4]])
    near, far = foot.field(edge, POISSON, 1e-9)
    np.testing.assert_allclose(near, far, rtol=5e-3)
    assert np.isfinite(foot.field(np.array([[0, 0, 0.01], [0, 0, -0.01], [1e-3, 0, 0.01]]), POISSON, 1e-9)).all()


@pytest.mark.parametrize(("tool", "sizes"), [("disc", {"radius": 2e-3}), ("sphere", {"radius": 6e-3})])
def test_what_is_seen_of_a_curved_face_follows_the_tool(tool, sizes):
    surface = random_surface(curved=True)
    model, depth = surface.model, 3e-4
    inside = np.flatnonzero(np.hypot(*surface.points[:81, :2].T) < 0.01)
    for number in inside[:3]:
        at = surface.points[number]
        spot = model.face.at(model.table, *at[:2].tolist())
        at = np.array([*at[:2], spot.height])  # of single precision
        touch, moved = surface.press(tool, at=at, depth=depth, **sizes)
        assert touch.status == "ok"
        assert moved[number] @ spot.normal == pytest.approx(-depth, rel=1e-3)
    touch, moved = surface.press(tool, at=at + 1e-3 * spot.normal, depth=depth, **sizes)
    assert (touch.status, np.isnan(moved).all()) == ("off", True)


def test_no_touch_moves_nothing_and_a_refusal_shows_nothing():
    surface = random_surface()
    touch, moved = surface.press("disc", at=AT, depth=-1e-4, radius=2e-3)
    assert (touch.status, np.abs(moved).max()) == ("lost", 0.0)
    touch, moved = surface.press("disc", at=(0.031, 0.0, 0.0), depth=1e-4, radius=2e-3)
    assert touch.status == "outside"
    assert np.isnan(moved).all()


def test_a_file_holds_the_surface_and_one_without_says_so(tmp_path):
    made, again = random_surface(), write_surface(tmp_path / "model.nc")
    for asked in ({"tool": "disc", "radius": 2e-3}, {"tool": "cone", "radius": 2e-3, "angle": 1.0}):
        (touch, one), (_, other) = (s.press(at=AT, depth=1e-4, **asked) for s in (made, again))
        assert touch.status == "ok"
        np.testing.assert_array_equal(one, other)
    assert read(tmp_path / "model.nc").query("disc", radius=2e-3, at=AT, depth=1e-4).status == "ok"
    write_random(tmp_path / "bare.nc")
    with pytest.raises(ModelError, match="surface"):
        surface_of((tmp_path / "bare.nc").read_bytes())


def test_a_damaged_surface_is_refused(tmp_path):
    made = random_surface()
    table = made.table
    damaged = (
        {"triangles": table.triangles + 1000}, {"error": -1.0}, {"points": np.full_like(table.points, np.nan)},
        {"points": 1e9 * table.points}, {"amounts": np.full_like(table.amounts, np.inf)},
        {"triangles": table.triangles[:, :2]},
    )  # fmt: skip
    for number, wrong in enumerate(damaged):
        path = tmp_path / f"{number}.nc"
        write_model(path, made.model, {}, {}, replace(table, **wrong))
        with pytest.raises(ModelError):
            surface_of(path.read_bytes())
    wild = replace(made, table=replace(table, amounts=np.full_like(table.amounts, 1e38)))
    with np.errstate(all="ignore"):
        touch, moved = wild.press("disc", at=AT, depth=1e-4, radius=2e-3)
    assert touch.status == "damaged"
    assert np.isnan(moved).all()
    write_surface(tmp_path / "whole.nc")
    data = (tmp_path / "whole.nc").read_bytes()
    for size in range(0, len(data), 997):
        with pytest.raises(ModelError):
            surface_of(data[:size])
