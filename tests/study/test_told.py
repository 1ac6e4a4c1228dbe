"""What a study's author is told: all errors at once, warnings once and with names, and where to read on."""

import re
from pathlib import Path

import pytest

from epsmesh.study.howto import page_of, pages
from epsmesh.study.keys import all_sections, keys_of
from epsmesh.study.meant import OTHER_SHAPES
from epsmesh.study.named import examples
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse, read_text
from epsmesh.study.schema import SECTIONS
from tests.cases import BLADE, raw, study


def told(content):
    with pytest.raises(StudyError) as caught:
        parse(content, file="my.toml")
    return caught.value


def needles(**changes):
    """Return three probes, of which the second one has the changes."""
    return [{"name": name, **raw()["probe"], **(changes if name == "long" else {})} for name in ("thin", "long", "old")]


def test_what_a_shape_lacks_hides_neither_unknown_keys_nor_wrong_values():
    body = {"shape": "ellipsoid", "axes": ["9 mm"] * 3, "fixed": "top", "colour": 3, "layer": [{"name": "skin"}]}
    content = raw() | {"body": body, "probe": {"shape": "disk", "deth": "1 mm"}}
    assert {problem.key for problem in told(content).problems} == {
        "body.layer", "body.fixed", "body.colour", "probe.shape", "probe.deth",
    }  # fmt: skip


def test_what_does_not_fit_together_is_told_beside_what_cannot_be_read():
    content = raw(mesh={"fine": "9 mm"}, material={"poisson": 0.7}) | {
        "probe": [*needles(), {"name": "bad", "shap": 1}]
    }
    content["probe"][1] |= {"contact": "frictionless", "motion": "all"}
    content["load"] = {"traction": [{"on": "lid", "pressure": "1 kPa"}]}
    assert {problem.key for problem in told(content).problems} == {
        "mesh.fine", "material.poisson", "probe[4].shap", "probe[2].motion", "load.traction[1].on",
    }  # fmt: skip


def test_an_unknown_key_does_not_hide_what_does_not_fit_together():
    probe = {"axis": [0.5, 0, -1], "incison": "1 mm", "length": "4 mm"}
    content = raw(probe=probe, mesh={"degree": 1, "outside": "halfspace", "epsilon": "9 mm", "step": 3})
    problems = {problem.key: problem.allowed for problem in told(content).problems}
    assert set(problems) == {"probe.incison", "probe.length", "mesh.degree", "mesh.step", "mesh.outside"}
    assert problems["probe.incison"] == "unknown key; did you mean `incision`? a disc has none: blade has"
    assert "unknown key; allowed are name, accuracy" in problems["mesh.step"]
    content["probe"] = [{"name": "one", "colour": 1} | content["probe"], {"name": "two"} | raw()["probe"]]
    assert {problem.key for problem in told(content).problems} > {"probe[1].colour", "probe[1].incison", "mesh.degree"}


def test_an_unknown_key_of_one_table_is_told_beside_what_all_of_them_sweep():
    content = raw() | {"probe": needles()}
    for probe in content["probe"]:
        probe["depth"] = ["0.1 mm", "0.2 mm"]
    content["probe"][0]["size"] = []
    assert [problem.key for problem in told(content).problems] == ["probe[1].size"]


def test_errors_and_warnings_name_the_table():
    error = str(told(raw() | {"probe": needles(at=["19 mm", "0 mm"])}))
    assert re.search(r'my\.toml: probe\[2\]\.at = .*\(probe "long"\)', error)
    (warning,) = parse(raw() | {"probe": needles(depth="1 mm")}).warnings
    assert re.search(r'probe\[2\]\.depth = "1 mm": is 33% .*\(probe "long"\)$', warning)
    mesh = {"epsilon": ["4 mm", "full"], "fine": "3 mm"}
    (warning,) = parse(raw(mesh=mesh) | {"probe": needles(radius="5 mm")}).warnings
    assert re.search(r'mesh\.epsilon = "4 mm": is less than the tool\'s radius 5 mm.*\(probe "long"\)$', warning)


def test_an_epsilon_below_an_element_is_told():
    """Meshes of two such ε are the same: the sweep would show a curve that is flat for no reason of the tissue."""
    (warning,) = parse(raw(mesh={"epsilon": ["4 mm", "full"], "fine": "5 mm"})).warnings
    assert "smaller than one element inside it, fine = 5 mm" in warning


def test_a_warning_of_all_tables_names_none_and_stands_once():
    content = raw(mesh={"epsilon": ["2.9 mm", "full"], "fine": "2 mm"}) | {"probe": needles()}
    (warning,) = parse(content).warnings
    assert "tool's radius 3 mm" in warning
    assert "(probe" not in warning


def test_warnings_of_a_sweep_are_one():
    depths = [f"0.{number} mm" for number in range(1, 10)]
    (warning,) = study(probe={"depth": depths}).warnings
    assert 'probe.depth = "0.4 mm": is 13% of' in warning
    assert warning.endswith('; so for 5 more values up to "0.9 mm"')
    (warning,) = study(probe={"depth": depths[2:5]}).warnings
    assert warning.endswith('; so for "0.5 mm"')


