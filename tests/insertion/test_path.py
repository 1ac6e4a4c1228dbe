"""Paths through a body whose states have closed forms: the puncture, the force of cutting, and what failures leave."""

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad
from scipy.optimize import brentq

from epsmesh.insertion.friction import reaction
from epsmesh.insertion.near_tip import NearTip
from epsmesh.insertion.paths import complete, lacking, possible
from epsmesh.insertion.steps import PHASES
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.report.figures import figure
from epsmesh.report.figures.insertion import insertion
from epsmesh.report.guide import guide
from epsmesh.run.stop import reason_to_skip, waves
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from tests.insertion.scenes import BLADE, FIELD, LENGTH, SCENE, STIFFNESS, elastic, solved, stored
from tests.studies import changed

# The blade on a half-space (N/m), by the rectangle's formula: what tissue above adds at most.
ABOVE = 20e3 / (1 - 0.3**2) * 4e-3 * (0.73 + 1.54 * 0.05**0.75)


def _study(**probe):
    return read_mapping(SCENE | {"probe": BLADE | probe}, "blade")


def _path(study, **how):
    return build(*solved(study, **how))


def _cutting_energy(depth, toughness):
    ahead = FIELD.ahead(toughness)
    return stored(depth, ahead) + toughness * (depth + ahead) * (LENGTH + 2 * ahead)


def test_the_field_near_the_tip_stores_what_the_front_releases():
    """Between two distances of the front, below the tip and beyond both ends, G acts on the area that is added."""
    field, near, far = NearTip(2e-4, 500.0), 1e-5, 8e-4
    depth = 5e-3
    released, _ = quad(lambda a: field.release(a) * (LENGTH + 2 * depth + 4 * a), near, far)
    found = (LENGTH + 2 * depth) * field.per_length(near, far) + field.corners(near, far)
    assert found == pytest.approx(released, rel=1e-6)
    assert field.release(field.ahead(3.0)) == pytest.approx(3.0)
    again = NearTip.through(field.strength, far, field.release(far))
    assert again.bend == pytest.approx(field.bend)


@pytest.mark.parametrize("toughness", [5.0, 0.5])
def test_tissue_is_pierced_where_a_slit_takes_the_energy_of_the_intact_body(toughness):
    """Tough tissue has its front nearer to the tip than any mesh; of soft tissue a farther front is solved."""
    found = _path(_study(toughness=f"{toughness} J/m^2"))
    exact = brentq(lambda d: STIFFNESS * d**2 / 2 - _cutting_energy(d, toughness), 1e-4, 6e-3)
    assert float(found["puncture_depth"]) == pytest.approx(exact, abs=float(found["puncture_depth_error"]))
    assert float(found["puncture_depth"]) == pytest.approx(exact, rel=1e-3)
    assert float(found["puncture_force"]) == pytest.approx(STIFFNESS * exact, rel=1e-3)
    depth = found["depth"].values
    phases = [PHASES[number] for number in found["phase"].values]
    assert phases == ["indentation" if one < exact else "cutting" for one in depth]
    before, after = found["force_at_puncture"].values
    assert before == float(found["puncture_force"]) and 0 < after < before
    energies = sum(found[f"energy_{name}_at_puncture"].values for name in ("stored", "fracture"))
    assert energies[1] == pytest.approx(energies[0], rel=2e-3)


def test_cutting_needs_the_change_of_the_stored_energy_the_toughness_and_friction():
    found = _path(_study()).isel(depth=-1)
    ahead = FIELD.ahead(5.0)
    assert float(found["crack_depth"]) == pytest.approx(6e-3 + ahead)
    assert float(found["force_elastic"]) == pytest.approx(elastic(6e-3, ahead), rel=1e-6)
    assert float(found["force_cutting"]) == pytest.approx(5.0 * (LENGTH + 2 * ahead), rel=1e-6)
    dry = 2 * 0.25 * 2 * stored(6e-3, ahead) / 0.4e-3
    assert float(found["force_friction"]) == pytest.approx(dry / (1 - 0.25 * reaction(6e-3, LENGTH)), rel=1e-6)
    assert float(found["force_error"]) > 0.4 * (float(found["force_friction"]) - dry)


