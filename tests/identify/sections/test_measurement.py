"""[[measurement]] and [identify] in a study file: what they give, what they leave alone, and each mistake by name."""

from math import inf

import pytest

from epsmesh.plan.key import case_key
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse, read_text
from epsmesh.study.toml import to_toml
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.sections.kept import identification_of, measurements_of
from epsmesh_identify.sections.scenes import scene_of
from tests.cases import raw, refusal

SKIN = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.48}
CURVE = {"name": "punch", "file": "curve.csv"}
RANGE = ["50 N/mm", "64 N/mm"]
HOLD = {"segment": "approach+hold"}


def layered(*measurements, **identify):
    """Return a study of skin on fat with measurements and unknowns."""
    content = raw(body={"layer": [SKIN]})
    if measurements:
        content["measurement"] = [CURVE | own for own in measurements]
    return content | ({"identify": identify} if identify else {})


# measurements, [identify] -> what the message must hold: the key, what was found, what is allowed
MISTAKES = {
    "no file": ([{"file": ""}], {}, ["measurement[1].file", '""']),
    "unknown key": ([{"colums": 1}], {}, ["measurement[1].colums = 1", "`columns`"]),
    "approach": ([{"approach": "auto"}], {}, ["measurement[1].approach", "`segment`", "`window`"]),
    "unknown column": ([{"columns": {"depht": "z"}}], {}, ["measurement[1].columns.depht", "`depth`"]),
    "column 0": ([{"columns": {"force": 0}}], {}, ["measurement[1].columns.force = 0", "number from 1"]),
    "no spring": ([{"columns": {"piezo": 1, "deflection": 2}}], {}, ["measurement[1].columns", "spring together"]),
    "depth twice": (
        [{"columns": {"piezo": 1, "deflection": 2, "spring": "1 N/m", "depth": 3}}], {}, ["columns", "depth and force"],
    ),
    "unit of another kind": ([{"units": {"depth": "N"}}], {}, ["measurement[1].units.depth", "no unit of a length"]),
    "unit unknown": ([{"units": {"force": "sn"}}], {}, ["measurement[1].units.force", "unknown unit `sn`", "mN"]),
    "segment": ([{"segment": "loading"}], {}, ["measurement[1].segment", "'approach'", "'hold'"]),
    "cycle": ([{"cycle": 0}], {}, ["measurement[1].cycle = 0", "at least 1"]),
    "window of two kinds": ([{"window": ["0 mm", "1 s"]}], {}, ["measurement[1].window", "range of depth or time"]),
    "window falls": ([{"window": ["2 mm", "1 mm"]}], {}, ["measurement[1].window", "not below"]),
    "sign": ([{"sign": {"depth": 2}}], {}, ["measurement[1].sign.depth = 2", "1 or -1"]),
    "stiffness without unit": ([{"machine_stiffness": 60}], {}, ["measurement[1].machine_stiffness = 60", "60 N/mm"]),
    "stiffness falls": ([{"machine_stiffness": RANGE[::-1]}], {}, ["measurement[1].machine_stiffness", "rises"]),
    "stiffness of a tool's way": (
        [{"machine_stiffness": "1 N/mm", "depth_is": "tool"}], {}, ["measurement[1]", "depth_is", "excludes"],
    ),
    "two ranges of the machine": (
        [{"machine_stiffness": RANGE}, {"name": "b", "machine_stiffness": "unknown"}],
        {},
        ["measurement[2].machine_stiffness", "the same"],
    ),
    "range twice": (
        [{"machine_stiffness": RANGE}],
        {"machine_stiffness": RANGE},
        ["measurement[1].machine_stiffness", "[identify]"],
    ),
    "known machine": ([{}], {"machine_stiffness": RANGE}, ["identify.machine_stiffness", "is known"]),
    "two of a name": ([{}, {}], {}, ["measurement.name", "punch", "must differ"]),
    "radius of a probe": ([{"probe": {"radius": 2}}], {}, ["measurement[1].probe.radius = 2", "10 mm"]),
    "key of a probe": ([{"probe": {"radios": "2 mm"}}], {}, ["measurement[1].probe.radios", "`radius`"]),
    "name of no array": ([{"probe": {"name": "big"}}], {}, ["measurement[1].probe.name", "this study has [probe]"]),
    "unknown name": ([{}], {"skin_yuong": ["1 kPa", "2 kPa"]}, ["identify.skin_yuong", "`skin_young`"]),
    "unknown in list": ([{}], {"unknown": ["poison"]}, ["identify.unknown", "`poisson`"]),
    "no layer of that name": ([{}], {"unknown": ["fat_young"]}, ["identify.unknown", "fat_young"]),
    "one end": ([{}], {"young": ["1 kPa"]}, ["identify.young", "must be a range", '["1 kPa", "1 MPa"]', "error"]),
    "falls": ([{}], {"young": ["2 kPa", "1 kPa"]}, ["identify.young", "must rise"]),
    "unit of a range": ([{}], {"young": ["1 mm", "2 mm"]}, ["identify.young", "no unit of a pressure"]),
    "not possible": ([{}], {"poisson": [0.2, 0.7]}, ["identify.poisson", "0 to 0.5"]),
    "no error": ([{}], {"poisson": {"value": 0.4}}, ["identify.poisson", "value with an error"]),
    "error of 0": ([{}], {"poisson": {"value": 0.4, "error": 0}}, ["identify.poisson", "above 0"]),
    "large error": (
        [{}], {"skin_thickness": {"value": "2 mm", "error": "60 %"}}, ["identify.skin_thickness", "give a range"],
    ),
    "may hide": ([{}], {"may_hide": ["skin"]}, ["identify.may_hide", "'layer', 'base' or 'strain'"]),
    "radius of several tools": (
        [{"probe": {"radius": "2 mm"}}],
        {"unknown": ["radius"]},
        ["identify.radius", '"punch" has its own', "0.003", "0.002"],
    ),
    "thickness of several specimens": (
        [{"body": {"size": ["40 mm", "40 mm", "8 mm"]}}],
        {"unknown": ["thickness"]},
        ["identify.thickness", '"punch" has its own', "0.02", "0.008"],
    ),
    "relaxation without a hold": (
        [{}], {"unknown": ["relaxation_share_1", "relaxation_time_1"]}, ["relaxation_share_1", "approach+hold"],
    ),
    "relaxation from a hold alone": (
        [{"segment": "hold"}],
        {"unknown": ["relaxation_share_1", "relaxation_time_1"]},
        ["measurement[1].segment", "begin with the approach", "approach+hold"],
    ),
    "share without a time": ([HOLD], {"unknown": ["relaxation_share_1"]}, ["identify", "lacks `relaxation_time_1`"]),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_named(mistake):
    measurements, identify, parts = MISTAKES[mistake]
    said = refusal(layered(*measurements, **identify))
    assert all(part in said for part in parts), said


def test_a_single_table_is_no_array():
    with pytest.raises(StudyError, match=r"write \[\[measurement\]\]"):
        parse(raw() | {"measurement": CURVE})


def test_experiments_neither_sweep_nor_change_a_case():
    plain = parse(raw(body={"layer": [SKIN]}))
    study = parse(layered({"probe": {"radius": "2 mm"}, "machine_stiffness": RANGE}, poisson=[0.2, 0.4]))
    assert study.shape == plain.shape == ()
    assert case_key(study.case(())) == case_key(plain.case(()))


@pytest.mark.parametrize(("file", "name"), [("a/ball 3.csv", "ball 3"), ("a/gels/*.csv", "gels"), ("*.csv", "curve")])
def test_a_measurement_without_a_name_has_that_of_its_file(file, name):
    (found,) = measurements_of(parse(raw() | {"measurement": [{"file": file}]}))
    assert found.name == name


def test_without_names_the_moduli_contact_and_baseline_are_unknown():
    found = {one.name: one for one in unknowns(parse(layered({})))}
    assert list(found) == ["young", "skin_young", "contact_point", "baseline"]
    assert (found["baseline"].low, found["baseline"].high, found["baseline"].unit) == (-inf, inf, "N")
    assert found["skin_young"].is_logarithmic and found["skin_young"].low < 60e3 < found["skin_young"].high
    assert [name for name, one in found.items() if one.is_wanted] == ["young", "skin_young"]
    (whole,) = (one for one in unknowns(parse(raw() | {"measurement": [CURVE]})) if one.name == "young")
    assert whole.low <= 10 and whole.high >= 1e11  # F is proportional to it: a wide range costs nothing


def test_values_with_errors_widen_bars_and_ranges_are_wanted():
    study = parse(
        layered(
            {"machine_stiffness": RANGE},
            poisson=[0.2, 0.5],
            skin_thickness={"value": "2 mm", "error": "5 %"},
            radius={"value": "3 mm", "error": "0.1 mm"},
            unknown=["radius", "drift"],
        )
    )
    found = {one.name: one for one in unknowns(study)}
    assert found["skin_thickness"].prior == pytest.approx((2e-3, 5e-5))
    assert found["skin_thickness"].low < 1.9e-3 and found["skin_thickness"].high > 2.1e-3
    assert found["radius"].prior == pytest.approx((3e-3, 5e-5))
    assert (found["machine_stiffness"].low, found["machine_stiffness"].high) == (50e3, 64e3)
    wanted = {name for name, one in found.items() if one.is_wanted}
    assert wanted == {"poisson", "radius", "drift"}


def test_a_modulus_about_which_something_is_known_is_wanted_if_nothing_else_is():
    found = {one.name: one for one in unknowns(parse(layered({}, young={"value": "10 kPa", "error": "10 %"})))}
    assert found["young"].prior == pytest.approx((1e4, 500))
    assert found["young"].is_wanted and found["skin_young"].is_wanted


def test_names_follow_law_inclusions_and_layers_that_fill_the_body():
    fat = {"name": "fat", "young": "5 kPa", "poisson": 0.4, "law": "yeoh", "c2": 0.1}
    ball = {"name": "tumour", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.45}
    content = raw(body={"layer": [SKIN | {"law": "neo-hookean"}, fat], "inclusion": [ball | {"law": "neo-hookean"}]})
    del content["material"]
    content["identify"] = {"unknown": ["fat_c2", "tumour_radius", "tumour_young"], "fat_poisson": [0.3, 0.5]}
    assert {"fat_c2", "tumour_radius", "tumour_young", "fat_poisson"} <= {one.name for one in unknowns(parse(content))}
    content["identify"]["unknown"] = ["young"]
    with pytest.raises(StudyError, match="`young` is no parameter"):
        parse(content)


def test_the_place_of_a_parameter_is_where_the_study_has_it():
    study = parse(layered({}, unknown=["young", "poisson", "skin_young", "skin_thickness", "radius"]))
    for one in identification_of(study).sought:
        value = raw(body={"layer": [SKIN]})
        for step in one.parameter.place:
            value = value[step]
        if one.parameter.place:
            assert value in (SKIN.get(one.parameter.name.removeprefix("skin_")), "10 kPa", 0.3, "3 mm")


def test_a_measurement_has_its_own_tool_and_body():
    study = parse(
        layered(
            {"probe": {"radius": "2 mm", "contact": "frictionless"}},
            {"name": "ball", "probe": {"shape": "sphere", "radius": "5 mm", "contact": "unilateral"}},
            {"name": "thin", "body": {"size": ["40 mm", "40 mm", "8 mm"]}},
        )
    )
    first, second, third = (scene_of(study, one) for one in measurements_of(study))
    assert (first.probes[0].half_width, first.probes[0].depth) == (2e-3, 0.2e-3)
    assert second.probes[0].shape == "sphere"
    assert third.case(()).body.heights == (-8e-3, 0.0)
    assert first.case(()).body.heights == (-20e-3, 0.0)
    assert not measurements_of(first)
    again = read_text(first.text, "again.toml")
    assert case_key(again.case(())) == case_key(first.case(()))


def test_measurements_with_tools_and_bodies_of_their_own_need_no_others():
    disc = {"shape": "disc", "radius": "2 mm", "contact": "frictionless", "at": ["1 mm", "0 mm"]}
    ball = {"shape": "sphere", "radius": "5 mm", "contact": "unilateral"}
    whole, body = raw(), raw()["body"]
    tables = [CURVE | {"probe": disc, "body": body}, CURVE | {"name": "ball", "probe": ball, "body": body}]
    alone = {"material": whole["material"], "mesh": whole["mesh"], "measurement": tables}
    study = parse(alone)
    first, second = (scene_of(study, one) for one in measurements_of(study))
    for scene, probe in ((first, disc), (second, ball)):
        same = parse(whole | {"probe": probe, "measurement": [CURVE]})
        assert case_key(scene.case(())) == case_key(scene_of(same, measurements_of(same)[0]).case(()))
    assert "[probe]" in {problem.key for problem in study.lacking}
    tables[0] = CURVE | {"probe": disc | {"radius": "-1 mm"}, "body": body}
    with pytest.raises(StudyError, match=r"measurement\[1\].probe.radius"):
        parse(alone)
    del tables[1]["probe"]
    with pytest.raises(StudyError, match=r"\[probe\]: this section is required"):
        parse(alone)


def test_a_measurement_chooses_one_of_several_tools():
    tools = [{"name": n, "shape": "disc", "radius": r, "depth": "0.1 mm"} for n, r in (("a", "1 mm"), ("b", "2 mm"))]
    content = raw() | {"probe": tools, "measurement": [CURVE | {"probe": {"name": "b"}}]}
    study = parse(content)
    assert study.shape == (2,)
    assert scene_of(study, measurements_of(study)[0]).probes[0].half_width == 2e-3
    with pytest.raises(StudyError, match=r"measurement\[1\].probe.name.*a, b"):
        parse(raw() | {"probe": tools, "measurement": [CURVE | {"probe": {"radius": "3 mm"}}]})


def test_a_scene_has_one_value_of_what_is_known():
    study = parse(raw(material={"poisson": [0.3, 0.4]}) | {"measurement": [CURVE]})
    with pytest.raises(StudyError, match=r"material.poisson.*is swept"):
        scene_of(study, measurements_of(study)[0])
    study = parse(raw(material={"poisson": [0.3, 0.4]}) | {"measurement": [CURVE], "identify": {"poisson": [0.2, 0.5]}})
    scene_of(study, measurements_of(study)[0])


def test_a_study_with_measurements_is_written_and_read_again():
    content = layered({"columns": {"depth": 1, "force": "F / mN"}, "window": ["0 mm", "1 mm"]}, poisson=[0.2, 0.5])
    study = read_text(to_toml(content, "mine.toml"), "mine.toml")
    (measurement,) = measurements_of(study)
    assert measurement.columns is not None and measurement.columns.force == "F / mN"
    assert measurement.window is not None and (measurement.window.high, measurement.window.unit) == (1e-3, "m")
    assert measurement.machine_compliance == 0


def test_lengths_of_single_measurements_have_errors_of_their_own():
    wide = {"name": "wide", "probe": {"radius": "6 mm"}, "errors": {"radius": "2 %"}}
    study = parse(raw() | {"measurement": [CURVE | {"errors": {"radius": "0.3 mm"}}, CURVE | wide]})
    own = {one.name: one for one in unknowns(study) if " of " in one.name}
    assert own["radius of punch"].prior == pytest.approx((3e-3, 0.15e-3))
    assert own["radius of wide"].prior == pytest.approx((6e-3, 0.06e-3))
    assert not any(one.is_wanted for one in own.values())
    for errors, identify, words in (
        ({"young": "5 %"}, {}, "errors.young"),
        ({"radius": "2"}, {}, "must be an error"),
        ({"radius": "2 %"}, {"radius": ["2 mm", "4 mm"]}, "also a key of"),
        ({"radius": "60 %"}, {}, "error below"),
    ):
        with pytest.raises(StudyError, match=words):
            parse(raw() | {"measurement": [CURVE | {"errors": errors}], "identify": identify})


def test_what_is_to_be_found_need_not_have_a_value():
    """Values of ranges, or with errors, stand in: the scene of a measurement is whole, and the study has no cases."""
    layers = [{"name": "skin", "poisson": 0.48}, {"name": "fat", "poisson": 0.48}]
    content = raw(body={"layer": layers}) | {
        "measurement": [CURVE],
        "identify": {
            "skin_young": ["1 kPa", "100 kPa"],
            "fat_young": ["1 kPa", "9 kPa"],
            "skin_thickness": {"value": "2 mm", "error": "5 %"},
        },
    }
    del content["mesh"], content["probe"]["depth"], content["material"]
    study = parse(content)
    assert [problem.key for problem in study.lacking] == ["[mesh]", "probe.depth", "[body]"]
    (body,) = scene_of(study, measurements_of(study)[0]).sections["body"]
    assert [layer.young for layer in body.layer] == pytest.approx([10e3, 3e3])
    assert body.layer[0].thickness == pytest.approx(2e-3)
    del content["identify"]["fat_young"]
    with pytest.raises(StudyError, match=r"body\.layer\[2\]\.young: is required"):
        parse(content)


def test_a_value_that_nothing_gives_is_required():
    content = raw() | {"material": {"poisson": 0.3}}
    with pytest.raises(StudyError, match=r"material\.young: is required"):
        parse(content)
    assert parse(content | {"measurement": [CURVE]}).lacking
    assert not parse(raw() | {"measurement": [CURVE]}).lacking
    with pytest.raises(StudyError, match=r"material\.poisson: is required"):
        parse(raw() | {"material": {"young": "1 kPa"}, "measurement": [CURVE]})


def test_a_value_of_what_is_to_be_found_is_said_to_be_no_part_of_that():
    found = {"measurement": [CURVE], "identify": {"young": ["1 kPa", "100 kPa"]}}
    (warning,) = parse(raw() | found).warnings
    assert "identify.young: is found from the curves; material.young is not used for that" in warning
    assert not parse(raw() | found | {"material": {"poisson": 0.3}}).warnings
