"""The half-space of a law on a linear body, against full solves of other bodies at large displacements."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh.study.read import parse
from epsmesh_realtime.export.checks import Check
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.export.near import calibrated, near_field, needed_room
from epsmesh_realtime.export.ranks import ALONE
from epsmesh_realtime.export.scope import ExportError, scope_of
from epsmesh_realtime.table import Near
from tests.realtime.synthetic import of_place

LAYER = {"shape": "cylinder", "radius": "800 mm", "height": "40 mm"}
TISSUE = {"young": "10 kPa", "poisson": 0.3, "law": "neo-hookean"}
BALL = {"shape": "sphere", "radius": "10 mm", "depth": "1 mm"}
RADIUS = 1e-2


def study(**sections):
    return parse({"body": LAYER, "material": TISSUE, "probe": BALL, "mesh": {"accuracy": "1 %"}} | sections)


def test_a_half_space_of_a_law_on_a_linear_layer_is_that_layer_of_the_law():
    scope = replace(scope_of(study()), poissons=(0.3, 0.3))
    assert scope.law == {"law": "neo-hookean"}
    solver = Solver(scope.sections | {"body": LAYER}, scope.file, scope.young, 2e-3, scope.law)
    near = near_field(scope, solver, ALONE)
    assert near.error < 5e-3
    # c and h of the layer, of small strain, from two discs
    radii, plane, small = np.array([3e-3, 6e-3]), 1 / (1 - 0.3**2), replace(solver, law={})
    forces = [small.press(Tool("disc", a), (0.0, 0.0), 1e-5, 0.3).force for a in radii]
    rests = 1e-5 * scope.young / np.array(forces) - 0.5 / (plane * radii)
    c, h = np.linalg.solve(np.column_stack([np.ones(2), radii**2 / 3]), rests)
    body = replace(of_place(c, h, 0.3), thickness=0.04, largest=0.4, young=scope.young)
    model = replace(body, near=replace(near, room=0.05, support=0.08))
    ball, fulls = Tool("sphere", RADIUS, contact="unilateral"), {}
    for share in (0.3, 0.7):
        fulls[share] = full = solver.press(ball, (0.0, 0.0), share * RADIUS, 0.3)
        touch = model.query("sphere", radius=RADIUS, at=(0.0, 0.0, 0.0), depth=share * RADIUS)
        error, bar = abs(touch.force[2] / full.force - 1), touch.force_error / touch.force[2]
        assert error < min(bar, 0.004)
        assert touch.contact_radius == pytest.approx(full.radius, rel=0.02)
    linear = body.query("sphere", radius=RADIUS, at=(0.0, 0.0, 0.0), depth=0.3 * RADIUS).force[2]
    assert abs(linear / fulls[0.3].force - 1) > 0.02


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"body": {"shape": "ellipsoid", "axes": ["30 mm", "30 mm", "15 mm"], "fixed": {"below": "-5 mm"}}}, "boxes"),
        ({"probe": {"shape": "cone", "angle": "70 deg", "radius": "3 mm", "depth": "0.1 mm"}}, 'shape = "sphere"'),
        ({"probe": {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "bonded"}}, 'shape = "sphere"'),
        ({"material": TISSUE | {"law": ["neo-hookean", "linear"]}}, "several laws"),
        ({"material": TISSUE | {"law": "yeoh", "c2": [0.1, 0.2]}}, "several laws"),
        (
            {"material": TISSUE | {"law": "holzapfel", "fibres": {"direction": [1, 0, 0], "k1": 0.5, "k2": 2.0}}},
            "fibres",
        ),
    ],
)
def test_what_has_no_model_at_large_displacements_is_refused(sections, words):
    with pytest.raises(ExportError, match=words):
        scope_of(study(**sections))


def test_the_effect_of_the_support_is_fitted_to_full_solves():
    curve = Near(np.array([[[1.05, 0.05]], [[0.95, -0.05]]]), 1.2, 0.0, 0.0)
    bare = replace(of_place(-20.0, 3e4, 0.3), thickness=0.04, largest=0.4)
    true = replace(bare, near=replace(curve, support=0.13))
    checks = []
    for share in (0.1, 0.4, 0.6):
        tool, depth = Tool("sphere", RADIUS, contact="unilateral"), share * RADIUS
        touch = true.query("sphere", radius=RADIUS, at=(0.0, 0.0, 0.0), depth=depth)
        full = float(touch.force[2])
        checks.append(Check(0.0, 0.0, RADIUS, depth, 0.3, full, 0.0, full, touch.force_error / full, 3, tool))
    found = calibrated(bare, curve, checks)
    assert found.support == pytest.approx(0.13, rel=0.1)
    wrong = [replace(check, full=off * check.full) for off, check in zip((0.97, 1.03, 0.97), checks, strict=True)]
    assert calibrated(bare, curve, wrong).room > 2 * found.room


def test_bars_cover_what_they_are_calibrated_on():
    touch = Check(0.0, 0.0, 1e-3, 5e-4, 0.3, 1.0, 0.002, 1.02, 0.16)  # 2 % off; bar 16 % with the unit, 1 % without
    small = replace(touch, force=0.995)
    room = needed_room([touch, small], [0.01, 0.01])
    assert 0.01 + room * 0.15 > 0.02
    assert needed_room([small], [0.01]) > 0