def test_the_work_of_the_tool_is_stored_torn_and_rubbed():
    found = _path(_study())
    assert np.abs(found["energy_balance"].values).max() < 1e-3
    parts = sum(found[name] for name in ("energy_stored", "energy_fracture", "energy_friction"))
    np.testing.assert_allclose(found["work"], parts, rtol=1e-3)
    after = found.isel(depth=found["phase"].values == PHASES.index("cutting"))
    np.testing.assert_allclose(
        np.diff(after["work"]), np.diff(after["depth"]) * (after["force"].values[1:] + after["force"].values[:-1]) / 2,
        rtol=1e-5,
    )  # fmt: skip


def test_the_figure_names_the_phases_and_marks_the_puncture():
    dataset = build(*solved(read_mapping(SCENE, "blade")))
    pierced = 1e3 * dataset["puncture_depth"].item(), 1e3 * dataset["puncture_force"].item()
    above = insertion(dataset, "", "").axes[0]
    places = {text.get_text(): text.get_position()[0] for text in above.texts}
    assert places["indentation"] == pytest.approx(pierced[0] / 2)
    assert places["cutting"] == pytest.approx((pierced[0] + 6) / 2)
    (marked,) = [line for line in above.lines if line.get_marker() == "o"]
    assert [float(at[0]) for at in marked.get_data()] == pytest.approx(pierced)


def test_tissue_that_is_tough_enough_stays_whole_and_without_toughness_is_cut_at_once():
    whole, cut = _path(_study(toughness="1 kJ/m^2")), _path(_study(toughness="0.3 J/m^2"))
    assert np.isnan(whole["puncture_depth"]) and np.all(whole["phase"] == PHASES.index("indentation"))
    np.testing.assert_allclose(whole["force"], STIFFNESS * whole["depth"])
    assert float(cut["puncture_depth"]) < 0.5e-3
    assert np.all(cut["phase"].values[-12:] == PHASES.index("cutting"))


