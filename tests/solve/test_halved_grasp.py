"""Two equal jaws solved as one tool on half of the body: the numbers are those of the whole, and only then."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.solved import solve_alone
from epsmesh.scene.model import JAW, PROBE
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.solve.contact import large, pull
from epsmesh.study.read import parse
from tests.cases import ROUGH
from tests.solve.test_grasp import BALL, BLADE, DISC, LARGE, closed, grasp

ALL = ("x", "y", MIDDLE)
SIDES = {"fixed": "sides"}
SLIPS = BALL | {"friction": 0.3, "pull": "0.2 mm", "pull_direction": [0, 1, 0]}
OF_BOX = {"size": ["20 mm", "40 mm", "40 mm"], "fixed": "bottom"}
AT_SIDE = {"at": ["10 mm", "0 mm", "-20 mm"]}
FROM_BELOW = {"at": ["0 mm", "0 mm", "-20 mm"]}
PYRAMID: dict[str, Any] = {
    "shape": "pyramid", "sides": 3, "angle": "65 deg", "tip": "0.5 mm", "depth": "0.3 mm", "contact": "unilateral",
}  # fmt: skip


def layers(*given: tuple[str, str | None, str]) -> dict[str, Any]:
    """Return layers of a body, by name, thickness and modulus."""
    found = [{"name": name, "thickness": thick, "young": young, "poisson": 0.3} for name, thick, young in given]
    return {"layer": [{key: value for key, value in layer.items() if value is not None} for layer in found]}


SKINS = layers(("skin", "4 mm", "30 kPa"), ("fat", "12 mm", "10 kPa"), ("other_skin", None, "30 kPa"))
IN_PAIRS = layers(("a", "4 mm", "30 kPa"), ("b", "6 mm", "10 kPa"), ("c", "6 mm", "10 kPa"), ("d", None, "30 kPa"))
LUMP = {"name": "lump", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "3 mm", "young": "50 kPa", "poisson": 0.3}


def with_both(*jaws: Any, **changes: Any) -> Any:
    """Return the record of a grasp that is solved with both jaws, on what other planes of symmetry leave."""
    plan = make_plan(parse(grasp(*jaws, **changes)))
    (one,) = plan.solves
    plan = plan.with_solves([replace(one, mirrors=tuple(plane for plane in one.mirrors if plane != MIDDLE))])
    (record,) = compute(plan, MPI.COMM_SELF).values()
    return record


def planes(*jaws: Any, **changes: Any) -> tuple[str, ...]:
    """Return the planes of symmetry on which a grasp is solved."""
    (solve,) = make_plan(parse(grasp(*jaws, **changes))).solves
    return solve.mirrors


@pytest.mark.parametrize(
    ("jaw", "changes", "reached"),
    [
        pytest.param(BALL, {}, 1e-6, id="ball"),
        pytest.param(DISC, {"body": SIDES}, 1e-6, id="disc, sides fixed"),
        pytest.param(BLADE | {"direction": [0, 1, 0]}, {}, 1e-6, id="blade", marks=pytest.mark.nightly),
        pytest.param(BALL | {"friction": 0.3}, {}, 1e-6, id="friction"),
        pytest.param(BALL | {"depth": "0.8 mm"}, {"material": LARGE}, 1e-6, id="large"),
        pytest.param(
            BALL | {"friction": 0.3}, {"material": LARGE}, 1e-5, id="large, friction", marks=pytest.mark.nightly
        ),
        pytest.param(BALL, {"material": {"poisson": 0.49}}, 1e-6, id="mixed", marks=pytest.mark.nightly),
        pytest.param(BALL, {"body": SKINS}, 1e-6, id="layers"),
        pytest.param(BALL, {"body": IN_PAIRS}, 1e-6, id="layers that meet there", marks=pytest.mark.nightly),
        pytest.param(DISC, {"body": {"inclusion": [LUMP]}}, 1e-6, id="inclusion", marks=pytest.mark.nightly),
        pytest.param(BALL | AT_SIDE, {"body": OF_BOX}, 1e-6, id="from the sides"),
        pytest.param(BALL | FROM_BELOW, {}, 1e-6, id="from below", marks=pytest.mark.nightly),
    ],
)
def test_halves_are_the_whole(jaw, changes, reached):
    """Meshes are reflected: both have the same discrete solution."""
    changes = {"body": {"fixed": "none"} | changes.get("body", {})} | {"material": changes.get("material", {})}
    half, whole = closed(jaw, **changes), with_both(jaw, **changes)
    assert half.status == whole.status == "ok", (half.message, whole.message)
    for name in ("force", "energy", "contact_area", "max_strain"):
        assert getattr(half, name) == pytest.approx(getattr(whole, name), rel=reached), name
    assert half.force_vector == pytest.approx(whole.force_vector, abs=reached * half.force)
    for name, value in whole.largest.items():
        if not name.endswith("_error"):
            assert half.largest[name] == pytest.approx(value, rel=reached, abs=reached * half.force, nan_ok=True), name
    assert half.largest["jaw_force"] == pytest.approx(half.force, rel=1e-12)
    assert half.largest["jaw_force_error"] == pytest.approx(half.force_error * half.force)
    assert half.largest["jaw_contact_area_error"] == half.contact_area_error * half.contact_area
    assert (half.dofs, half.cells) == (whole.dofs, whole.cells)
    assert half.balance < 1e-6
    # Each bar covers what the other way of computing it has.
    assert 0.2 < half.force_error / whole.force_error < 5


@pytest.mark.parametrize("material", [{}, pytest.param(LARGE, marks=pytest.mark.nightly)], ids=["linear", "large"])
def test_halves_are_pulled_as_the_whole(material, monkeypatch):
    monkeypatch.setattr(large.LargeContact, "STEPS", 4)
    monkeypatch.setattr(pull.PullPaths, "STEPS", 8)
    changes = {"body": SIDES, "material": material, "mesh": ROUGH | {"rim": "1.6 mm"}}
    half, whole = (found(SLIPS, **changes) for found in (closed, with_both))
    assert half.status == whole.status == "ok", (half.message, whole.message)
    assert half.force == pytest.approx(whole.force, rel=1e-5)
    assert half.largest["jaw_pull_force"] == half.largest["pull_force"]
    for name, value in whole.largest.items():
        assert half.largest[name] == pytest.approx(value, rel=2e-2 if name.endswith("_error") else 1e-4, abs=1e-12), (
            name
        )
    assert half.balance < 1e-6


@pytest.mark.nightly
def test_off_the_middle_halves_turn_their_jaws_against_each_other():
    """Without other planes of symmetry, friction gives torques about the axis, which are reflected."""
    jaw = BLADE | {"direction": [1, 1, 0], "at": ["6 mm", "2 mm"], "friction": 0.3}
    half, whole = (found(jaw, body=SIDES) for found in (closed, with_both))
    assert half.torque == pytest.approx(whole.torque, rel=2e-3)
    assert half.largest["jaw_torque"] == pytest.approx(whole.largest["jaw_torque"], rel=2e-3)
    assert half.largest["jaw_torque"] == -half.torque != 0.0
    for axis in "xyz":
        name = f"jaw_force_vector_{axis}"
        assert half.largest[name] == pytest.approx(whole.largest[name], abs=1e-5 * half.force)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ((BALL,), ALL),
        ((BALL | {"pull": "0.1 mm", "friction": 0.3}, {}, SIDES), ("y", MIDDLE)),
        ((BALL | {"at": ["5 mm", "2 mm"]}, {}, SIDES), (MIDDLE,)),
        ((BALL | AT_SIDE, {}, OF_BOX), ("y", MIDDLE)),
        ((BALL, {}, SKINS), ALL),
        ((BALL, {}, {"inclusion": [LUMP]}), ALL),
        ((BALL, {"depth": "0.4 mm"}), ("x", "y")),
        ((BALL, {"radius": "6 mm"}), ("x", "y")),
        ((DISC, {"shape": "sphere", "radius": "5 mm"}), ("x", "y")),
        ((BLADE, {"direction": [0, 1, 0]}), ("x", "y")),
        ((PYRAMID | {"direction": [0, 1, 0]},), ("x", MIDDLE)),
        ((BALL, {}, layers(("skin", "4 mm", "30 kPa"))), ("x", "y")),
        ((BALL, {}, layers(("skin", "4 mm", "30 kPa"), ("fat", None, "20 kPa"))), ("x", "y")),
        ((BALL, {}, layers(("a", "4 mm", "9 kPa"), ("b", "9 mm", "1 kPa"), ("c", None, "9 kPa"))), ("x", "y")),
        ((BALL, {}, {"inclusion": [LUMP | {"at": ["0 mm", "0 mm", "-9 mm"]}]}), ("x", "y")),
        ((BALL | AT_SIDE, {}, OF_BOX | {"inclusion": [LUMP | {"at": ["1 mm", "0 mm", "-10 mm"]}]}), ("y",)),
    ],
)  # fmt: skip
def test_only_equal_halves_are_solved_as_one(content, expected):
    jaw, second, body = (*content, {}, {})[:3]
    assert planes(jaw, second, body={"fixed": "none"} | body) == expected


@pytest.mark.parametrize(
    ("material", "is_one"),
    [
        ({"direction": [0, 1, 0]}, True),
        ({"direction": [0, 0, 1]}, True),
        ({"direction": [1, 0, 1]}, False),
    ],
)  # fmt: skip
def test_fibres_of_both_halves_are_images(material, is_one):
    fibres = LARGE | {"law": "holzapfel", "fibres": {"k1": 0.5, "k2": 2.0} | material}
    assert (MIDDLE in planes(BALL, material=fibres)) == is_one


def test_numbers_of_places_and_fields_are_those_of_the_whole():
    output = [{"name": "deep", "of": "displacement", "at": ["0 mm", "0 mm", "-18 mm"]}]
    assert planes(BALL, output=output) == ("x", "y")
    study = parse(grasp(BALL))
    assert solve_alone(study, study.case(())).mirrors == ("x", "y")


def test_the_mesh_of_both_halves_is_its_own_image():
    study = parse(grasp(DISC, body=SKINS | {"fixed": "none"}))
    case = study.case(())
    half, whole = (mesh_arrays(case, mirrors) for mirrors in (ALL, ("x", "y")))
    assert whole.cells.shape[0] == 2 * half.cells.shape[0]
    assert len(whole.facets[JAW]) == len(whole.facets[PROBE]) == len(half.facets[PROBE])
    assert JAW not in half.facets
    assert half.points[:, 2].min() == pytest.approx(-10e-3)
    for group, height in ((PROBE, 0.0), (JAW, -20e-3)):
        assert whole.points[whole.facets[group], 2] == pytest.approx(height)
    # Layers of the lower half have their own names.
    centres = whole.points[whole.cells[:, :4], 2].mean(axis=1)
    for number, (low, high) in enumerate([(-4e-3, 0.0), (-16e-3, -4e-3), (-20e-3, -16e-3)], start=1):
        assert ((whole.regions == number) == ((low < centres) & (centres < high))).all()
    assert set(np.unique(half.regions)) == {1, 2}


def test_a_grasp_to_a_force_is_solved_on_a_half():
    study = parse(grasp({key: value for key, value in BALL.items() if key != "depth"} | {"force": "10 mN"}))
    (solve,) = make_plan(study).solves
    assert solve.mirrors == ALL


def test_a_closed_grasp_takes_six_linear_solves_with_its_bar():
    """Each active set of degree 2 and below is one, and the bar is one of degree 3."""
    for jaw in (BALL, DISC, BLADE):
        assert closed(jaw).iterations + 1 <= 6


@pytest.mark.mpi
def test_ranks_agree():
    alone, both = (closed(BALL, comm=comm, body=SKINS | {"fixed": "none"}) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["jaw_contact_area"] == pytest.approx(alone.largest["jaw_contact_area"], rel=1e-6)
    assert both.dofs == alone.dofs
