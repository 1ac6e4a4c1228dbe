"""What is seen of a touch: closed forms held against each other and against the tool; files that are none."""

from dataclasses import replace
from math import pi, tan

import numpy as np
import pytest

from epsmesh_realtime import ModelError, Surface, read
from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.surface import SurfaceTable, surface_of
from tests.realtime.synthetic import of_place, point_force, random_surface, write_random, write_surface

POISSON = 0.4
PLANE = 1 / (1 - POISSON**2)
TOOLS = {
    "disc": {"radius": 2e-3},
    "sphere": {"radius": 0.4},
    "cone": {"radius": 5e-3, "angle": 1.2},
    "blade": {"length": 6e-3, "width": 1e-3, "along": (np.cos(0.4), np.sin(0.4), 0.0)},
}
MOMENTS = {"disc": 2 / 3, "sphere": 2 / 5, "cone": 1 / 3}
AT, MIDDLE = (0.011, 0.007, 0.0), (0.0, 0.0, 0.0)


def pressed(points, tool, depth=2e-6, model=None, **more):
    """Return a touch in the middle of a half-space with E = 1, and the displacement of points (n, 3) for F = 1."""
    model, points = model or of_place(0.0, 0.0, POISSON), np.asarray(points, dtype=np.float32)
    none = np.zeros((len(points), 3, 1), np.int16)
    table = SurfaceTable(
        points, np.zeros((1, 3)), none, np.zeros((1, 1, 1, 1)), 0.0, model.table.reach, model.table.poisson
    )
    touch, moved = Surface(model, table).press(tool, at=MIDDLE, depth=depth, **TOOLS[tool] | more)
    assert touch.status == "ok", touch
    return touch, moved / touch.force[2]


def single(values):
    """Return numbers as the file's single precision has them."""
    return np.asarray(values, dtype=np.float32).astype(float)


def radius_of(tool, depth):
    return pressed(np.ones((1, 3)), tool, depth)[0].contact_radius


@pytest.mark.parametrize("name", MOMENTS)
def test_the_face_leaves_the_tool_without_a_step(name):
    depth = 2e-6 if name == "sphere" else 2e-4  # of a large ball, which Hertz's paraboloid is
    a = radius_of(name, depth)
    rho = single([a * 1.0001])
    touch, moved = pressed(np.column_stack([rho, 0 * rho, 0 * rho]), name, depth)
    rise = {"disc": 0.0, "sphere": a**2 / 0.8, "cone": a / tan(1.2)}[name]
    assert -touch.force[2] * moved[0, 2] == pytest.approx(depth - rise, rel=2e-2)
    # All of the force is within the contact.
    share = -moved[0, 0] * 2 * pi * rho[0] / ((1 - 2 * POISSON) * (1 + POISSON))
    assert share == pytest.approx(1.0, rel=2e-2)


@pytest.mark.parametrize("name", MOMENTS)
def test_far_from_a_contact_its_force_and_second_moment_are_what_is_seen(name):
    a = radius_of(name, 2e-6)
    rho = single([8 * a, 16 * a])
    _, moved = pressed(np.column_stack([rho, 0 * rho, 0 * rho]), name)
    # A unit force, and what its second moment adds to 1/rho: a quarter of it times the Laplacian.
    sunk = (1 / rho + MOMENTS[name] * a**2 / 4 / rho**3) / (pi * PLANE)
    np.testing.assert_array_less(np.abs(moved[:, 2] + sunk) / sunk, 0.4 * (a / rho) ** 4)
    np.testing.assert_allclose(-moved[:, 0], (1 - 2 * POISSON) * (1 + POISSON) / (2 * pi * rho), rtol=1e-9)


