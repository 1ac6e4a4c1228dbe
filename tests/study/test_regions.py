"""Layers and inclusions in a study file: their sweeps, their keys, and each mistake by name."""

import pytest

from epsmesh.plan.key import case_key, mesh_key, reference_key
from epsmesh.study.read import parse
from tests.cases import raw, refusal, study

SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.48}
FAT = {"name": "fat", "young": "5 kPa", "poisson": 0.3}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.45}

# [body] -> what the message must hold: the key, what was found, what is allowed
MISTAKES = {
    "value of a layer": ({"layer": [SKIN, FAT | {"young": 3}]}, ["body.layer[2].young = 3", "10 kPa"]),
    "value of a sweep": ({"layer": [SKIN, FAT | {"poisson": [0.3, 0.7]}]}, ["body.layer[2].poisson = 0.7", "0.5"]),
    "empty sweep": ({"layer": [SKIN | {"young": []}]}, ["body.layer[1].young", "empty list"]),
    "unknown key": ({"inclusion": [BALL | {"axis": 1}]}, ["body.inclusion[1].axis = 1", "`axes`"]),
    "no name": ({"layer": [{k: v for k, v in SKIN.items() if k != "name"}]}, ["body.layer[1].name", "required"]),
    "bad name": ({"layer": [SKIN | {"name": "my skin"}]}, ['body.layer[1].name = "my skin"', "letters, digits"]),
    "same name": ({"layer": [SKIN], "inclusion": [BALL | {"name": "skin"}]}, ["skin", "names must differ"]),
    "one table": ({"layer": SKIN}, ["body.layer", "[[body.layer]]"]),
    "no table": ({"layer": ["skin"]}, ['body.layer[1] = "skin"', "must be a table"]),
    "too thick": ({"layer": [SKIN, FAT | {"thickness": "19 mm"}]}, ["body.layer[2].thickness", "at most", "20 mm"]),
    "too thin": ({"layer": [SKIN, FAT | {"thickness": "3e-16 mm"}]}, ["body.layer[2].thickness", "a millionth"]),
    "thickness missing": ({"layer": [FAT, SKIN]}, ["body.layer[1].thickness", "only the last"]),
    "nothing left": ({"layer": [SKIN | {"thickness": "20 mm"}, FAT]}, ["body.layer[2].thickness", "has no room"]),
    "ball or ellipsoid": ({"inclusion": [BALL | {"axes": ["1 mm"] * 3}]}, ["body.inclusion[1]", "radius", "axes"]),
    "near the surface": (
        {"inclusion": [BALL | {"at": ["0 mm", "0 mm", "-4.3 mm"]}]}, ["body.inclusion[1].at", "0.4 mm", "0.3 mm"],
    ),
    "outside": ({"inclusion": [BALL | {"at": ["30 mm", "0 mm", "-10 mm"]}]}, ["body.inclusion[1].at", "inside"]),
    "across a layer's end": (
        {"layer": [SKIN | {"thickness": "9 mm"}], "inclusion": [BALL]}, ["body.inclusion[1].at", "-9 mm"],
    ),
    "touching": (
        {"inclusion": [BALL, BALL | {"name": "other", "at": ["8.1 mm", "0 mm", "-10 mm"]}]},
        ["body.inclusion[2].at", "from tumour", "the distance is 0.1 mm"],
    ),
    "locking of a layer": ({"layer": [SKIN | {"poisson": 0.499}]}, ["body.layer[1].poisson = 0.499", "lock"]),
}  # fmt: skip


def layered(**changes):
    """Return a box of skin on fat, which leave nothing to [material]."""
    content = raw(body={"layer": [SKIN | changes, FAT]})
    del content["material"]
    return parse(content)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    body, parts = MISTAKES[mistake]
    mesh = {"element": "displacement"} if "locking" in mistake else {}
    said = refusal(raw(body=body, mesh=mesh))
    assert all(part in said for part in parts), said


def test_every_value_of_a_piece_is_swept():
    found = study(
        body={"layer": [SKIN | {"thickness": ["2 mm", "3 mm"]}], "inclusion": [BALL | {"radius": ["3 mm", "4 mm"]}]},
        material={"poisson": [0.3, 0.4, 0.45]},
    )
    assert [axis.name for axis in found.axes] == ["skin_thickness", "tumour_radius", "poisson"]
    assert found.axes[1].path == "body.inclusion[1].radius"
    assert found.shape == (2, 2, 3)
    assert str(found.case((1, 0, 2))) == "skin_thickness = 3 mm, tumour_radius = 3 mm, poisson = 0.45"
    case = found.case((1, 0, 2))
    assert [tissue.poisson for tissue in case.tissues] == [0.45, 0.48, 0.45]
    assert (case.body.interfaces, case.poisson, case.way.element) == ((-0.003,), 0.48, "mixed")


def test_material_is_needed_for_what_is_left_and_for_nothing_else():
    content = raw(body={"layer": [SKIN]})
    del content["material"]
    assert "[material]" in refusal(content)
    assert "is not used" in str(study(body={"layer": [SKIN, FAT]}).warnings)
    assert "sweeps nothing" in refusal(raw(body={"layer": [SKIN, FAT]}, material={"poisson": [0.3, 0.4]}))
    assert layered().case(()).scale.stress == 60e3


def test_forces_scale_with_all_moduli_together_only():
    first, second = layered(young=["60 kPa", "30 kPa"]).cases()
    assert case_key(first, scaled=True) != case_key(second, scaled=True)
    assert mesh_key(first) == mesh_key(second)
    content = raw(body={"layer": [SKIN | {"young": "30 kPa"}, FAT | {"young": "2.5 kPa"}]})
    del content["material"]
    half = parse(content).case(())
    assert case_key(half, scaled=True) == case_key(first, scaled=True) != case_key(half)
    assert reference_key(half, 1e-3) == reference_key(first, 1e-3)
    soft, stiff = study(body={"inclusion": [BALL]}, material={"young": ["10 kPa", "20 kPa"]}).cases()
    assert case_key(soft, scaled=True) != case_key(stiff, scaled=True)


def test_the_same_layers_said_in_another_way_have_one_key():
    (first,) = layered().cases()
    content = raw(body={"layer": [SKIN, FAT | {"thickness": "18 mm"}]})
    del content["material"]
    assert case_key(parse(content).case(())) == case_key(first)
