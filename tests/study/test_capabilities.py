"""The table of features: a case knows those that it has, and what is refused or done the long way says why."""

import itertools
from dataclasses import replace

import pytest

from epsmesh.study.capabilities.features import FEATURES
from epsmesh.study.capabilities.obstacles import OBSTACLES, obstacle
from epsmesh.study.capabilities.refusals import REFUSALS
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.cases import BLADE, NO_SIZES, raw, study
from tests.studies import changed

SPHERE = {"shape": "sphere", "radius": "6 mm", "depth": "0.2 mm", "contact": "unilateral"}
# A tilted tool touches beside its axis, an ellipsoid has no layers, and mixed elements are for larger ν: these are
# refused before the table is asked.
_BEFORE = ("would touch the body", "a sphere has no edge", "an ellipsoid has no layer", "mixed elements need")
TISSUE = {"young": "20 kPa", "poisson": 0.3, "density": "1 g/cm^3"}
HAVING = {
    "unilateral contact": {"probe": SPHERE},
    "tool that is not flat": {"probe": SPHERE},
    "friction": {"probe": SPHERE | {"friction": 0.3}},
    "inclined touch of a linear law": {"probe": SPHERE | {"axis": [0.1, 0, -1]}, "material": {"law": "linear"}},
    "rounded edge": {"probe": {"edge": "0.2 mm", "contact": "unilateral"}},
    "six motions": {"probe": {"motion": "all"}},
    "slice": {"probe": BLADE | {"slice": "0.1 mm"}},
    "slit": {"probe": BLADE | {"incision": "6 mm"}},
    "insertion": {
        "probe": BLADE | {"contact": "unilateral", "toughness": "5 J/m^2", "insertion": {"to": "6 mm"}, "depth": None}
    },
    "large displacements": {"material": {"law": "neo-hookean"}},
    "time steps": {"material": {"law": "neo-hookean"}, "probe": {"history": {"ramp": "1 s"}}},
    "loads": {"load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}, "material": {"density": "1 g/cm^3"}},
    "column": {"mesh": {"epsilon": "9 mm", "outside": "free"}},
    "half ball": {"mesh": {"epsilon": "9 mm", "outside": "halfspace"}},
    "Green's function": {"mesh": {"epsilon": "9 mm", "outside": "green"}},
    "curved or inclined surface": {"probe": {"axis": [0.1, 0, -1]}},
    "degree 1": {"mesh": {"degree": 1}},
    "mixed elements": {"mesh": {"element": "mixed"}},
    "accuracy": {"mesh": NO_SIZES | {"accuracy": "1 %"}},
    "fixed column": {"mesh": {"epsilon": "12 mm", "outside": "fixed"}},
    "frictionless contact": {"probe": {"contact": "frictionless"}},
    "range of depths": {"probe": SPHERE | {"mesh_depths": ["0.1 mm", "0.3 mm"]}},
    "open slit": {"probe": BLADE | {"incision": "6 mm", "ends": "open"}},
    "oblique slit": {"probe": BLADE | {"incision": "6 mm", "direction": [1, 1, 0]}},
    "fixed sides": {"body": {"fixed": "bottom+sides"}},
    "only sides fixed": {"body": {"fixed": "sides"}},
    "free column": {"mesh": {"epsilon": "9 mm", "outside": "free"}},
    "ν < 0.2": {"material": {"poisson": 0.1}},
    "layers": {"body": {"layer": [{"name": "skin", "thickness": "6.77 mm", **TISSUE}]}},
    "inclusion": {"body": {"inclusion": [{"name": "a", "at": ["9 mm", "9 mm", "-9 mm"], "radius": "2 mm", **TISSUE}]}},
    "curved body": {"body": {"shape": "ellipsoid", "axes": ["30 mm"] * 3, "fixed": {"below": "-5 mm"}}},
}


def test_a_plain_press_has_no_feature_but_its_linear_law_and_its_box():
    assert study().case(()).features == {"linear law", "no round scene"}


def _scene(found):
    """Return the first case of a study, with the tool as it is given: an insertion's cases are its states."""
    case = next(found.cases())
    return replace(case, probe=found.tool(case))


@pytest.mark.parametrize("name", HAVING)
def test_a_case_knows_its_features(name):
    assert name in _scene(study(**HAVING[name])).features


def test_every_row_names_features():
    told = {name for refusal in REFUSALS for name in (refusal.first, refusal.second)}
    hindering = {name for found in OBSTACLES.values() for name in found}
    assert told | hindering == set(FEATURES)


def test_two_features_are_refused_if_the_table_says_so():
    """A study that has both of them is refused with the reason of their row, or there is none."""
    reasons = (*(refusal.reason for refusal in REFUSALS), *_BEFORE)
    for pair in itertools.combinations(HAVING, 2):
        first, second = sorted(
            (HAVING[name] for name in pair), key=lambda changes: "shape" not in changes.get("probe", {})
        )
        if any(
            first[section][key] != second[section][key]
            for section in first.keys() & second.keys()
            for key in first[section].keys() & second[section].keys()
        ):
            continue  # two tools, two outsides
        content = changed(raw(**first), **{name: first.get(name, {}) | keys for name, keys in second.items()})
        try:
            case = _scene(parse(content))
        except StudyError as error:
            assert any(reason in str(error) for reason in reasons), (pair, error)
        else:
            assert {*pair} <= case.features, pair
            assert not any({r.first, r.second} <= case.features for r in REFUSALS), pair


def test_an_obstacle_is_told_with_its_reason():
    case = study(**HAVING["loads"]).case(())
    assert "three dimensions" in obstacle("meridian", case)
    assert obstacle("F_exact", case) == ""


@pytest.mark.parametrize(
    ("exact", "mesh", "has"), [(None, {}, True), (None, "accuracy", False), (True, "accuracy", True)]
)
def test_exact_forces_are_the_default_and_beside_an_accuracy_they_are_asked_for(exact, mesh, has):
    case = study(**(HAVING[mesh] if mesh else {}), solve={"exact": exact}).case(())
    assert ("F_exact" in case.features) == has


FIELD = {"young": {"formula": "20 kPa*(1 - z/(20 mm))"}}
SPREAD = {"spread": {"young": "30 %", "correlation_length": "4 mm"}}
FIBRES = {"law": "holzapfel", "fibres": {"direction": [1, 0, 0], "k1": 0.5, "k2": 2.0}}


@pytest.mark.parametrize(
    ("feature", "own", "key"),
    [("varying stiffness", FIELD, "young"), ("spread", SPREAD, "spread"), ("fibres", FIBRES, "law")],
)
def test_what_a_layer_sets_is_named_by_the_key_of_the_layer(feature, own, key):
    layer = {"name": "skin", "thickness": "3 mm", "young": "20 kPa", "poisson": 0.3}
    large = {"law": "neo-hookean"} if own is FIBRES else {}
    skin, fat = (layer | own, layer) if feature != "fibres" else (layer | own, layer | large)
    layers = [fat | {"name": "fat"}, skin]
    case = study(material=large, body={"layer": layers}).case(())
    assert FEATURES[feature].told(case)[0] == f"body.layer[2].{key}"
    assert FEATURES[feature].told(study(material=large | own).case(()))[0] == f"material.{key}"
    for way in ("SOFA scene", "real-time model"):
        if feature in OBSTACLES[way]:
            assert (
                obstacle(way, replace(case, probe=study().case(()).probe)).startswith(f"body.layer[2].{key}: ") or large
            )


def test_a_spread_of_a_layer_is_refused_with_its_key():
    layer = {"name": "skin", "thickness": "3 mm", "young": "20 kPa", "poisson": 0.3}
    with pytest.raises(StudyError, match=r"body\.layer\[1\]\.spread: with friction"):
        parse(raw(body={"layer": [layer | SPREAD]}, probe=SPHERE | {"friction": 0.3}))
