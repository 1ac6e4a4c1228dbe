"""The far field of a body's surface: what is held stays where it is, and under the tool it is what the force tells."""

from math import pi

import numpy as np
import pytest

from epsmesh.compat import geometry_dofs
from epsmesh.mesh.curve import EDGES
from epsmesh_realtime.export import far, region, tabulate
from epsmesh_realtime.export.compliance import compliances
from epsmesh_realtime.export.curved import curved_model
from epsmesh_realtime.export.far import far_fields
from epsmesh_realtime.export.placed_force import PlacedForce
from epsmesh_realtime.export.scope import scope_of
from epsmesh_realtime.export.surface import tabulate_surface
from epsmesh_realtime.export.surface_body import inclusions, surface_body
from epsmesh_realtime.surface import SurfaceTable
from tests.export.test_export import AS_USUAL, CYLINDER, DISC, DOME, SKIN, Known, study
from tests.realtime.synthetic import point_force, random_surface

POISSON = 0.4
BOX = {"shape": "box", "size": ["40 mm", "50 mm", "20 mm"]}


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Few places are solved for."""
    monkeypatch.setattr(far, "_SIZE", 2)
    monkeypatch.setattr(far, "_HELD_OUT", 1)
    monkeypatch.setattr(tabulate, "_POISSONS", 2)


def volume_within(table: SurfaceTable) -> float:
    """Return the volume (m³) that triangles hold which all face outwards."""
    a, b, c = (table.points[table.triangles[:, i]].astype(float) for i in range(3))
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6)


def test_surfaces_of_inclusions_are_drawn_where_they_are_from_the_middle_of_the_face():
    ball = {"name": "lump", "at": ["5 mm", "-2 mm", "-9 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.4}
    (case,) = study(body=BOX | {"inclusion": [ball]}).cases()
    model = random_surface(turned=True).model
    points, triangles = inclusions(case.body, model)
    away = np.linalg.norm(model.origin + points @ model.axes - [5e-3, -2e-3, -9e-3], axis=1)
    np.testing.assert_allclose(away, 4e-3, rtol=1e-4)
    assert triangles.max() == len(points) - 1
    (bare,) = study(body=BOX).cases()
    assert inclusions(bare.body, model) is None


@pytest.mark.parametrize(
    ("body", "volume"),
    [(CYLINDER, pi * 20**2 * 20e-9), pytest.param(BOX, 40 * 50 * 20e-9, marks=pytest.mark.nightly)],
)
def test_the_far_field_is_that_of_the_body(body, volume):
    scope = scope_of(study(body=body))
    pressed = surface_body(scope, None, 0.5)
    mesh, region = pressed.mesh, pressed.region
    corners, middles = np.split(mesh.mesh.geometry.x[geometry_dofs(mesh.mesh)], [4], axis=1)
    ends = corners[:, EDGES]
    assert np.abs(middles - ends.mean(axis=2)).max() < 0.1 * np.ptp(ends, axis=2).max()  # no quarter points
    table = tabulate_surface(far_fields(pressed, (POISSON, POISSON + 1e-9)), np.zeros(3))
    assert table.modes.shape[2] < 40
    assert volume_within(table) == pytest.approx(volume, rel=5e-3)
    held = np.flatnonzero(table.points[:, 2] < -region.thickness + 1e-6)
    for place in ((0.0, 0.0), (-0.004, 0.007)):
        regular = table.far(*place, POISSON)
        near = point_force(table.points - np.array([*place, 0.0]), POISSON)
        room = region.room(*place)
        assert room * np.abs(near[held] + regular[held]).max() < 0.03
    under = np.argmin(np.linalg.norm(table.points - np.array([*place, 0.0]), axis=1))
    x, y = table.points[under, :2].tolist()
    ((known, *_),) = compliances(mesh, region, [(x, y)], POISSON)
    assert room * abs(-table.far(x, y, POISSON)[under, 2] - known) < 0.03
    assert table.error < 0.1


def test_a_skin_has_a_far_field_of_its_own(monkeypatch):
    monkeypatch.setattr(region, "_TO_TISSUE", 1)
    scope = scope_of(study(body=CYLINDER | {"layer": [SKIN | {"thickness": "6 mm"}]}))
    pressed = surface_body(scope, None, 0.5)
    table = tabulate_surface(far_fields(pressed, scope.poissons), np.zeros(3))
    middle = np.argmin(np.linalg.norm(table.points, axis=1))
    # Tissue a fourth as stiff below it yields more than a half-space of skin; were it all skin, its support less.
    assert 0.4 < -pressed.region.thickness * table.far(0.0, 0.0, scope.poisson)[middle, 2] < 0.55


def test_what_a_force_on_a_dome_does_elsewhere_a_force_there_does_here():
    """E. Betti, 1872: of the field next to a force, and of what the body's own shape and support add to it."""
    scope = scope_of(study(body=DOME, probe=DISC | {"radius": "5 mm"}))
    model, *_ = curved_model(scope, Known(10e3), *AS_USUAL)
    pressed = surface_body(scope, model, 0.0)
    table = tabulate_surface(far_fields(pressed, scope.poissons), model.origin)
    a, c, below = 30e-3, 15e-3, -5e-3
    # Of the ellipsoid, points that are below the support are part of the body, too.
    assert volume_within(table) == pytest.approx(4 / 3 * pi * a**2 * c, rel=0.02)
    near = np.flatnonzero((np.hypot(*table.points[:, :2].T) < 0.25 * a) & (table.points[:, 2] > 0))
    here = near[np.argmin(np.linalg.norm(table.points[near, :2], axis=1))]
    there = near[np.argmin(np.linalg.norm(table.points[near, :2] - (6e-3, 3e-3), axis=1))]

    def moved(force: int, point: int) -> float:
        x, y = table.points[force, :2].tolist()
        turns = [model.spot(*table.points[n, :2].tolist()).turn for n in (force, point)]
        away = (table.points[[point]] - table.points[force]).astype(float) @ turns[0].T
        own = point_force(away, scope.poisson)[0] @ turns[0]
        return float((own + table.far(x, y, scope.poisson)[point]) @ turns[1][2])

    assert moved(here, there) == pytest.approx(moved(there, here), rel=0.03)
    x, y = table.points[here, :2].tolist()
    held = np.flatnonzero(table.points[:, 2] < below - 1e-6)
    turn = model.spot(x, y).turn
    own = point_force((table.points[held] - table.points[here]).astype(float) @ turn.T, scope.poisson) @ turn
    assert model.thickness * np.abs(own + table.far(x, y, scope.poisson)[held]).max() < 0.03
    assert table.error < 0.1


def test_the_field_of_a_force_turns_with_it():
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    centre, points = np.array([0.01, -0.02, 0.03]), np.random.default_rng(4).standard_normal((20, 3))
    points[:, 2] = -np.abs(points[:, 2])
    rows = tuple(tuple(row) for row in turn.tolist())
    placed, plain = PlacedForce(0.4, tuple(centre), 0.01, rows), PlacedForce(0.4, (0.0, 0.0, 0.0), 0.01)
    world = centre + points @ turn
    np.testing.assert_allclose(placed.at(world), plain.at(points) @ turn, rtol=1e-9)
    np.testing.assert_allclose(placed.stress(world), turn.T @ plain.stress(points) @ turn, rtol=1e-8, atol=1e-12)
    assert placed.above(world) <= 0 < placed.above(centre + turn[2:])


@pytest.mark.parametrize("least", [1, 2, 5, 6])
def test_no_more_modes_are_kept_than_it_takes(least):
    asked = []
    assert far.least_rank(6, lambda rank: asked.append(rank) or rank >= least) == least
    assert len(asked) <= 3
    assert far.least_rank(6, lambda _: False) == 6  # of none that serves all
