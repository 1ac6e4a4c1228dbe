"""Keys of material laws: what each law needs, its bounds, laws of regions, and keys of cases."""

from math import inf

import pytest

from epsmesh.plan.key import case_key, mesh_key
from epsmesh.plan.plan import make_plan
from epsmesh.plan.symmetry import model_planes
from epsmesh.shapes.tissue import LAWS, NUMBERS_OF_LAWS
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.swept import placed
from epsmesh_identify.sections.parameters import parameters_of
from tests.cases import raw, study

SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.4}
FIBRES = {"direction": [1, 0, 0], "k1": 0.5, "k2": 2.0}
YEOH = {"law": "yeoh", "c2": 0.4}
PARTS = ("body", "material", "probe")

# changes of the study -> parts of the message: key, value, what is allowed
MISTAKES = {
    "unknown law": ({"material": {"law": "hooke"}}, ['material.law = "hooke"', "'mooney-rivlin'"]),
    "missing parameter": ({"material": {"law": "gent"}}, ["material.limit", 'is required with law = "gent"']),
    "missing in a layer": (
        {"body": {"layer": [SKIN | {"law": "yeoh"}]}, "material": {"law": "neo-hookean"}},
        ["body.layer[1].c2", 'is required with law = "yeoh"'],
    ),
    "parameter that no law reads": (
        {"material": {"law": ["linear", "gent"], "limit": 2.0, "c2": 0.3}},
        ["material.c2 = 0.3", 'only with law = "mooney-rivlin" or "yeoh"'],
    ),
    "parameter of a region without a law": (
        {"body": {"inclusion": [BALL | {"c2": 0.3}]}, "material": YEOH},
        ["body.inclusion[1].c2 = 0.3", "only with law"],
    ),
    "terms of a region without a law": (
        {"body": {"layer": [SKIN | {"terms": [{"alpha": 3.0}]}]}, "material": YEOH},
        ['body.layer[1].terms: is read only with law = "ogden"'],
    ),
    "unstable mooney-rivlin": ({"material": {"law": "mooney-rivlin", "c2": 1.1}}, ["material.c2 = 1.1", "0 to 1"]),
    "unstable yeoh": (
        {"material": {"law": "yeoh", "c2": [0.4, -0.6], "c3": 0.1}},
        ["material.c2 = -0.6", "at least -0.5477", "√(3 c3)"],
    ),
    "shares of terms": (
        {"material": {"law": "ogden", "terms": [{"share": 0.7, "alpha": 2.0}, {"share": 0.2, "alpha": 9.0}]}},
        ["material.terms", "add up to 1", "0.9"],
    ),
    "nothing left for a share": (
        {"material": {"law": "ogden", "terms": [{"share": 1.0, "alpha": 2.0}, {"alpha": 9.0}]}},
        ["material.terms", "may omit its share"],
    ),
    "exponent of a term": (
        {"material": {"law": "ogden", "terms": [{"alpha": 0.0}]}},
        ["material.terms[1].alpha = 0.0", "at least 0.1, or at most -0.1"],
    ),
    "value of a term": (
        {"material": {"law": "ogden", "terms": [{"share": -0.2, "alpha": 2.0}, {"alpha": 3.0}]}},
        ["material.terms[1].share = -0.2", "greater than 0"],
    ),
    "too many terms": ({"material": {"law": "ogden", "terms": [{"alpha": 2.0}] * 4}}, ["material.terms", "at most 3"]),
    "no terms": ({"material": {"law": "ogden"}}, ["material.terms", 'is required with law = "ogden"']),
    "fibre of no length": (
        {"material": {"law": "holzapfel", "fibres": {"direction": [0, 0, 0], "k1": 0.5, "k2": 2.0}}},
        ["material.fibres.direction = [0.0, 0.0, 0.0]", "not all zero"],
    ),
    "dispersion": (
        {"material": {"law": "holzapfel", "fibres": FIBRES | {"dispersion": 0.4}}},
        ["material.fibres.dispersion = 0.4", "at most 0.333"],
    ),
    "key of fibres": (
        {"material": {"law": "holzapfel", "fibres": FIBRES | {"angle": 0.4}}},
        ["material.fibres.angle", "unknown key"],
    ),
    "no fibres": ({"material": {"law": "holzapfel"}}, ["material.fibres", 'is required with law = "holzapfel"']),
    "no limit": ({"material": {"law": "gent", "limit": 0.0}}, ["material.limit = 0.0", "at least 0.01"]),
    "small exponent": (
        {"material": {"law": "veronda-westmann", "alpha": 0.1}},
        ["material.alpha = 0.1", "at least 0.25"],
    ),
    "linear among others": (
        {"body": {"layer": [SKIN | {"law": "linear"}]}, "material": {"law": "neo-hookean"}},
        ['body.layer[1].law = "linear"', "in all regions, or in none"],
    ),
    "others among linear": (
        {"body": {"layer": [SKIN | YEOH]}},
        ['body.layer[1].law = "yeoh"', "in all regions, or in none"],
    ),
    "nu of a region": (
        {"body": {"layer": [SKIN | {"poisson": 0.1}]}, "material": {"law": "neo-hookean"}},
        ["body.layer[1].poisson = 0.1", "at least 0.2"],
    ),
    "displacement elements near incompressibility": (
        {"material": {"law": "neo-hookean", "poisson": 0.46}, "mesh": {"element": "displacement"}},
        ["material.poisson = 0.46", "lock", "at most 0.45 with a law of large displacements", 'element = "auto"'],
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    changes, parts = MISTAKES[mistake]
    with pytest.raises(StudyError) as caught:
        parse(raw(**changes))
    assert len(caught.value.problems) == 1
    assert all(part in str(caught.value) for part in parts), caught.value


def test_laws_and_their_parameters_are_dimensions():
    """A parameter that only one law of a sweep reads does not multiply the solves of the others."""
    swept = study(material={"law": ["neo-hookean", "yeoh"], "c2": [0.2, 0.4]}, body={"layer": [SKIN]})
    assert [axis.name for axis in swept.axes] == ["law", "c2"]
    assert len({case_key(case) for case in swept.cases()}) == 3
    assert len({solve.key for solve in make_plan(swept).solves}) == 3
    own = study(body={"layer": [SKIN | {"law": "yeoh", "c2": [0.2, 0.4]}]}, material={"law": "neo-hookean"})
    assert [axis.name for axis in own.axes] == ["skin_c2"]


def test_tables_of_materials_have_laws_of_their_own():
    tables = [{"name": "soft", "young": "5 kPa", "poisson": 0.4, **YEOH}]
    tables += [{"name": "stiff", "young": "9 kPa", "poisson": 0.4, "law": "gent", "limit": 2.0}]
    content = raw()
    content["material"] = tables
    assert [case.material.law for case in parse(content).cases()] == ["yeoh", "gent"]
    content["material"] = [tables[0], tables[1] | {"c2": 0.3}]
    with pytest.raises(StudyError, match=r"material\[2\]\.c2 = 0\.3"):
        parse(content)


def test_a_region_without_a_law_has_that_of_the_material():
    """With its parameters; a layer that says the same has the same key."""
    inherits = study(body={"layer": [SKIN]}, material=YEOH).case(())
    given = study(body={"layer": [SKIN | YEOH | {"c3": 0.0}]}, material=YEOH).case(())
    assert inherits.tissues[1].further == {"c2": 0.4, "c3": 0.0}
    assert case_key(inherits) == case_key(given)
    other = study(body={"layer": [SKIN | YEOH | {"c2": 0.5}]}, material=YEOH).case(())
    assert case_key(inherits) != case_key(other)
    assert mesh_key(inherits) == mesh_key(other)


HISTORY = {"ramp": "1 s", "hold": "10 s"}
RELAXING = {"relaxation": [{"share": 0.8, "time": "1 s"}]}
FAT = {"name": "fat", "young": "5 kPa", "poisson": 0.4}


def filled(*layers, **changes):
    """Return the content of a study whose layers fill the body."""
    changes["body"] = {"layer": list(layers), **changes.get("body", {})}
    content = raw(**changes)
    del content["material"]
    return content


def _given(case):
    """Return what tissue below the skin, and what the others are made of, by their names."""
    lowest = {} if case.body.is_filled else {"fat": case.material}
    tissues = lowest | {region.name: region for region in case.body.regions}
    return {name: (t.law or "linear", t.further, t.prony, t.density) for name, t in sorted(tissues.items())}


@pytest.mark.parametrize("skin", [RELAXING, {"density": "900 kg/m^3"}, YEOH], ids=["relaxation", "density", "law"])
@pytest.mark.parametrize("order", ["skin on fat", "fat on skin"])
def test_layers_that_fill_the_body_are_those_above_a_material(skin, order):
    """No layer or inclusion has what the first layer or another one says of itself."""
    of_fat = {"law": "neo-hookean"} if "law" in skin else {}
    upper, lower = SKIN | skin, FAT | of_fat
    if order == "fat on skin":
        upper, lower = FAT | of_fat | {"thickness": "2 mm"}, SKIN | skin
        del lower["thickness"]
    probe = {"history": HISTORY} if "relaxation" in skin else {}
    ball = BALL | of_fat
    alone = parse(filled(upper, lower, body={"inclusion": [ball]}, probe=probe)).case(())
    found = _given(alone)
    assert found["tumour"] == found["fat"] != found["skin"]
    if order == "skin on fat":
        material = {key: value for key, value in lower.items() if key != "name"}
        below = study(body={"layer": [upper], "inclusion": [ball]}, material=material, probe=probe).case(())
        assert _given(below) == found
        assert (alone.way.formulation, alone.way.in_time) == (below.way.formulation, below.way.in_time)


def test_a_layer_of_a_body_that_layers_fill_is_asked_for_its_law_and_density():
    """Whichever layer it is; a body's law is its own in a sweep of bodies."""
    for layers in ([SKIN | YEOH, FAT], [FAT | {"thickness": "2 mm"}, SKIN | YEOH | {"thickness": "18 mm"}]):
        with pytest.raises(StudyError, match=r'layer\[\d\]\.law: is required.* write law = "yeoh" and its own c2'):
            parse(filled(*layers))
    with pytest.raises(StudyError, match=r"inclusion\[1\]\.law: is required"):
        parse(filled(SKIN | YEOH, FAT | YEOH, body={"inclusion": [BALL]}))
    gravity = {"load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}}
    with pytest.raises(StudyError, match=r"body\.layer\[2\]\.density: is required"):
        parse(filled(SKIN | {"density": "900 kg/m^3"}, FAT, **gravity))
    content = filled(SKIN, FAT)
    own = {**content["body"], "layer": [SKIN | YEOH, FAT | YEOH]}
    content["body"] = [{"name": "linear", **content["body"]}, {"name": "large", **own}]
    content["probe"] |= {"shape": "blade", "length": "4 mm", "width": "0.5 mm", "slice": "1 mm"}
    del content["probe"]["radius"]
    with pytest.raises(StudyError, match=r"probe\.slice.*must be 0 mm with a law of large displacements"):
        parse(content)


def test_an_elastic_layer_in_relaxing_tissue():
    """An empty list is a relaxation of its own."""
    layers = [SKIN, SKIN | {"name": "fat", "relaxation": []}]
    case = study(body={"layer": layers}, material=RELAXING, probe={"history": HISTORY}).case(())
    assert case.relaxations == (((0.8, 1.0),), ((0.8, 1.0),), ())
    assert case.way.in_time


def test_terms_are_swept():
    """A term without a share has what the others leave; equal terms are one case."""
    steep = {"name": "steep", "alpha": [7.0, 9.0]}
    swept = study(material={"law": "ogden", "terms": [{"share": [0.6, 0.7], "alpha": 2.0}, steep]})
    assert [(axis.name, axis.path) for axis in swept.axes] == [
        ("share", "material.terms[1].share"),
        ("steep_alpha", "material.terms[2].alpha"),
    ]
    cases = list(swept.cases())
    assert cases[0].material.further["share2"] == pytest.approx(0.4)
    given = study(material={"law": "ogden", "terms": [{"share": 0.75, "alpha": 2.0}, {"share": 0.25, "alpha": 7.0}]})
    rest = study(material={"law": "ogden", "terms": [{"share": 0.75, "alpha": 2.0}, {"alpha": 7.0}]})
    assert case_key(given.case(())) == case_key(rest.case(()))
    layer = SKIN | {"law": "ogden", "terms": [{"alpha": [7.0, 9.0]}]}
    assert [axis.name for axis in study(body={"layer": [layer]}, material=YEOH).axes] == ["skin_alpha"]
    both = {"law": "ogden", "terms": [{"share": 0.5, "alpha": [2.0, 3.0]}, {"alpha": [7.0, 9.0]}]}
    with pytest.raises(StudyError, match="second dimension alpha: give its table a `name`"):
        parse(raw(material=both))


def test_fibres_are_swept_and_break_symmetry():
    swept = study(
        material={"law": "holzapfel", "fibres": FIBRES | {"k1": [0.2, 0.5], "direction": [[1, 0, 0], [1, 1, 0]]}}
    )
    assert [(axis.name, axis.path) for axis in swept.axes] == [
        ("direction", "material.fibres.direction"),
        ("k1", "material.fibres.k1"),
    ]
    assert [model_planes(case) for case in swept.cases()] == [("x", "y")] * 2 + [()] * 2
    layer = SKIN | {"law": "holzapfel", "fibres": FIBRES | {"k2": [1.0, 2.0]}}
    assert [axis.name for axis in study(body={"layer": [layer]}, material=YEOH).axes] == ["skin_k2"]
    inclined = {"law": "holzapfel", "fibres": FIBRES | {"direction": [0, 1, 1]}}
    assert model_planes(study(material=inclined).case(())) == ("x",)
    everywhere = {"law": "holzapfel", "fibres": FIBRES | {"direction": [1, 1, 0], "dispersion": 1 / 3}}
    assert model_planes(study(material=everywhere).case(())) == ("x", "y")


OF_LAWS = {
    "linear": {},
    "neo-hookean": {},
    "mooney-rivlin": {"c2": 0.3},
    "yeoh": {"c2": 0.4, "c3": 0.1},
    "ogden": {"terms": [{"share": 0.7, "alpha": 2.0}, {"name": "steep", "alpha": 9.0}]},
    "gent": {"limit": 2.0},
    "holzapfel": {"fibres": FIBRES},
    "veronda-westmann": {"alpha": 2.0},
}


@pytest.mark.parametrize("law", LAWS)
def test_every_number_of_a_law_can_be_found_and_goes_on_by_its_key(law):
    """Bounds are those of the schema: a value at them can be read, and one beyond them not."""
    body, material, probe = (study(material={"law": law} | OF_LAWS[law]).sections[name][0] for name in PARTS)
    found = {one.place: one for one in parameters_of(body, material, probe).values() if one.place[:1] == ("material",)}
    numbers = {place for place, value in leaves(OF_LAWS[law]) if isinstance(value, float)}
    assert {place[1:] for place in found if place[1] not in ("young", "poisson")} >= numbers
    for place, one in found.items():
        assert one.least <= one.low <= one.value <= one.high <= one.most
        if one.most < inf and place[1] not in ("young", "poisson"):
            with pytest.raises(StudyError, match=str(place[-1])):
                parse(placed(raw(material={"law": law} | OF_LAWS[law]), [(place, 1.01 * one.most)]))
    assert {key for key in LAWS[law] if key not in ("terms", "fibres")} <= set(NUMBERS_OF_LAWS)


def leaves(value, place=()):
    """Yield places and values of a table in its tables and lists of tables."""
    if isinstance(value, dict):
        for key, own in value.items():
            yield from leaves(own, (*place, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for number, own in enumerate(value):
            yield from leaves(own, (*place, number))
    else:
        yield place, value