def test_below_the_face_a_disc_does_what_a_ring_of_forces_does():
    a = 2e-3
    away = single([[0.02, 0.01, -0.015], [0.004, -0.02, -0.02]])
    _, moved = pressed(away, "disc")
    angle = 2 * pi * np.arange(24) / 24
    radius = a * np.sqrt(MOMENTS["disc"])
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    known = np.mean([point_force(away - place, POISSON) for place in ring], axis=0)
    assert np.abs(moved - known).max() < 0.03 * np.abs(point_force(away, POISSON) - known).max()


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
    along, across = np.array([np.cos(0.4), np.sin(0.4), 0.0]), np.array([-np.sin(0.4), np.cos(0.4), 0.0])
    reach = np.hypot(3e-3, 0.5e-3)
    # On the edge's line, and across it, the sum of discs goes over into a force and its second moments.
    for direction in (along, across):
        _, moved = pressed(np.outer([3.99 * reach, 4.03 * reach], direction), "blade")
        assert 1.01 * moved[1, 2] == pytest.approx(moved[0, 2], rel=0.03)
    # Beside its long edge the face is nearly as deep as it is below.
    beside = np.outer([-1.5e-3, 0.0, 1.5e-3], along) + 0.55e-3 * across
    touch, moved = pressed(beside, "blade", 1e-5)
    sunk = -moved[:, 2] * touch.force[2] / 1e-5
    assert np.all((sunk > 0.7) & (sunk < 1.0)), sunk
    # It covers its rectangle, and nothing beside.
    shares = np.array([(x, y) for x in (-1.01, -0.99, 0.0, 0.99, 1.01) for y in (-1.1, -0.9, 0.0, 0.9, 1.1)])
    touch, moved = pressed(shares * (3e-3, 0.5e-3) @ np.array([along, across]), "blade", 1e-5)
    follows = np.abs(moved[:, 2] * touch.force[2] + 1e-5) < 1e-15
    assert list(follows) == list((np.abs(shares) < 1).all(axis=1))


def test_tissue_that_sticks_is_not_drawn_to_the_edge_and_is_far_away_like_any_other():
    a = 2e-3
    rho = single([1.0001 * a, 1.5 * a, 40 * a])
    away = np.column_stack([rho, 0 * rho, 0 * rho])
    (_, slides), (_, sticks) = (pressed(away, "disc", contact=contact) for contact in ("frictionless", "bonded"))
    assert abs(sticks[0, 0]) < 1e-3 * abs(slides[0, 0])
    np.testing.assert_array_less(np.abs(sticks[:, 0]), np.abs(slides[:, 0]))
    np.testing.assert_allclose(sticks[2], slides[2], rtol=1e-3)


def test_a_bent_face_has_the_plane_next_to_the_tool_and_the_half_space_far_away():
    a = 2e-3
    rho = single([1.2 * a, 2 * a])
    _, flat = pressed(np.column_stack([rho, 0 * rho, 0 * rho]), "disc")
    _, bent = pressed(np.column_stack([rho, 0 * rho, single(-(rho**2) / 0.08)]), "disc")
    assert np.all(np.abs(bent - flat).max(axis=1) < 0.2 * np.abs(flat).max(axis=1))
    assert np.all(np.abs(bent - flat).max(axis=1) > 1e-4 * np.abs(flat).max(axis=1))
    _, (near, far) = pressed([[4 * a - 1e-6, 0, -1e-4], [4 * a + 1e-6, 0, -1e-4]], "disc")
    np.testing.assert_allclose(near, far, rtol=5e-3)
    _, inside = pressed([[0, 0, 0.01], [0, 0, -0.01], [1e-3, 0, 0.01]], "disc")
    assert np.isfinite(inside).all()


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)], ids=str)
def test_a_force_that_is_spread_does_far_away_what_its_parts_do(way):
    surface, half = random_surface(), 2e-3
    table, far = surface.table, 1e-3 * surface.table.modes
    long, at = np.array([*way, 0.0]) / np.hypot(*way), np.array(AT)
    blade = {"length": 2 * half, "width": 1e-4, "along": long}
    touch, moved = surface.press("blade", at=at, depth=1e-6, **blade)
    bare = Surface(surface.model, replace(table, modes=0 * table.modes)).press("blade", at=at, depth=1e-6, **blade)[1]
    assert far.any()
    beyond = np.linalg.norm(surface.points - at, axis=1) > 3 * half
    own = ((moved - bare) / touch.force[2] * surface.model.young)[beyond]
    # The mean of x² along the edge, which gives way to two forces at its root.
    share = np.sqrt(second_moment(half, 0.5e-4))
    parts = [table.far(*(at + sign * share * long)[:2], surface.model.poisson)[beyond] for sign in (-1, 1)]
    middle = table.far(*at[:2], surface.model.poisson)[beyond]
    np.testing.assert_allclose(
        own - middle, np.mean(parts, axis=0) - middle, atol=0.03 * np.abs(parts[0] - middle).max()
    )


