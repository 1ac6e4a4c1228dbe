"""Models of places on a body's side: those of a place on top of the body turned, and direct solves of a path there."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh.shapes.frame import PlaceError
from epsmesh_realtime.export import far
from epsmesh_realtime.export.curved import curved_model
from epsmesh_realtime.export.export import export
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.export.scope import ExportError, scope_of
from epsmesh_realtime.export.setting import Setting
from tests.export.test_export import AS_USUAL, DISC, DOME, SOFT, Known, study
from tests.organs import ellipsoid, write_stl
from tests.realtime.synthetic import point_force

# The dome on its side: its axes x, y, z are y, z, x of the dome.
ASIDE = DOME | {"axes": ["15 mm", "30 mm", "30 mm"]}
TURN = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])


class KnownAside(Known):
    """Full solves of discs on that body."""

    def press_all(self, tool, at, depths, poissons=None):
        x, y, _ = TURN @ at
        found = super().press_all(tool, (x, y), depths, poissons)
        if tool.motion == "all":
            assert TURN @ tool.axis == pytest.approx(-self.normal(x, y), abs=1e-5)
            for full in found:
                full.stiffness[:3, :3] = TURN.T @ full.stiffness[:3, :3] @ TURN
        return found


def test_a_side_is_the_top_of_the_body_turned():
    top, _, _ = curved_model(
        scope_of(study(body=DOME, probe=DISC | {"at": ["0 mm", "0 mm", "15 mm"]})), Known(10e3), *AS_USUAL
    )
    scope = scope_of(study(body=ASIDE, probe=DISC | {"at": ["16 mm", "0 mm", "0 mm"]}))
    side, _, _ = curved_model(scope, KnownAside(10e3), *AS_USUAL)
    assert side.origin == pytest.approx([15e-3, 0, 0], abs=1e-9)
    assert side.axes == pytest.approx(TURN, abs=1e-9)
    assert side.table.reach == top.table.reach == (6e-3, 6e-3)
    blade = {"tool": "blade", "length": 3e-3, "width": 1e-3}
    for place in np.random.default_rng(1).uniform(-5e-3, 5e-3, (6, 2)):
        x, y, z = (float(part) for part in (*place, Known(10e3).height(*place)))
        for asked in (
            {"tool": "disc", "radius": 2e-3},
            {"tool": "sphere", "radius": 5e-3},
            {"tool": "disc", "contact": "bonded", "radius": 2e-3},
            blade | {"along": (0.6, 0.8, 0.0)},
        ):
            turned = {"along": (0.0, 0.6, 0.8)} if "along" in asked else {}
            known = top.query(at=(x, y, z), depth=2e-5, **asked)
            touch = side.query(at=(z, x, y), depth=2e-5, **asked | turned)
            assert (known.status, touch.status) == ("ok", "ok")
            assert TURN @ touch.force == pytest.approx(known.force, rel=1e-6, abs=1e-7 * known.force[2])
            assert touch.force_error == pytest.approx(known.force_error, rel=1e-6)
    assert side.query("disc", radius=2e-3, at=(15e-3, 7e-3, 0.0), depth=2e-5).status == "outside"
    assert side.query("disc", radius=2e-3, at=(14e-3, 0.0, 0.0), depth=2e-5).status == "off"


def path(*places):
    return DISC | {"path": {"points": [[f"{part} mm" for part in place] for place in places]}}


def test_the_region_is_round_the_middle_of_a_path_and_has_all_its_places():
    scope = scope_of(study(body=ASIDE, probe=path((15, -4, 0), (15, 0, 1), (15, 4, 0))))
    assert Setting.of(scope.case).origin == pytest.approx([15e-3, 0, 1e-3], abs=1e-4)
    assert len(scope.places) == 3
    long = scope_of(study(body=ASIDE, probe=path((15, -8, 0), (15, 0, 0), (15, 7, 0))))
    with pytest.raises(
        ExportError, match=r"probe\.path: its places are up to 7\.\d+ mm from the middle one, and .* 6 mm"
    ):
        curved_model(long, KnownAside(10e3), *AS_USUAL)


def test_a_face_that_turns_away_has_no_region():
    needle = ASIDE | {"axes": ["15 mm", "5 mm", "5 mm"], "fixed": {"below": "-3 mm"}}
    tip = scope_of(study(body=needle, probe=DISC | {"radius": "1.5 mm", "at": ["16 mm", "0 mm", "0 mm"]}))
    setting, middle = Setting.of(tip.case), np.zeros(1)
    assert setting.heights(np.array([0.0, 2e-3]), middle) == pytest.approx(15e-3 * (np.array([[1, 0.84**0.5]]) - 1))
    for away, why in ((3e-3, "inclined by more than 60°"), (5.1e-3, "misses the body")):
        with pytest.raises(PlaceError, match=why):
            setting.heights(np.array([away]), middle)
    with pytest.raises(ExportError, match="does not fit on the face"):
        curved_model(tip, KnownAside(10e3), *AS_USUAL)


@pytest.mark.nightly
def test_a_path_on_an_organs_side_has_a_model_that_answers_there_as_full_solves_do(monkeypatch, tmp_path):
    for name in ("_SIZE", "_HELD_OUT"):
        monkeypatch.setattr(far, name, 2)
    points, facets = ellipsoid(24)
    file = write_stl(tmp_path / "organ.stl", points, facets)
    body = {"shape": "surface", "file": str(file), "unit": "mm", "fixed": {"below": "-24 mm"}}
    # Around the side of an ellipsoid of 60, 45 and 30 mm, where its normal is level, and above and below.
    places = [(46, -28, -4), (48, -24, 0), (50, -20, 5)]
    scope = scope_of(study(body=body, probe=path(*places) | {"radius": "4 mm"}))
    model = (made := export(replace(scope, sections={"body": body, "material": SOFT}), 0.02, 6, surface=True)).model
    assert made.covered == 1.0
    assert abs(model.axes[2, 2]) < 0.3
    solver = Solver({"body": body, "material": SOFT}, "organ", 10e3, 0.01)
    for place in scope.places:
        x, y = (model.axes[:2] @ (place - model.origin)).tolist()
        spot = model.spot(x, y)
        at, normal = model.origin + np.array([x, y, spot.height]) @ model.axes, spot.normal @ model.axes
        first, second, third = model.axes[1].tolist()
        for tool, depth in (
            (Tool("sphere", 5e-3, contact="unilateral"), 4e-4),
            (Tool("blade", length=6e-3, width=2e-3, along=(first, second, third)), 5e-5),
        ):
            touch = model.query(tool.name, at=at.tolist(), depth=depth, **tool.sizes)
            full = solver.press(tool, place, depth, None)
            assert touch.status == "ok"
            assert abs(touch.force @ normal - full.force) < touch.force_error + full.error * full.force
            # Above it is noise: the tool's own normal is the mean of facets below it.
            assert touch.force == pytest.approx(full.vector, abs=0.03 * full.force)
    assert made.surface is not None
    assert made.surface.error < 0.05
    # What is held stays: the half-space's field and R cancel there.
    body_points = model.origin + made.surface.points @ model.axes
    held = np.flatnonzero(body_points[:, 2] < -25e-3)
    spot = model.spot(0.0, 0.0)
    away = (made.surface.points[held] - [0.0, 0.0, spot.height]).astype(float) @ spot.turn.T
    left = point_force(away, 0.45) @ spot.turn + made.surface.far(0.0, 0.0, 0.45)[held]
    assert model.thickness * np.abs(left).max() < 0.03
