"""Loads in a study file: units, keys, what they forbid, and each mistake by name."""

import pytest

from epsmesh.plan.key import case_key, mesh_key, operator_key, reference_key
from epsmesh.plan.plan import make_plan
from epsmesh.plan.symmetry import is_round, model_planes
from tests.cases import raw, refusal, study

DOWN = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]
CAP = {"around": ["9 mm", "0 mm", "0 mm"], "radius": "3 mm"}
PULL = {"on": CAP, "traction": ["1 kPa", "0 Pa", "0 Pa"]}
AIR = {"on": "sides", "pressure": "1 kPa"}
HEAVY = {"young": "10 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}
SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.3}


def pulled(**changes):
    return {"load": {"traction": [PULL | changes]}}


# section changes -> what the message must hold: the key, what was found, what is allowed
MISTAKES = {
    "gravity without density": ({"load": {"gravity": DOWN}}, ["material.density", "1060 kg/m^3"]),
    "layer without density": (
        {"load": {"gravity": DOWN}, "body": {"layer": [SKIN, SKIN | {"name": "fat", "thickness": "18 mm"}]}},
        ["body.layer[1].density", "is required for gravity"],
    ),
    "bare number": ({"load": {"gravity": ["0", "0", "-9.81 m/s^2"]}}, ["load.gravity", "an acceleration"]),
    "wrong unit": ({"material": HEAVY | {"density": "1060 g"}}, ["material.density", "a density"]),
    "no vector": ({"load": {"gravity": "9.81 m/s^2"}}, ["load.gravity", "3 values"]),
    "unknown key": ({"load": {"gravty": DOWN}}, ["load.gravty", "did you mean `gravity`?"]),
    "unknown face": (pulled(on="tops"), ['load.traction[1].on = "tops"', "`top`"]),
    "held face": (pulled(on="bottom"), ["load.traction[1].on", "is fixed"]),
    "half a cap": (pulled(on={"around": CAP["around"]}), ["load.traction[1].on", "radius"]),
    "cap off the body": (
        pulled(on=CAP | {"around": ["9 mm", "0 mm", "8 mm"]}), ["load.traction[1].on", "8 mm off", "1.5 mm"],
    ),
    "cap under the probe": (pulled(on=CAP | {"radius": "7 mm"}), ["load.traction[1].on", "overlaps the tool"]),
    "both": (pulled(pressure="1 kPa"), ["load.traction[1]", "needs either"]),
    "neither": ({"load": {"traction": [{"on": "top"}]}}, ["load.traction[1]", "needs either `pressure`"]),
    "sweep without a name": (
        {"load": {"traction": [{"on": "top", "pressure": ["1 kPa", "2 kPa"]}]}},
        ["load.traction[1].pressure", "`name`"],
    ),
    "column": (pulled() | {"mesh": {"outside": "free", "epsilon": "8 mm"}}, ["mesh.outside", '"coarse"']),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(mistake):
    changes, expected = MISTAKES[mistake]
    said = refusal(raw(**changes))
    assert all(part in said for part in expected), said


def test_units_are_read():
    load, ours = ({"gravity": ["0 m/s^2", "0 cm/s^2", acceleration]} for acceleration in ("-981 cm/s^2", "-9.81 m/s^2"))
    one, other = (study(load=g, material=HEAVY | {"density": d}).case(()) for g, d in
                  ((load, "1.06 g/cm^3"), (ours, "1060 kg/m^3")))  # fmt: skip
    assert case_key(one) == case_key(other)
    assert one.load.gravity == (0.0, 0.0, -9.81)


def test_keys_hold_loads_and_densities_that_act():
    plain, dense = study().case(()), study(material=HEAVY).case(())
    assert case_key(plain) == case_key(dense)
    assert case_key(plain) == case_key(study(load={"gravity": ["0 m/s^2"] * 3}).case(()))
    cases = [plain, study(**pulled()).case(())]
    cases += [study(material=HEAVY | {"density": d}, load={"gravity": DOWN}).case(()) for d in ("1 g/cm^3", "2 g/cm^3")]
    assert len({case_key(case) for case in cases}) == len(cases)
    for key in (mesh_key, operator_key, lambda case: reference_key(case, 1e-3)):
        assert len({key(case) for case in cases}) == 1


def test_an_inclusion_weighs_what_it_is_made_of():
    ball = {"name": "ball", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.3}
    case = study(body={"inclusion": [ball]}, material=HEAVY).case(())
    assert case.densities == (1060.0, 1060.0)
    heavier = study(body={"inclusion": [ball | {"density": "2000 kg/m^3"}]}, material=HEAVY).case(())
    assert heavier.densities == (1060.0, 2000.0)
    assert case_key(case) == case_key(heavier)


def test_only_symmetry_that_loads_have_is_used():
    def planes(**load):
        return model_planes(study(material=HEAVY, load=load).case(()))

    assert planes(gravity=DOWN) == ("x", "y")
    assert planes(gravity=["1 m/s^2", "0 m/s^2", "0 m/s^2"]) == ("y",)
    assert planes(traction=[PULL]) == ("y",)
    assert planes(traction=[{"on": "sides", "pressure": "1 kPa"}]) == ("x", "y")
    assert planes(traction=[PULL | {"on": CAP | {"around": ["9 mm", "9 mm", "0 mm"]}}]) == ()


def test_round_scenes_with_loads_are_solved_in_three_dimensions():
    body = {"shape": "cylinder", "radius": "30 mm", "height": "20 mm"}
    assert is_round(study(body=body).case(()))
    assert not is_round(study(body=body, material=HEAVY, load={"gravity": DOWN}).case(()))


def test_what_loads_do_is_not_scaled_and_f_exact_is_that_without_loads():
    sweep = {"material": HEAVY | {"young": ["10 kPa", "20 kPa"]}, "solve": {"exact": True}}
    loaded, plain = (make_plan(study(**sweep, **load)) for load in ({"load": {"gravity": DOWN}}, {}))
    assert [len(set(plan.keys)) for plan in (loaded, plain)] == [2, 1]
    assert loaded.reference_keys == plain.reference_keys


def test_a_traction_is_swept_by_its_name():
    swept = study(load={"traction": [{"name": "air", "on": "top", "pressure": ["1 kPa", "2 kPa"]}]})
    assert [axis.name for axis in swept.axes] == ["air_pressure"]


def test_places_on_either_side_are_no_images_where_loads_act():
    line = {"line": {"from": ["-8 mm", "0 mm"], "to": ["8 mm", "0 mm"], "steps": 3}}
    probe = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "path": line}
    loaded, plain = (make_plan(study(probe=probe, **load)) for load in ({"load": {"traction": [AIR]}}, {}))
    assert [len(set(plan.keys)) for plan in (loaded, plain)] == [3, 2]