def test_each_layer_is_cut_at_its_toughness():
    layer = {"name": "skin", "thickness": "3.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "8 J/m^2"}
    body = SCENE["body"] | {"layer": [layer]}
    study = read_mapping(SCENE | {"body": body}, "layers")
    found = _path(study)
    skin, below = (found["force_cutting"].sel(depth=at, method="nearest") for at in (2.9e-3, 3.3e-3))
    assert float(skin / below) == pytest.approx(8 / 5, rel=0.01)
    assert abs(found["depth"] - 3.1e-3).min() > 0.19e-3
    assert np.abs(found["energy_balance"].values).max() < 0.02


def test_what_is_cut_stays_cut_in_a_layer_that_the_intact_body_would_not_tear():
    layer = {"name": "fat", "thickness": "3 mm", "young": "20 kPa", "poisson": 0.3}
    probe = BLADE | {"toughness": "60 J/m^2"}
    body = SCENE["body"] | {"layer": [layer | {"toughness": "2 J/m^2"}]}
    found = _path(read_mapping(SCENE | {"body": body, "probe": probe}, "layers"))
    assert float(found["puncture_depth"][0]) < 1.5e-3 and found["message"] == ""
    assert _phases(found) == ["indentation", "cutting", "indentation"] and np.isnan(found["puncture_depth"][1])
    deep, end = found.isel(depth=found["depth"].values > 3e-3), 3e-3
    np.testing.assert_allclose(deep["crack_depth"], end, rtol=1e-3)
    np.testing.assert_allclose(np.diff(deep["force_elastic"]) / np.diff(deep["depth"]), STIFFNESS + ABOVE / 2)
    assert np.abs(found["energy_balance"].values).max() < 0.02


@pytest.mark.parametrize("stiffer", [1.0, 2.0])
def test_a_tougher_layer_is_indented_from_the_force_of_cutting_and_pierced_by_energy(stiffer):
    """The rule of the first puncture: the state with less energy, at equal depth."""
    layer = {"name": "fat", "thickness": "2.1 mm", "young": f"{20 / stiffer} kPa", "poisson": 0.3}
    body = SCENE["body"] | {"layer": [layer | {"toughness": "2 J/m^2"}]}
    study = read_mapping(SCENE | {"body": body, "probe": BLADE | {"insertion": {"to": "6 mm", "steps": 24}}}, "layers")
    found = _path(study)
    assert _phases(found) == ["indentation", "cutting", "indentation", "cutting"]
    second = found.sel(puncture=2)
    stiffness = STIFFNESS + ABOVE / stiffer / 2
    last = found.isel(depth=found["depth"].values < 2.05e-3).isel(depth=-1)
    arrived = float(last["force_elastic"] + last["force_cutting"])
    touch = 2.1e-3 - float(last["crack_depth"] - last["depth"])
    before, after = second["force_elastic_at_puncture"].values + second["force_cutting_at_puncture"].values
    assert before == pytest.approx(arrived + stiffness * (float(second["puncture_depth"]) - touch), rel=1e-6)
    assert before == pytest.approx(2 * after - arrived, rel=0.15)
    energies = sum(second[f"energy_{name}_at_puncture"].values for name in ("stored", "fracture"))
    assert energies[1] == pytest.approx(energies[0], rel=2e-3)
    assert float(second["puncture_force_error"]) > 0.3 / stiffer * STIFFNESS * (
        float(second["puncture_depth"]) - 2.1e-3
    )
    assert float(second["force_friction_at_puncture"][0]) > 0
    assert np.abs(found["energy_balance"].values).max() < 0.02


def test_layers_below_that_cannot_be_solved_end_the_path_at_their_interface():
    layer = {"name": "fat", "thickness": "2.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "2 J/m^2"}
    study = read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [layer]}}, "layers")
    plan, records = solved(study)
    records |= {
        key: replace(records[key], status="failed", message="too thin") for key in records if key not in plan.keys
    }
    found = build(plan, records)
    assert found["status"] == "partial" and found["message"] == "2.1 mm: the intact layers below: too thin"
    assert float(found["force"].dropna("depth")["depth"][-1]) < 2.1e-3


def _phases(path):
    """Return the phases of a path, each once."""
    return [PHASES[number] for number, _ in groupby(path["phase"].values)]


def test_a_state_that_fails_ends_the_path_there_and_earlier_ones_are_kept():
    found = _path(_study(), deepest=5e-3)
    assert float(found["force"].dropna("depth")["depth"][-1]) == pytest.approx(4.5e-3)
    assert found["status"] == "partial" and found["message"] == "5 mm: the mesh is too coarse"
    assert np.all(found["phase"][-3:] == PHASES.index("ended"))
    assert float(found["puncture_depth"]) > 0


@pytest.mark.parametrize(
    ("probe", "key", "allowed"),
    [
        ({"toughness": "200"}, "probe.toughness", "the unit is missing"),
        ({"toughness": "5 N"}, "probe.toughness", "`N` is no unit of a toughness"),
        ({"insertion": {"to": "60 mm"}}, "probe.insertion.to", "must be below 20 mm"),
        ({"insertion": {"to": ["5 mm", "6 mm"]}}, "probe.insertion", "no lists in [probe.insertion]"),
        ({"width": "8 mm"}, "probe.insertion.to", "must be at most 4 mm"),
        ({"width": "50 mm"}, "probe.at", "must be inside the top face"),
        ({"toughness": None}, "probe.toughness", "is required for an insertion"),
        ({"insertion": None, "depth": "1 mm"}, "probe.toughness", "add [probe.insertion]"),
        ({"insertion": {"to": "19.5 mm"}}, "probe.insertion.to", "must be at most 19.2 mm"),
        ({"depth": "1 mm"}, "probe.depth", "its last depth is `to`"),
        ({"contact": "frictionless", "friction": 0}, "probe.contact", 'use contact = "unilateral"'),
        ({"friction": "stick"}, "probe.friction", "give a coefficient"),
        ({"friction": 1.2}, "probe.friction", "must be at most 1"),
        ({"incision": "4 mm"}, "probe.incision", "makes its own slit"),
        ({"length": "39 mm"}, "probe.length", "use a shorter blade"),
        ({"axis": [0.1, 0, -1]}, "probe.insertion", "a blade that goes straight down"),
    ],
)
def test_what_cannot_be_inserted_is_refused(probe, key, allowed):
    with pytest.raises(StudyError) as wrong:
        read_mapping(changed(SCENE, probe=probe), "blade")
    assert any(problem.key == key and allowed in str(problem) for problem in wrong.value.problems), wrong.value


