"""Keys of material laws: what each law needs, its bounds, laws of regions, and keys of cases."""

import pytest

from pipeline.plan.key import case_key, mesh_key
from pipeline.plan.plan import make_plan
from pipeline.study.problems import StudyError
from pipeline.study.read import parse
from tests.cases import raw, study

SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.4}
YEOH = {"law": "yeoh", "c2": 0.4}

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
    "unstable mooney-rivlin": ({"material": {"law": "mooney-rivlin", "c2": 1.1}}, ["material.c2 = 1.1", "0 to 1"]),
    "unstable yeoh": (
        {"material": {"law": "yeoh", "c2": [0.4, -0.6], "c3": 0.1}},
        ["material.c2 = -0.6", "at least -0.5477", "√(3 c3)"],
    ),
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
    for part in parts:
        assert part in str(caught.value)


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
    """With its parameters; a layer that says the same has the same key. Layers that fill the body follow the first."""
    inherits = study(body={"layer": [SKIN]}, material=YEOH).case(())
    given = study(body={"layer": [SKIN | YEOH | {"c3": 0.0}]}, material=YEOH).case(())
    assert inherits.tissues[1].further == {"c2": 0.4, "c3": 0.0}
    assert case_key(inherits) == case_key(given)
    other = study(body={"layer": [SKIN | YEOH | {"c2": 0.5}]}, material=YEOH).case(())
    assert case_key(inherits) != case_key(other)
    assert mesh_key(inherits) == mesh_key(other)
    content = raw(body={"layer": [SKIN | YEOH, {"name": "fat", "young": "5 kPa", "poisson": 0.3}]})
    del content["material"]
    filled = parse(content).case(())
    assert [tissue.law for tissue in filled.tissues] == ["yeoh"] * 3
    assert filled.formulation == "yeoh"
