"""An accuracy for bodies with two contacts: the meshes that are chosen, bars against finer meshes, and balances."""

from functools import lru_cache
from typing import Any

import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.measure import is_graded_to_contact
from epsmesh.study.read import parse
from tests.cases import NO_SIZES, raw, refusal

MESH = NO_SIZES | {"accuracy": "1 %"}
ROUGH = NO_SIZES | {"accuracy": "2 %"}
FINER = {"rim": "0.3 mm", "growth": 0.5, "fine": "5 mm", "degree": 3}
DISC: dict[str, Any] = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "contact": "unilateral"}
BALL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.3 mm", "contact": "unilateral"}
SLICE = {"size": ["30 mm", "30 mm", "10 mm"], "fixed": "none"}
TABLE = {"on": "bottom", "friction": "stick"}
FLAP = {"name": "flap", "thickness": "4 mm", "young": "20 kPa", "poisson": 0.3, "contact": "unilateral"}


def jaws(first: dict[str, Any], second: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the tables of two jaws."""
    return [first | {"together": "grasp"}, second | {"together": "grasp"}]


def scene(body: dict[str, Any], probe: Any, **more: Any) -> dict[str, Any]:
    """Return the study of a body and what touches it, for an accuracy."""
    content = raw(body=body, **{"mesh": MESH} | more)
    content["probe"] = probe
    return content


def solved(content: dict[str, Any], comm: MPI.Comm = MPI.COMM_SELF) -> Any:
    """Return the record of a study of one case."""
    (record,) = compute(make_plan(parse(content)), comm).values()
    assert record.status == "ok", record.message
    return record


SCENES = {
    "balls": scene(SLICE, jaws(BALL, {})),
    "a ball and a disc": scene(SLICE, jaws(BALL, {"shape": "disc", "radius": "3 mm"}), mesh=ROUGH),
    "discs that differ": scene(SLICE | {"fixed": "sides"}, jaws(DISC, {"radius": "4 mm"})),
    "a ball on a table": scene(SLICE | {"support": TABLE}, BALL),
    "a disc on a table": scene(SLICE | {"support": TABLE}, DISC),
    "a ball on a flap": scene({"layer": [FLAP | {"friction": "stick"}]}, BALL),
}


@lru_cache
def solved_once(name: str) -> Any:
    """Return the record of one of the scenes."""
    return solved(SCENES[name])


@pytest.mark.parametrize("name", SCENES)
def test_the_accuracy_is_reached_and_a_finer_mesh_agrees_within_the_bar(name):
    content = SCENES[name]
    found, finer = solved_once(name), solved(content | {"mesh": content["mesh"] | {"accuracy": None} | FINER})
    assert found.force_error <= float(content["mesh"]["accuracy"].removesuffix(" %")) / 100
    assert abs(found.force / finer.force - 1) <= found.force_error + finer.force_error
    for other in ("jaw_force", "support_force", "interface_force"):
        if other in found.largest:
            of_both = found.largest[f"{other}_error"] + finer.largest[f"{other}_error"]
            assert abs(found.largest[other] - finer.largest[other]) <= of_both


@pytest.mark.parametrize(
    ("name", "other"), [("a ball and a disc", "jaw_force"), ("a disc on a table", "support_force")]
)
def test_what_carries_the_force_of_the_tool_alone_has_its_limit_and_its_bar(name, other):
    found = solved_once(name)
    assert found.largest[other] == pytest.approx(found.force, rel=1e-7)
    assert found.largest[f"{other}_error"] == pytest.approx(found.force_error * found.force, rel=1e-6)


def test_each_jaw_has_elements_in_proportion_to_its_own_contact():
    """The second ball has four times the radius: its contact is twice as wide."""
    (solve,) = make_plan(parse(scene(SLICE, jaws(BALL, {"radius": "20 mm"})))).solves
    for mesh in (solve.case.mesh, *(rung.mesh for rung in solve.later)):
        assert mesh.jaw_rim == pytest.approx(2 * mesh.rim, rel=0.03)


@pytest.mark.parametrize(("radii", "graded"), [(("5 mm", "5 mm"), True), (("5 mm", "0.2 mm"), False)])
def test_a_mesh_is_graded_if_it_is_to_both_jaws(radii, graded):
    """Of jaws that differ, it does not matter which one is the first."""
    mesh = {"epsilon": "full", "fine": "5 mm", "coarse": "5 mm", "rim": "0.2 mm", "growth": 0.3}
    for first, second in (radii, radii[::-1]):
        shallow = BALL | {"radius": first, "depth": "0.1 mm"}
        (case,) = parse(scene(SLICE, jaws(shallow, {"radius": second}), mesh=NO_SIZES | mesh)).cases()
        assert is_graded_to_contact(case) == graded


def test_a_pull_is_refused():
    pulled = BALL | {"friction": 0.3, "pull": "0.1 mm"}
    assert "which finer meshes keep" in refusal(scene(SLICE | {"fixed": "sides"}, jaws(pulled, {})))


@pytest.mark.mpi
def test_ranks_agree():
    content = scene(SLICE, jaws(BALL, {"shape": "disc", "radius": "3 mm"}), mesh=NO_SIZES | {"accuracy": "4 %"})
    alone, both = (solved(content, comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-6)
