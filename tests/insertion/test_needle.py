"""Insertion of a round needle: paths through states with closed forms, and what is refused."""

import re
from dataclasses import replace
from itertools import pairwise
from math import nan, pi

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import quad
from scipy.optimize import brentq

from epsmesh import workflow
from epsmesh.insertion.paths import followed, paths, possible
from epsmesh.insertion.steps import CUTTING, INDENTATION, WITHDRAWAL
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.report.headline import headline
from epsmesh.report.insertion import answer
from epsmesh.run.record import Record
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane import needle
from epsmesh.solve.plane.opening import Opening
from epsmesh.solve.solution import Request
from epsmesh.states import OK, PARTIAL
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.insertion.scenes import SHAFT, answered
from tests.studies import changed

RADIUS, FRICTION, STORED, TORN, SQUEEZE, STIFFNESS = 0.5e-3, 0.25, 6e-3, 3e-3, 30.0, 2e4  # m, 1, N, N, N/m, N/m²
POWER = SQUEEZE * RADIUS / (STORED + TORN)
CUT = (STORED + TORN) * (1 - 0.01**2)  # 30 mm are a hundred times half the length of the crack
NEEDLE = {
    "shape": "sphere",
    "radius": "0.5 mm",
    "contact": "unilateral",
    "friction": FRICTION,
    "toughness": "5 J/m^2",
    "insertion": {"to": "6 mm", "steps": 24, "withdraw": True},
}
SCENE = SHAFT | {"probe": NEEDLE}


def scene(**probe):
    return parse(SCENE | {"probe": NEEDLE | probe})


def record(solve):
    """Return a record: F = K d² on the intact body, and energies per depth in the cut one, which grow with Γ."""
    probe = solve.case.probe
    scale = {"young": solve.case.scale.stress, "depth": solve.case.scale.length, "force_error": 1e-3}
    if probe.crack:
        assert (probe.depth, probe.friction) == (RADIUS, 1.0)
        share = probe.crack.toughness / 5
        energies = {"energy": share * STORED * RADIUS, "friction_force": share * SQUEEZE * RADIUS}
        return Record(solve.key, OK, force=share * (STORED + TORN), **energies, **scale)
    (tissue, *_) = (*solve.case.body.layer, solve.case.material)
    force = tissue.young / 30e3 * STIFFNESS * probe.depth**2
    return Record(solve.key, OK, force=force, energy=force * probe.depth / 3, **scale)


def solved(study, fails=lambda solve: False, reached=nan):
    def answer(solve):
        failed = Record(solve.key, "failed", "tissue is turned inside out", depth_reached=reached)
        return failed if fails(solve) else record(solve)

    return answered(study, answer)


def path_of(study, **how):
    (path,) = paths(*solved(study, **how))
    return path


def energy(depth, power=POWER):
    """Return the sections' energies down to a depth (m), over that of the shaft's: those of a ball, then of a shaft."""
    end = min(depth, RADIUS)
    tip, _ = quad(lambda height: (2 * height / RADIUS - (height / RADIUS) ** 2) ** (power / 2), 0, end)
    return tip + max(depth - RADIUS, 0.0)


@pytest.fixture(scope="module")
def path():
    return path_of(scene())


def test_tissue_is_pierced_where_the_intact_body_has_the_energy_of_the_cut_one(path):
    depth = brentq(lambda d: STIFFNESS * d**3 / 3 - CUT * energy(d), 0.4e-3, 3e-3)
    assert path.status == OK
    assert path.punctures[0].depth == pytest.approx(depth, rel=1e-4)
    plan, records = solved(scene())
    assert all(skipped.name != "duplicates" for skipped in plan.skipped)  # its stages are one state
    told = " ".join(headline(build(plan, records)))
    of_depth, of_force = map(float, re.findall(r"Puncture at (\S+) ± .* at 6 mm: F = (\S+) ±", told)[0])
    assert of_depth == pytest.approx(1e3 * path.punctures[0].depth, rel=0.01)
    assert of_force == pytest.approx(1e3 * path.steps[-1].force, rel=0.01)
    assert path.punctures[0].force == pytest.approx(STIFFNESS * depth**2, rel=1e-4)
    assert path.punctures[0].after.force < path.punctures[0].force
    # Half a radius of what a cut takes per depth is the bar of the energy.
    assert path.punctures[0].depth_error >= CUT * RADIUS / 2 / path.punctures[0].force
    assert {step.phase for step in path.steps if step.depth < depth} == {INDENTATION}