def test_materials_named_like_layers_are_said_to_be_a_sweep():
    def materials(*names):
        return raw() | {"material": [{"name": name, "young": "10 kPa", "poisson": 0.3} for name in names]}

    (warning,) = parse(materials("skin", "fat")).warnings
    assert "[[material]]: is a sweep: each case has one material for the whole body (skin, fat" in warning
    assert "[[body.layer]]: docs/guide/study.md" in warning
    assert not parse(materials("liver", "muscle")).warnings
    assert "write [[body.layer]]" in str(told(raw() | {"layer": [{"name": "skin"}]}))


@pytest.mark.parametrize(
    ("content", "page"),
    [
        (raw(body={"layer": 3}), "study"),
        (raw() | {"probe": BLADE | {"incision": "1 m"}}, "insertion"),
        (raw(body={"colour": 1}), "bodies"),
        (raw(mesh={"accuracy": 1}), "choose"),
        (raw(material={"colour": 1}), "study"),
    ],
)
def test_a_refusal_names_the_how_to(content, page):
    assert f"docs/guide/{page}.md" in {problem.howto for problem in told(content).problems}


def test_pages_are_there_and_keys_are_those_of_studies():
    assert [page for page in pages() if not Path(page).is_file()] == []
    used = {page_of(f"{section}.{key.name}") for section in all_sections() for key in keys_of(section)}
    assert used >= set(pages())
    assert page_of("") == ""


SKIN = {"name": "skin", "thickness": "2 mm", "young": "20 mPa", "poisson": 0.4}
BONE = SKIN | {"name": "bone", "young": "18 GPa"}
BALL = {"shape": "sphere", "radius": "200 mm", "depth": "0.01 mm", "contact": "unilateral"}
IMPLAUSIBLE = {
    "thousandths of a pascal": ({"material": {"young": "10 mPa"}}, ["material.young", "0.01 Pa", "10 kPa meant"]),
    "of a layer": ({"body": {"layer": [SKIN]}}, ["body.layer[1].young", "0.02 Pa", "20 kPa meant"]),
    "pascals": (
        {"material": {"young": "10 Pa"}},
        ["material.young", "10 Pa", "softer than any tissue", "10 kPa meant"],
    ),
    "pascals of a formula": (
        {"material": {"young": {"formula": "10 Pa*(1 - z/(9 mm))"}}},
        ['material.young.formula = "10 Pa*(1 - z/(9 mm))"', "10 Pa at the origin", "10 kPa meant"],
    ),
    "gigapascals": ({"material": {"young": "10 GPa"}}, ["10 GPa", "stiffer than soft tissue", "10 kPa meant"]),
    "a layer of steel": ({"body": {"layer": [BONE | {"young": "210 GPa"}]}}, ["stiffer than bone", "210 kPa meant"]),
    "micrometres": ({"probe": {"depth": "0.2 µm"}}, ["probe.depth", "0.2 µm", "0.2 mm meant"]),
    "a ball larger than the body": ({"probe": BALL}, ["probe: is 400 mm wide", "a unit"]),
    "metres": ({"body": {"size": ["40 m", "40 m", "20 m"]}, "mesh": {"epsilon": "full"}}, ["40 m large", "in mm"]),
}


@pytest.mark.parametrize("value", IMPLAUSIBLE)
def test_a_value_that_no_tissue_and_no_tool_has_is_doubted(value):
    changes, parts = IMPLAUSIBLE[value]
    assert any(all(part in warning for part in parts) for warning in study(**changes).warnings), study(
        **changes
    ).warnings
    assert not study(body={"layer": [BONE]}).warnings
    # The radius of a paraboloid is that of its curvature.
    tip = {"shape": "paraboloid", "radius": "50 mm", "shaft": "3 mm", "depth": "0.01 mm", "contact": "unilateral"}
    assert not study(probe=tip).warnings


def test_a_needle_as_thick_as_a_thumb_is_doubted():
    text = examples()["needle-epsilon"].read_text(encoding="utf-8").replace('radius = "0.5 mm"', 'radius = "20 mm"')
    text = re.sub(r'"(40|8) mm"', lambda size: f'"{20 * int(size[1])} mm"', text)
    assert any("probe.radius" in told and "Is 2 mm meant" in told for told in read_text(text, "needle.toml").warnings)


@pytest.mark.parametrize("section", OTHER_SHAPES)
def test_another_name_of_a_shape_is_answered_with_one_that_is_there(section):
    known = SECTIONS[section]
    for other, words in OTHER_SHAPES[section].items():
        assert other not in known, "a shape of its own: these words are never read"
        assert set(re.findall(r'"([a-z]+)"', words)) & {*known}
        assert "not computed" not in words
        assert words in str(told(raw() | {section: {"shape": other}}))