def second_moment(half, short):
    """Return <x²> along the edge of a slender blade, by what h adds to its compliance."""
    sizes = {"length": 2 * half, "width": 2 * short}
    h = 1e4
    forces = [of_place(0.0, each, POISSON).query("blade", at=MIDDLE, depth=1e-6, **sizes).force[2] for each in (0.0, h)]
    return 2 / h * (1e-6 / forces[1] - 1e-6 / forces[0])


@pytest.mark.parametrize(("tool", "sizes"), [("disc", {"radius": 2e-3}), ("sphere", {"radius": 6e-3})])
def test_what_is_seen_of_a_curved_face_follows_the_tool(tool, sizes):
    surface = random_surface(curved=True)
    model, depth = surface.model, 3e-4
    inside = np.flatnonzero(np.hypot(*surface.points[:81, :2].T) < 0.01)
    for number in inside[:3]:
        at = surface.points[number]
        spot = model.spot(*at[:2].tolist())
        at = np.array([*at[:2], spot.height])  # of single precision
        touch, moved = surface.press(tool, at=at, depth=depth, **sizes)
        assert touch.status == "ok"
        assert moved[number] @ spot.normal == pytest.approx(-depth, rel=1e-3)
    touch, moved = surface.press(tool, at=at + 1e-3 * spot.normal, depth=depth, **sizes)
    assert (touch.status, np.isnan(moved).all()) == ("off", True)


def test_no_touch_moves_nothing_and_a_refusal_shows_nothing():
    surface = random_surface()
    touch, moved = surface.press("disc", at=AT, depth=-1e-4, radius=2e-3)
    assert (touch.status, np.abs(moved).max()) == ("no contact", 0.0)
    touch, moved = surface.press("disc", at=(0.031, 0.0, 0.0), depth=1e-4, radius=2e-3)
    assert touch.status == "outside"
    assert np.isnan(moved).all()


def test_a_file_holds_the_surface_and_one_without_says_so(tmp_path):
    made, again = random_surface(), write_surface(tmp_path / "model.epsm")
    for asked in ({"tool": "disc", "radius": 2e-3}, {"tool": "cone", "radius": 2e-3, "angle": 1.0}):
        (touch, one), (_, other) = (s.press(at=AT, depth=1e-4, **asked) for s in (made, again))
        assert touch.status == "ok"
        np.testing.assert_array_equal(one, other)
    assert read(tmp_path / "model.epsm").query("disc", radius=2e-3, at=AT, depth=1e-4).status == "ok"
    write_random(tmp_path / "bare.epsm")
    with pytest.raises(ModelError, match="surface"):
        surface_of((tmp_path / "bare.epsm").read_bytes())


def test_a_damaged_surface_is_refused(tmp_path):
    made = random_surface()
    table = made.table
    damaged = (
        {"triangles": table.triangles + 1000}, {"error": -1.0}, {"points": np.full_like(table.points, np.nan)},
        {"points": 1e9 * table.points}, {"amounts": np.full_like(table.amounts, np.inf)},
        {"triangles": table.triangles[:, :2]},
    )  # fmt: skip
    for number, wrong in enumerate(damaged):
        path = tmp_path / f"{number}.epsm"
        write_model(path, made.model, {}, {}, replace(table, **wrong))
        with pytest.raises(ModelError):
            surface_of(path.read_bytes())
    wild = replace(made, table=replace(table, amounts=np.full_like(table.amounts, 1e38)))
    touch, moved = wild.press("disc", at=AT, depth=1e-4, radius=2e-3)
    assert touch.status == "damaged"
    assert np.isnan(moved).all()
    write_surface(tmp_path / "whole.epsm")
    data = (tmp_path / "whole.epsm").read_bytes()
    for size in range(0, len(data), 997):
        with pytest.raises(ModelError):
            surface_of(data[:size])