def test_a_puncture_before_the_depth_that_load_steps_reached_is_found():
    """Depths double: 2 mm fails, and the puncture is between 1 mm and the 1.5 mm that were reached."""
    (free,) = path_of(scene()).punctures
    assert 1e-3 < free.depth < 1.2e-3
    found = {
        reached: path_of(scene(), fails=lambda solve: solve.case.probe.depth > reached, reached=reached)  # noqa: B023
        for reached in (1.5e-3, 1.03e-3)
    }
    assert found[1.5e-3].status == OK
    assert found[1.5e-3].punctures[0].depth == pytest.approx(free.depth, rel=2e-3)
    short = found[1.03e-3]
    assert (short.punctures, short.status) == ((None,), PARTIAL)
    assert short.steps[-1].depth == 1e-3


def test_tissue_too_tough_for_the_depth_that_load_steps_reached_names_a_toughness_that_is_pierced():
    """What is known there is kept, though it is at no depth of the path."""
    fails, end = lambda solve: solve.case.probe.depth > 1.03e-3, 0.99 * 1.03e-3
    plan, records = solved(scene(), fails=fails, reached=1.03e-3)
    ((short, _),) = followed(plan, records)
    known = build(plan, records)
    assert known["depth_reached"].item() == pytest.approx(end, rel=1e-3)
    assert known["force_reached"].item() == pytest.approx(STIFFNESS * end**2, rel=1e-3)
    assert short.message.startswith("1.02 mm: the tissue folds before it is pierced: too tough")
    (toughness,) = re.findall(r"about (\S+) J/m² would be pierced \(here 5 J", short.message)
    assert 0.5 < float(toughness) < 5
    weaker = path_of(scene(toughness=f"{toughness} J/m^2"), fails=fails, reached=1.03e-3)
    assert weaker.status == OK and weaker.punctures[0] and weaker.reached is None
    assert any("the last depth solved" in line for line in answer(known))


def test_the_shaft_cuts_at_a_constant_force_and_its_friction_grows(path):
    cut = [step for step in path.steps if step.phase == CUTTING]
    for step in cut:
        assert step.elastic + step.cutting == pytest.approx(CUT)
        assert step.friction == pytest.approx(FRICTION * SQUEEZE * energy(step.depth, POWER - 1), rel=2e-3)
    assert cut[-1].error < cut[0].error < 2 * cut[0].force
    assert all(abs(step.balance) < 0.02 for step in path.steps)


def test_withdrawal_cuts_nothing_and_friction_is_reversed(path):
    assert [step.depth for step in path.withdrawal] == [step.depth for step in path.steps]
    last = path.steps[-1]
    for step in path.withdrawal:
        assert (step.phase, step.cutting, step.fracture) == (WITHDRAWAL, 0.0, last.fracture)
        assert step.friction < 0
        assert abs(step.balance) < 0.02
    assert path.withdrawal[-1].friction == -last.friction
    assert path.withdrawal[0].stored < last.stored
    assert path.withdrawal[0].rubbed > last.rubbed


def test_a_needle_that_cannot_be_pressed_deep_enough_leaves_what_is_solved():
    path = path_of(scene(), fails=lambda solve: not solve.case.probe.crack and solve.case.probe.depth > 0.6e-3)
    assert path.status == PARTIAL and not any(path.punctures)
    assert [step.depth for step in path.steps] == pytest.approx([0.25e-3, 0.5e-3])
    assert path.message == "1 mm: tissue is turned inside out"


def test_a_path_costs_each_of_its_solves_once():
    plan, records = solved(scene())
    cost = dict.fromkeys(("time_mesh", "time_assemble", "time_setup", "time_solve"), 0.25)
    found = build(
        plan, {key: replace(one, cells=n, iterations=2, **cost) for n, (key, one) in enumerate(records.items())}
    )
    assert float(found["time_total"]) == len(records) > 2
    assert int(found["cells"]) == len(records) - 1 and int(found["iterations"]) == 2 * len(records)


def test_what_a_path_may_need_is_planned():
    """All that it needs is in that plan; of the depth of the puncture, it has another one in its place."""
    study = scene()
    plan, records = solved(study)
    stages = {key: records[key] for key in plan.keys}
    planned = possible(plan, stages)
    assert len(planned.keys) >= len(records) - len(stages)
    assert len({*records} - {*stages, *planned.keys}) == 1
    assert possible(plan, records) is None


def test_each_round_of_solves_shows_its_progress(monkeypatch, tmp_path):
    """What a path needs besides is planned once its states are solved."""
    opened, shown = workflow.Opened(), []

    def execute(plan, opened, *_):
        opened.records |= {solve.key: record(solve) for solve in plan.solves}

    monkeypatch.setattr(workflow, "_execute", execute)
    plan = make_plan(scene())
    workflow.run(plan, opened, MPI.COMM_SELF, tmp_path, lambda part: shown.append(len(part.solves)))
    assert shown[0] == len(plan.solves) and len(shown) > 1
    assert sum(shown) == len(opened.records)