def test_layers_thinner_than_a_step_and_laws_of_large_displacements_are_refused():
    layer = {"name": "skin", "thickness": "0.9 mm", "young": "20 kPa", "poisson": 0.3}
    coarse = BLADE | {"insertion": {"to": "6 mm", "steps": 4}}
    with pytest.raises(StudyError, match=r"skin is thinner than a step, 1.5 mm"):
        read_mapping(SCENE | {"probe": coarse, "body": SCENE["body"] | {"layer": [layer]}}, "blade")
    with pytest.raises(StudyError, match="large displacements"):
        read_mapping(SCENE | {"material": SCENE["material"] | {"law": "neo-hookean"}}, "blade")


def test_tissue_that_the_blade_would_split_has_no_path():
    found = _path(_study(toughness="1 mJ/m^2"))
    assert found["status"] == "failed" and "0.5 mm: the slit would run too far ahead" in str(found["message"].values)
    assert np.isnan(found["force"]).all()


def test_slits_in_tissue_that_is_whole_are_not_solved():
    """The intact body is solved first: it says at which depths its energy could pay for a slit."""
    study = _study(toughness="20 J/m^2")
    plan = make_plan(study)
    first, second = waves(plan, plan.solves)
    assert [solve.case.probe.slit for solve in first] == [None] and len(second) == 12
    _, records = solved(study)
    skipped = [solve for solve in second if reason_to_skip(plan, solve, records.get)]
    assert 0 < len(skipped) < 12
    kept = {key: one for key, one in records.items() if key not in {solve.key for solve in skipped}}
    for name in ("force", "phase", "puncture_depth"):
        np.testing.assert_array_equal(build(plan, kept)[name], build(plan, records)[name])
    assert not any(reason_to_skip(plan, solve, {}.get) for solve in second)


def test_slits_with_a_farther_front_are_found_in_the_store_again():
    """Soft tissue needs them besides the stages: which ones follows from what is solved."""
    plan, records = solved(_study(toughness="0.5 J/m^2"))
    stages = {key: records[key] for key in plan.keys}
    assert lacking(plan, stages) is not None and build(plan, stages)["status"] == "pending"
    assert complete(plan, stages, lambda keys: {key: records[key] for key in keys if key in records}) is None
    assert stages.keys() == records.keys() and build(plan, stages)["status"] == "ok"


def test_toughness_and_friction_are_swept_without_a_solve():
    study = _study(toughness=["2 J/m^2", "8 J/m^2"], friction=[0.1, 0.25])
    one, plan = make_plan(_study()), make_plan(study)
    assert {solve.key for solve in plan.solves} == {solve.key for solve in one.solves}
    found = _path(study)
    assert set(found["force"].dims) == {"toughness", "friction", "depth"} and found["puncture_depth"].shape == (2, 2)
    alone = _path(_study(toughness="8 J/m^2"))
    for name in ("force", "puncture_depth", "energy_friction"):
        np.testing.assert_allclose(found[name].isel(toughness=1, friction=1), alone[name], err_msg=name)
    tough = found["puncture_force"].isel(toughness=1)
    assert np.all(tough > found["puncture_force"].isel(toughness=0)) and tough[0] == tough[1]


def test_swept_layers_have_the_same_depths():
    """Steps are clear of the interfaces of all bodies."""
    layer = {"name": "skin", "thickness": ["2.1 mm", "3.1 mm"], "young": "20 kPa", "poisson": 0.3}
    found = _path(read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [layer]}}, "layers"))
    depth = found["depth"].values
    assert len(depth) == 12 and np.all(np.diff(depth) > 0)
    assert all(np.abs(depth - end).min() >= 0.2e-3 - 1e-9 for end in (2.1e-3, 3.1e-3))