def test_friction_is_no_input_of_the_states_and_toughness_is_one():
    first, rough, tough = (solved(scene(**more))[1] for more in ({}, {"friction": 0.5}, {"toughness": "6 J/m^2"}))
    assert first.keys() == rough.keys()
    assert 0 < len(first.keys() & tough.keys()) < len(first)


def test_deep_in_tissue_neither_the_body_nor_the_mesh_nor_the_tip_has_an_effect():
    smaller = SCENE | {"body": SCENE["body"] | {"height": "30 mm"}, "mesh": {"accuracy": "1 %"}}
    pointed = NEEDLE | {"shape": "cone", "angle": "45 deg", "tip": "0.2 mm"}
    found = [solved(parse(one)) for one in (SCENE, smaller, SCENE | {"probe": pointed})]
    cracks = [{key for key, one in records.items() if one.friction_force > 0} for _, records in found]
    assert cracks[0] == cracks[1] == cracks[2] and len(cracks[0]) == 1


def test_twice_the_modulus_and_the_toughness_needs_twice_the_force(monkeypatch):
    ratios = np.array([0.1, 1.0, 10.0])
    power = Opening(ratios, ratios**3, 3 * ratios**2, ratios, np.full(3, pi / 4))
    monkeypatch.setattr(needle, "open_crack", lambda *_: power)

    def answer(young, toughness):
        law, movement = MaterialLaw.of_moduli(young, 0.5, "neo-hookean"), Movement.along((0.0, 0.0, -RADIUS))
        return needle.NeedleSolver(RADIUS, toughness, needle.plane_cuts).answer(Request(law, movement))

    # μ = 10 kPa; f = ρ³ and Γ = μ R/2 give ρ = 1 and e = 2 μ R².
    soft, stiff = answer(30e3, 2.5), answer(60e3, 5.0)
    assert soft.reaction[2] == pytest.approx(2 * 10e3 * RADIUS**2)
    assert soft.energy == pytest.approx(10e3 * RADIUS**3)
    assert soft.contact.friction_force == pytest.approx(3 * 10e3 * RADIUS**2)
    assert stiff.reaction[2] == pytest.approx(2 * soft.reaction[2])


def test_a_narrow_column_is_softer_and_has_a_larger_bar():
    whole, narrow = (
        path_of(parse(SCENE | {"mesh": {"accuracy": "2 %", **more}}))
        for more in ({}, {"epsilon": "3 mm", "outside": "free"})
    )
    forces = [path.steps[-1].elastic + path.steps[-1].cutting for path in (whole, narrow)]
    assert forces[1] == pytest.approx(0.99 * (STORED + TORN))
    assert narrow.steps[-1].error - whole.steps[-1].error > abs(forces[1] - forces[0]) / 2
    both = SCENE | {"body": SCENE["body"] | {"fixed": "bottom+sides"}}
    held = path_of(parse(both))
    last = held.steps[-1]
    assert last.elastic + last.cutting == pytest.approx(STORED + TORN)
    assert last.error - whole.steps[-1].error == pytest.approx(0.01**2 / 0.02 * last.force, rel=0.1)
    assert path_of(parse(both | {"mesh": {"accuracy": "2 %", "epsilon": "3 mm", "outside": "free"}})) == narrow
    split = path_of(parse(SCENE | {"mesh": {"accuracy": "2 %", "epsilon": "0.85 mm", "outside": "free"}}))
    assert split.message == (
        "the needle deep in tissue: its crack is 0.3 mm long to each side, beside which less than 0.9 mm are kept"
    )


def layered(toughness, young="30 kPa", **probe):
    """Return a study of a layer of 5 mm on tissue of another ``toughness`` and modulus."""
    layer = {"name": "skin", "thickness": "5 mm", "young": "30 kPa", "poisson": 0.49, "toughness": "5 J/m^2"}
    below = SCENE["material"] | {"young": young}
    probe = NEEDLE | {"toughness": toughness, "insertion": {"to": "9 mm", "steps": 36, "withdraw": True}} | probe
    return parse(SCENE | {"body": SCENE["body"] | {"layer": [layer]}, "material": below, "probe": probe})


def test_a_layer_of_the_same_tissue_changes_nothing():
    one, two = path_of(scene(insertion=NEEDLE["insertion"] | {"to": "9 mm", "steps": 36})), path_of(layered("5 J/m^2"))
    assert two.punctures[0].depth == one.punctures[0].depth and two.punctures[1] is None
    assert [step.force for step in two.steps] == pytest.approx([step.force for step in one.steps])
    assert [step.work for step in two.withdrawal] == pytest.approx([step.work for step in one.withdrawal], rel=1e-3)


def test_a_tougher_layer_is_indented_before_it_is_cut():
    path, (cut, tougher) = path_of(layered("20 J/m^2")), (CUT, 4 * CUT)
    first = np.sqrt(cut / STIFFNESS)  # where the lower tissue alone bears the force at which the upper one is cut

    def excess(below):
        gained = STIFFNESS * ((first + below) ** 3 - first**3) / 3 - cut * below + above * below**2 / 2
        return gained - (tougher - cut) * energy(below)

    above = 30e3 / (1 - 0.49**2) * RADIUS  # half of what a half-space of the upper tissue adds
    below = brentq(excess, 1e-6, 3e-3)
    one, two = path.punctures
    assert path.status == OK and one.depth < 2e-3
    assert two.depth == pytest.approx(5e-3 + below, abs=1e-6)
    assert 0 < two.depth_error < 3 * RADIUS
    assert two.before.elastic == pytest.approx(STIFFNESS * (first + below) ** 2 + above * below, rel=1e-3)
    assert two.after.elastic + two.after.cutting < two.before.elastic
    assert two.after.crack_depth > two.before.crack_depth == 5e-3
    assert {step.phase for step in path.steps if 5e-3 < step.depth < two.depth} == {INDENTATION}
    last = path.steps[-1]
    assert last.elastic + last.cutting == pytest.approx(tougher)
    assert all(abs(step.balance) < 0.02 for step in (*path.steps, *path.withdrawal))


def test_a_layer_that_is_cut_more_easily_is_not_indented():
    path = path_of(layered("2.5 J/m^2"))
    assert path.punctures[0] and path.punctures[1] is None
    last = path.steps[-1]
    assert last.elastic + last.cutting == pytest.approx(CUT / 2)
    assert all(abs(step.balance) < 0.02 for step in (*path.steps, *path.withdrawal))


def test_a_layer_that_is_not_pierced_is_indented_to_the_end():
    path = path_of(layered("400 J/m^2"))
    assert path.status == OK and path.punctures[1] is None
    last = path.steps[-1]
    assert (last.depth, last.phase, last.crack_depth) == (9e-3, INDENTATION, 5e-3)
    assert path.withdrawal[-1].elastic == pytest.approx(last.elastic) and path.withdrawal[0].stored < last.stored


@pytest.mark.parametrize("tenths", [86, 91, 97])
def test_each_depth_on_a_layer_is_solved_once(tenths):
    """Where its curve starts is known to a tolerance: the last depth is no other one when it is sought again."""
    depths = []

    def note(solve):
        if not (solve.case.probe.crack or solve.case.body.layer):
            depths.append(solve.case.probe.depth)

    solved(layered("400 J/m^2", insertion={"to": f"{tenths / 10} mm", "steps": 20}), fails=note)
    depths.sort()
    assert len(depths) > 4 and all(deeper > 1.001 * depth for depth, deeper in pairwise(depths))


def test_a_layer_that_cannot_be_cut_ends_the_path_at_its_interface():
    path = path_of(layered("10 J/m^2"), fails=lambda one: one.case.probe.crack and one.case.probe.toughness == 10.0)
    assert path.status == PARTIAL and path.message == "5 mm: the needle deep in tissue: tissue is turned inside out"
    assert path.steps[-1].depth == 5e-3 and path.punctures[0] and not path.withdrawal


def test_a_path_may_end_as_near_to_the_bottom_as_is_allowed():
    """The height less ten radii is not 6 mm to the last digit."""
    path = path_of(parse(SCENE | {"body": SCENE["body"] | {"height": "11 mm"}}))
    assert path.status == OK and path.steps[-1].depth == 6e-3


@pytest.mark.parametrize(
    ("section", "keys", "told"),
    [
        ("material", {"law": "linear"}, "strains are above 1"),
        ("mesh", {"epsilon": "6 mm", "outside": "fixed"}, "would hold the tissue that the shaft pushes aside"),
        ("body", {"shape": "box", "size": ["60 mm", "60 mm", "40 mm"]}, "needs a cylinder, and the needle on its axis"),
        ("probe", {"at": ["3 mm", "0 mm"]}, "needs a cylinder, and the needle on its axis"),
        ("probe", {"insertion": {"to": "38 mm"}}, "leaves less than 5 mm, ten radii of the needle"),
        ("probe", {"toughness": None}, "is required for an insertion"),
        ("sensitivity", {"young": ["10 kPa", "20 kPa"]}, r"are of one force: omit it, or them"),
    ],
)
def test_what_is_not_computed_is_refused_by_name(section, keys, told):
    with pytest.raises(StudyError, match=told):
        parse(changed(SCENE, **{section: keys}))