def test_the_guide_answers_for_puncture_and_cutting():
    """A finite ε shifts the puncture most: each of what a path is judged by has a smallest ε of its own."""
    mesh = {"accuracy": "10 %", "epsilon": ["5 mm", "10 mm", "full"], "outside": "free"}
    dataset = _path(read_mapping(SCENE | {"mesh": mesh}, "sweep"))
    shift = xr.DataArray([1.3, 1.02, 1.0], dims="epsilon")
    dataset = dataset.assign(puncture_depth=dataset["puncture_depth"] * shift)
    found = guide(dataset, "5 %")
    assert found.answer.labels["epsilon"] == pytest.approx(10e-3)
    smallest = {part.where["quantity"]: part.answers[0].epsilon for part in found.parts}
    assert smallest == {("depth of the puncture",): 10e-3, ("force of the puncture",): 5e-3, ("last force",): 5e-3}
    assert "puncture and cutting are within 2 % of the full order" in found.sentence
    drawn = figure(dataset, "ratio").axes[0]  # no force, and not all of F/F_max
    assert drawn.get_ylabel() == "share of the full order's"
    assert drawn.get_legend_handles_labels()[1] == ["force of the puncture", "depth of the puncture", "last force"]


def test_tools_with_different_depths_are_refused():
    probes = [BLADE | {"name": "a"}, BLADE | {"name": "b", "insertion": {"to": "5 mm", "steps": 12}}]
    with pytest.raises(StudyError, match="must be one for all tools"):
        read_mapping(SCENE | {"probe": probes}, "blades")


def test_what_is_of_one_force_is_refused():
    measured = {"measurement": [{"name": "push", "file": "push.csv"}]}
    with pytest.raises(StudyError, match=r"probe\.insertion: has no place in \[\[measurement\]\]"):
        read_mapping(SCENE | measured, "blade")


def test_withdrawal_reverses_friction_and_tears_nothing():
    found = _path(_study(insertion={"to": "6 mm", "steps": 12, "withdraw": True}))
    into, out = found.sel(stroke="insertion"), found.sel(stroke="withdrawal")
    assert np.all(out["force_cutting"] == 0) and np.all(out["force_friction"] < 0)
    assert all(np.ptp(out[name].values) == 0 for name in ("energy_fracture", "crack_depth"))
    assert np.all(np.diff(out["energy_friction"]) <= 0) and out["energy_friction"][-1] == into["energy_friction"][-1]
    drag = 0.25 * reaction(6e-3, LENGTH)
    turned = float(out["force_friction"][-1] / into["force_friction"][-1])
    assert turned == pytest.approx(-(1 - drag) / (1 + drag), rel=1e-9)
    assert np.all(out["energy_stored"].values[:-1] < into["energy_stored"].values[-1])
    assert np.abs(found["energy_balance"].values).max() < 1e-3
    assert np.all(out["phase"] == PHASES.index("withdrawal"))


def test_withdrawal_through_layers_has_the_slit_of_the_whole_insertion():
    """With the tip in the upper layer, the front is far below, in the next one: such slits are solved."""
    skin = {"name": "skin", "thickness": "3.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "8 J/m^2"}
    probe = BLADE | {"insertion": {"to": "6 mm", "steps": 12, "withdraw": True}}
    study = read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [skin]}, "probe": probe}, "layers")
    found = _path(study)
    out = found.sel(stroke="withdrawal")
    assert np.abs(found["energy_balance"].values).max() < 0.02
    assert np.all(out["force_cutting"] == 0) and np.all(out["force_friction"] < 0)
    front, beside = float(out["crack_depth"][-1]), FIELD.ahead(8.0)
    for step in (out.isel(depth=number) for number in (1, 3)):
        depth = float(step["depth"])
        ahead = front - depth
        assert float(step["energy_stored"]) == pytest.approx(stored(depth, ahead, beside), rel=0.01)
        exact = elastic(depth, beside) + (LENGTH + 2 * ahead) * FIELD.release(ahead)
        assert abs(float(step["force_elastic"]) - exact) < float(step["force_error"])


def test_a_blade_that_indents_a_tougher_layer_goes_back_the_same_way():
    layer = {"name": "fat", "thickness": "3 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "2 J/m^2"}
    insertion = {"to": "6 mm", "steps": 12, "withdraw": True}
    probe = BLADE | {"toughness": "60 J/m^2", "friction": 0.0, "insertion": insertion}
    found = _path(read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [layer]}, "probe": probe}, "layers"))
    deep = found.isel(depth=found["depth"].values > 3e-3)
    np.testing.assert_allclose(*(deep["force"].sel(stroke=stroke) for stroke in ("insertion", "withdrawal")))
    np.testing.assert_allclose(found["crack_depth"].sel(stroke="withdrawal"), 3e-3, rtol=1e-3)
    assert np.abs(found["energy_balance"].values).max() < 0.02


def test_a_slit_of_the_withdrawal_that_fails_ends_it_there():
    skin = {"name": "skin", "thickness": "3.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "8 J/m^2"}
    probe = BLADE | {"insertion": {"to": "6 mm", "steps": 12, "withdraw": True}}
    plan, records = solved(read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [skin]}, "probe": probe}, "layers"))
    failed = {"status": "failed", "message": "too coarse"}
    records |= {key: replace(one, **failed) for key, one in records.items() if key not in plan.keys}
    found = build(plan, records)
    assert found["status"] == "partial" and found["message"] == "withdrawal, 2.9 mm: too coarse"
    assert np.isfinite(found["force"].sel(stroke="insertion")).all()
    assert float(found["force"].sel(stroke="withdrawal").dropna("depth")["depth"][0]) > 3.1e-3


def test_the_guide_judges_each_puncture():
    mesh = {"accuracy": "10 %", "epsilon": ["5 mm", "10 mm", "full"], "outside": "free"}
    layer = {"name": "fat", "thickness": "2.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "2 J/m^2"}
    scene = SCENE | {"mesh": mesh, "body": SCENE["body"] | {"layer": [layer]}}
    found = guide(_path(read_mapping(scene, "sweep")), "5 %")
    judged = {quantity for part in found.parts for quantity in part.where["quantity"]}
    assert {"force of the puncture", "force of the puncture of layer 2", "depth of the puncture of layer 2"} <= judged


@pytest.mark.parametrize("pierced", [[True, False, False], [False, True, True]])
def test_a_path_with_other_punctures_than_the_full_order_does_not_suffice(pierced):
    mesh = {"accuracy": "10 %", "epsilon": ["5 mm", "10 mm", "full"], "outside": "free"}
    layer = {"name": "fat", "thickness": "2.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "2 J/m^2"}
    dataset = _path(read_mapping(SCENE | {"mesh": mesh, "body": SCENE["body"] | {"layer": [layer]}}, "sweep"))
    kept = xr.DataArray(pierced, dims="epsilon") | (dataset["puncture"] == 1)
    names = [name for name in dataset if str(name).startswith("puncture_")]
    found = guide(dataset.assign({name: dataset[name].where(kept) for name in names}), "5 %")
    assert found.answer.labels["epsilon"] == pytest.approx(10e-3)


def test_the_solves_of_layers_are_known_before():
    """On the layers below, and for the withdrawal: what a plan tells is what a path through them needs."""
    fat = {"name": "fat", "thickness": "2.1 mm", "young": "20 kPa", "poisson": 0.3, "toughness": "2 J/m^2"}
    probe = BLADE | {"insertion": {"to": "6 mm", "steps": 12, "withdraw": True}}
    plan, records = solved(read_mapping(SCENE | {"body": SCENE["body"] | {"layer": [fat]}, "probe": probe}, "layers"))
    told = possible(plan, {key: records[key] for key in plan.keys})
    assert {*told.keys} == {*records} - {*plan.keys}
    assert possible(plan, records) is None
