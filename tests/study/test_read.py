"""A study file: every kind of mistake gets its message, and all of them at once."""

from pathlib import Path

import pytest

from epsmesh.plan.key import case_key
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse, read_study, read_text
from epsmesh.study.toml import to_toml
from epsmesh_identify.sections.kept import measurements_of, spread_of
from tests import organs
from tests.cases import BLADE, NO_SIZES, raw, refusal, study

STUDIES = sorted(Path("studies").glob("*.toml"))

ELLIPSE = {"shape": "ellipse", "axes": ["3 mm", "1 mm"], "depth": "0.1 mm"}

WEDGE = {"shape": "wedge", "angle": "75 deg", "length": "4 mm", "depth": "0.1 mm"}

CLOSED = {"outside": "halfspace", "epsilon": "9 mm"}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["40 mm", "35 mm", "25 mm"], "fixed": {"below": "-6 mm"}}

# section changes -> what the message must hold: the key, what was found, what is allowed
MISTAKES = {
    "bare number": ({"probe": {"radius": 2}}, ["probe.radius = 2", 'such as "10 mm"']),
    "wrong unit": ({"probe": {"radius": "2 kPa"}}, ['probe.radius = "2 kPa"', "a length"]),
    "no quantity": ({"material": {"young": "soft"}}, ['material.young = "soft"', "10 kPa"]),
    "unknown unit": ({"probe": {"depth": "1 parsec"}}, ['probe.depth = "1 parsec"', "unit"]),
    "negative length": ({"probe": {"radius": "-2 mm"}}, ['probe.radius = "-2 mm"', "greater than 0"]),
    "poisson above": ({"material": {"poisson": 0.7}}, ["material.poisson = 0.7", "at most 0.5"]),
    "poisson below": ({"material": {"poisson": -0.1}}, ["material.poisson = -0.1", "at least 0"]),
    "incompressible": (
        {"material": {"poisson": 0.5}, "mesh": {"element": "displacement"}},
        ["material.poisson = 0.5", "Mixed elements"],
    ),
    "locking": (
        {"material": {"poisson": 0.499}, "mesh": {"element": "displacement"}},
        ["material.poisson = 0.499", "lock", "at most 0.495"],
    ),
    "locking of degree 1": ({"material": {"poisson": 0.46}, "mesh": {"degree": 1}}, ["at most 0.45", "degree 2"]),
    "mixed for low ratios": (
        {"mesh": {"element": "mixed"}, "material": {"poisson": 0.2}}, ["mesh.element", "above 0.25"],
    ),
    "accuracy without unit": ({"mesh": {"accuracy": 0.01}}, ["mesh.accuracy = 0.01", "1 %"]),
    "accuracy out of reach": ({"mesh": {"accuracy": "0.001 %"}}, ["mesh.accuracy", "at least 0.01 %"]),
    "sizes missing": (
        {"mesh": {"fine": None, "epsilon": None}}, ["mesh.fine", "mesh.epsilon", "give the sizes, or `accuracy`"],
    ),
    "not a number": ({"material": {"poisson": float("nan")}}, ["material.poisson"]),
    "text for a number": ({"material": {"poisson": "0.3"}}, ['material.poisson = "0.3"', "number"]),
    "unknown key": ({"material": {"poison": 0.3}}, ["material.poison = 0.3", "did you mean `poisson`?"]),
    "unknown section": ({"materials": {}}, ["materials", "did you mean `material`?"]),
    "missing key": ({"material": {"young": None}}, ["material.young", "required"]),
    "unknown shape": ({"probe": {"shape": "disk"}}, ['probe.shape = "disk"', "did you mean `disc`?"]),
    "unknown contact": ({"probe": {"contact": "glued"}}, ["probe.contact", "'bonded', 'frictionless' or 'unilateral'"]),
    "unknown element": ({"mesh": {"element": "hybrid"}}, ["mesh.element", "'mixed'"]),
    "key of another shape": (
        {"probe": {"length": "4 mm"}}, ['probe.length = "4 mm"', "a disc has no length: blade", "and wedge have"],
    ),
    "key of one other shape": ({"probe": {"incision": "4 mm"}}, ["a disc has no incision: blade has"]),
    "truth for a degree": ({"mesh": {"degree": True}}, ["mesh.degree = true", "1, 2 or 3"]),
    "word for a radius": ({"mesh": {"epsilon": "Full"}}, ['mesh.epsilon = "Full"', 'or "full"']),
    "number for a radius": ({"mesh": {"epsilon": float("inf")}}, ['or "full"']),
    "a loose solver": ({"solve": {"energy_tolerance": 1e-3}}, ["solve.energy_tolerance = 0.001", "at most 1e-06"]),
    "friction": ({"probe": {"friction": 0.3}}, ["probe.friction = 0.3", 'use contact = "unilateral"']),
    "relaxation without a history": (
        {"material": {"relaxation": [{"share": 0.4, "time": "2 s"}]}},
        ["probe.history", "is required with relaxation", 'ramp = "1 s"'],
    ),
    "shares that reach 1": (
        {
            "material": {"relaxation": [{"share": 0.4, "time": "2 s"}, {"share": 0.6, "time": "9 s"}]},
            "probe": {"history": {"ramp": "1 s"}},
        },
        ["material.relaxation", "shares must have a sum below 1; it is 1"],
    ),
    "a share without a time": (
        {"material": {"relaxation": [{"share": 1.0}]}, "probe": {"history": {"ramp": "1 s"}}},
        ["material.relaxation[1].share = 1.0: must be less than 1", "material.relaxation[1].time: is required"],
    ),
    "a time of 0 s": (
        {"material": {"relaxation": [{"share": 0.1, "time": "0 s"}]}, "probe": {"history": {"ramp": "1 s"}}},
        ["material.relaxation[1].time", "must be greater than 0"],
    ),
    "a length for a time": ({"probe": {"history": {"ramp": "1 mm"}}}, ["probe.history.ramp", "a time", "ms"]),
    "an unknown key of a history": ({"probe": {"history": {"ramps": "1 s"}}}, ["probe.history.ramps", "`ramp`"]),
    "a history of nothing": ({"probe": {"history": {"steps": 3}}}, ["probe.history", "a ramp, a hold or a sine"]),
    "a history that goes back in time": (
        {"probe": {"depth": None, "history": {"table": [["0 s", "0 mm"], ["2 s", "1 mm"], ["1 s", "0 mm"]]}}},
        ["probe.history.table", "goes back in time: row 3 must be later than 2 s, and is at 1 s"],
    ),
    "a history that begins late": (
        {"probe": {"depth": None, "history": {"table": [["1 s", "0 mm"], ["2 s", "1 mm"]]}}},
        ["probe.history.table", "must begin at 0 s"],
    ),
    "a depth beside a table": (
        {"probe": {"history": {"table": [["0 s", "0 mm"], ["2 s", "1 mm"]]}}},
        ["probe.depth", "excludes `table` in [probe.history]"],
    ),
    "a ramp beside a table": (
        {"probe": {"depth": None, "history": {"ramp": "1 s", "table": [["0 s", "0 mm"], ["2 s", "1 mm"]]}}},
        ["probe.history", "table excludes ramp"],
    ),
    "a sine of unilateral contact": (
        {
            "probe": {
                "contact": "unilateral",
                "history": {"sine": {"amplitude": "0.01 mm", "frequency": "1 Hz", "periods": 2}},
            }
        },
        ["probe.history.sine", "grows again after it has shrunk", "frictionless"],
    ),
    "unilateral contact that grows twice": (
        {
            "probe": {
                "contact": "unilateral",
                "depth": None,
                "history": {"table": [["0 s", "0 mm"], ["1 s", "0.1 mm"], ["2 s", "0.05 mm"], ["3 s", "0.1 mm"]]},
            }
        },
        ["probe.history.table", "the depth may rise to its largest value once"],
    ),
    "a tool with unilateral contact that pulls": (
        {
            "probe": {
                "contact": "unilateral",
                "depth": None,
                "history": {"table": [["0 s", "0 mm"], ["1 s", "0.1 mm"], ["2 s", "-0.05 mm"]]},
            }
        },
        ["probe.history.table", "does not pull"],
    ),
    "a speed": ({"probe": {"speed": "1 mm/s"}}, ["probe.speed", "`ramp` in [probe.history]"]),
    "a radius beside an accuracy": (
        {"mesh": NO_SIZES | {"accuracy": "1 %", "epsilon": ["9 mm", "full"]}},
        ['mesh.epsilon = ["9 mm", "full"]', "has no effect with `accuracy`", 'outside = "free"'],
    ),
    "a radius beside an accuracy, in some of the cases": (
        {"mesh": NO_SIZES | {"accuracy": "1 %", "epsilon": ["9 mm", "6 mm", "full"], "outside": ["coarse", "free"]}},
        ['mesh.outside = "coarse"', "one case for every epsilon", '"full" in epsilon'],
    ),
    "a body that is cut nowhere": (
        {"mesh": NO_SIZES | {"accuracy": "1 %", "outside": "free"}},
        ["mesh.outside", "needs epsilon, at which the body is cut", "or omit outside"],
    ),
    "text for a truth": ({"solve": {"exact": "yes"}}, ['solve.exact = "yes"', "true or false"]),
    "list for a truth": (
        {"solve": {"timing": [True, False]}}, ["must be true or false: a list of `timing` is no sweep"],
    ),
    "list for a number": ({"solve": {"repeats": [1, 2]}}, ["must be a whole number: a list of `repeats` is no sweep"]),
    "list for a name": (
        {"body": {"layer": [{"name": ["rind", "x"], "thickness": "2 mm", "young": "1 kPa", "poisson": 0.3}]}},
        ["body.layer[1].name", "must be text: a list of `name` is no sweep"],
    ),
    "text for a list": ({"plan": {"without": "symmetry"}}, ["plan.without", 'must be a list, such as ["symmetry"]']),
    "cap of two coordinates": (
        {"load": {"traction": [{"on": {"around": ["9 mm", "0 mm"], "radius": "3 mm"}, "pressure": "1 kPa"}]}},
        ["load.traction[1].on", "the keys around and radius", '["10 mm", "0 mm", "0 mm"]'],
    ),
    "place past all numbers": ({"probe": {"at": ["1e308 m", "0 mm"]}}, ['["1e308 m", "0 mm"]', "1e-30 to 1e+30 m"]),
    "number that is nought": ({"probe": {"at": ["1e-400 mm", "0 mm"]}}, ['"1e-400 mm"', "1e-30 to 1e+30 m"]),
    "element past all numbers": ({"mesh": {"coarse": "1e300 m"}}, ["mesh.coarse", "1e-30 to 1e+30 m"]),
    "growth of nothing": ({"mesh": {"growth": 1e-300}}, ["mesh.growth = 1e-300", "at least 1e-06"]),
    "footprint larger than the body": ({"probe": {"radius": "9 m"}}, ["footprint of the disc, up to 9000 mm from its"]),
    "wrong word": ({"mesh": {"outside": "void"}}, ['mesh.outside = "void"', "'coarse', 'linear', 'free'"]),
    "linear beyond epsilon": ({"mesh": {"outside": "linear"}}, ['mesh.outside = "linear"', 'law = "linear"']),
    "degree": ({"mesh": {"degree": 4}}, ["mesh.degree = 4", "1, 2 or 3"]),
    "vector length": ({"body": {"size": ["1 mm", "2 mm"]}}, ["body.size", "3 values"]),
    "support": ({"body": {"fixed": "top"}}, ['body.fixed = "top"', "'bottom'"]),
    "support height": ({"body": {"fixed": {"below": "-30 mm"}}}, ["body.fixed", "inside the body"]),
    "support table": ({"body": {"fixed": {"above": "-3 mm"}}}, ["body.fixed", "below"]),
    "footprint outside": ({"probe": {"at": ["19 mm", "0 mm"]}}, ["probe.at", "inside the top face"]),
    "blade outside": ({"probe": BLADE | {"length": "41 mm"}}, ["probe.at", "blade"]),
    "fine above coarse": ({"mesh": {"fine": "9 mm"}}, ['mesh.fine = "9 mm"', "at most coarse = 8 mm"]),
    "rim above fine": ({"mesh": {"rim": "6 mm"}}, ['mesh.rim = "6 mm"', "at most fine"]),
    "direction": ({"probe": BLADE | {"direction": [0.0, 0.0, 1.0]}}, ["probe.direction", "at least 10°"]),
    "direction of an ellipse": (
        {"probe": ELLIPSE | {"direction": [0.0, 0.0, 0.0]}}, ["probe.direction", "not all zero"],
    ),
    "one axis": ({"probe": ELLIPSE | {"axes": ["3 mm"]}}, ["probe.axes", "2 values"]),
    "ellipse outside": (
        {"probe": ELLIPSE | {"at": ["17.5 mm", "0 mm"]}}, ["probe.at", "ellipse", "inside the top face"],
    ),
    "unknown action": ({"probe": {"action": "slash"}}, ['probe.action = "slash"', "'pierce' or 'cut'"]),
    "slice of a disc": ({"probe": {"slice": "1 mm"}}, ["probe.slice", "a disc has no slice: blade has"]),
    "floating column": (
        {"body": {"fixed": "sides"}, "mesh": {"outside": "free", "epsilon": "8 mm"}}, ["mesh.outside", "float"],
    ),
    "footprint touching": ({"probe": {"at": ["17 mm", "0 mm"]}}, ["probe.at", "inside the top face"]),
    "one coordinate": ({"probe": {"at": ["1 mm"]}}, ["probe.at", "2 or 3 values"]),
    "place off the body": ({"probe": {"at": ["30 mm", "0 mm", "-9 mm"]}}, ["probe.at", "10 mm off", "10%"]),
    "place over an edge": ({"probe": {"at": ["20 mm", "0 mm", "-2 mm"]}}, ["probe.at", "misses the body", "edge"]),
    "place over an edge of the bottom": (
        {"probe": {"at": ["18 mm", "0 mm", "-20 mm"]}, "body": {"fixed": "sides"}}, ["probe.at", "misses the body"],
    ),
    "place on what is held": ({"probe": {"at": ["0 mm", "0 mm", "-20 mm"]}}, ["probe.at", "support"]),
    "place below the level that is held": (
        {"probe": {"at": ["20 mm", "0 mm", "-10 mm"]}, "body": {"fixed": {"below": "-12 mm"}}}, ["probe.at", "support"],
    ),
    "axis of no length": ({"probe": {"axis": [0, 0, 0]}}, ["probe.axis", "not all zero"]),
    "axis out of the body": ({"probe": {"axis": [0, 0, 1]}}, ["probe.axis", "180°", "at most 60°"]),
    "inclined axis": ({"probe": {"axis": [2, 0, -1]}}, ["probe.axis", "63.4°", "at most 60°"]),
    "inclined axis near an edge": ({"probe": {"axis": [1, 0, -1], "at": ["16 mm", "0 mm"]}}, ["probe.at", "edge"]),
    "direction along the axis": (
        {"probe": BLADE | {"axis": [1, 0, -1], "direction": [-1, 0, 1.1]}}, ["probe.direction", "at least 10°"],
    ),
    "direction along the normal": (
        {"probe": BLADE | {"at": ["20 mm", "0 mm", "-9 mm"], "direction": [1, 0, 0]}}, ["probe.direction", "10°"],
    ),
    "ellipsoid with faces": ({"body": ELLIPSOID | {"fixed": "bottom"}}, ["body.fixed", "below"]),
    "ellipsoid without support": (
        {"body": {"shape": "ellipsoid", "axes": ["9 mm"] * 3}}, ["body.fixed", "is required"],
    ),
    "place beside an ellipsoid": ({"body": ELLIPSOID, "probe": {"at": ["41 mm", "0 mm"]}}, ["probe.at", "outside"]),
    "footprint beside an ellipsoid": (
        {"body": ELLIPSOID, "probe": {"at": ["32 mm", "0 mm"], "axis": [0, 0, -1], "radius": "9 mm"}},
        ["probe.at", "misses the body"],
    ),
    "footprint round an ellipsoid": (
        {"body": ELLIPSOID, "probe": {"radius": "29 mm"}}, ["probe.at", "turns by", "at most 45°"],
    ),
    "no room beside the probe": (
        {"body": {"shape": "cylinder", "radius": "3.5 mm", "height": "9 mm", "fixed": "sides"}},
        ["body.fixed", "leaves 0.5 mm", "`rim` below 0.5 mm"],
    ),
    "no room in the column": ({"mesh": {"outside": "fixed", "epsilon": "3.2 mm"}}, ["mesh.epsilon", "leaves 0.2 mm"]),
    "held column as wide as the disc": (
        {"mesh": {"outside": "fixed", "epsilon": "3 mm"}},
        ['mesh.epsilon = "3 mm"', "above 3 mm, the radius of the tool", "must be above 3 mm", '"coarse" or "free"'],
    ),
    "held column within the disc": (
        {"mesh": {"outside": "fixed", "epsilon": ["2 mm", "9 mm"]}}, ['mesh.epsilon = "2 mm"', "must be above"],
    ),
    "held column of an accuracy": (
        {"mesh": {"outside": "fixed", "epsilon": "3 mm", "accuracy": "1 %"}}, ['mesh.epsilon = "3 mm"'],
    ),
    "held column within an ellipse": (
        {"probe": ELLIPSE, "mesh": {"outside": "fixed", "epsilon": "2 mm"}}, ["the ellipse reaches it"],
    ),
    "held column that the flanks of a wedge reach": (
        {"probe": WEDGE, "mesh": {"outside": "fixed", "epsilon": "2.03 mm"}}, ["above 2.035 mm"],
    ),
    "column that a wedge sticks out of": (
        {"probe": WEDGE, "mesh": {"outside": "free", "epsilon": "2 mm"}}, ["mesh.epsilon", "above half its length, 2"],
    ),
    "half ball past the bottom": (
        {"mesh": CLOSED | {"epsilon": "20 mm"}}, ["mesh.epsilon", "inside the body: must be below 20 mm"],
    ),
    "half ball past a side": ({"probe": {"at": ["12 mm", "0 mm"]}, "mesh": CLOSED}, ["mesh.epsilon", "below 8 mm"]),
    "half ball within the footprint": ({"mesh": CLOSED | {"epsilon": "2.9 mm"}}, ["mesh.epsilon", "above"]),
    "half ball of a curved body": ({"body": ELLIPSOID, "mesh": CLOSED}, ["mesh.outside", "box or a cylinder"]),
    "green function of what is incompressible": (
        {"mesh": CLOSED | {"outside": "green"}, "material": {"poisson": 0.5}}, ["material.poisson = 0.5", "halfspace"],
    ),
    "thin strip": ({"body": {"fixed": {"below": "-0.01 mm"}}}, ["body.fixed", "strip of 0.01 mm", "fine = 2 mm"]),
    "unknown reduction": ({"plan": {"without": ["magic"]}}, ["plan.without", "'duplicates'"]),
    "repeats": ({"solve": {"repeats": 3}}, ["solve.repeats", "timing"]),
    "empty sweep": ({"material": {"poisson": []}}, ["material.poisson", "empty"]),
    "value twice": ({"mesh": {"epsilon": ["1 cm", "10 mm"]}}, ["mesh.epsilon", "more than once"]),
    "one bad in a sweep": ({"material": {"poisson": [0.3, 0.8]}}, ["material.poisson = 0.8"]),
    "table without name": ({"probe": [raw()["probe"]]}, ["probe[1].name", "labels the sweep"]),
    "section is no table": ({"probe": 3}, ["probe = 3", "[probe]"]),
}  # fmt: skip


def test_a_mistake_of_one_probe_hides_none_of_another():
    probes = [
        {"name": "sideways", **BLADE, "direction": [0.0, 0.0, 1.0]},
        {"name": "slicing", **BLADE, "ahead": "1 mm", "length": "41 mm"},
        {"name": "outside", **ELLIPSE, "at": ["19 mm", "0 mm"]},
    ]
    with pytest.raises(StudyError) as caught:
        parse(raw() | {"probe": probes})
    assert [problem.key for problem in caught.value.problems] == [
        "probe[2].ahead",
        "probe[1].direction",
        "probe[2].at",
        "probe[3].at",
    ]


def test_what_is_refused_does_not_hang_on_what_was_read_before():
    """A direction along the axis is refused where it was given; the same one, left out, is another one there."""
    on_side = BLADE | {"at": ["20 mm", "1.25 mm", "-9 mm"]}
    study(probe=on_side)
    with pytest.raises(StudyError, match="at least 10°"):
        study(probe=on_side | {"direction": [1.0, 0.0, 0.0]})
    study(probe=on_side)


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_gets_its_message(name):
    changes, words = MISTAKES[name]
    content = raw(**{k: v for k, v in changes.items() if isinstance(v, dict)})
    content |= {k: v for k, v in changes.items() if not isinstance(v, dict)}
    with pytest.raises(StudyError) as caught:
        parse(content, file="my.toml")
    message = str(caught.value)
    assert all(line.startswith("my.toml: ") for line in message.splitlines())
    assert all(word in message for word in words), message


def test_all_mistakes_at_once():
    with pytest.raises(StudyError) as caught:
        study(material={"young": 3, "poisson": 0.9}, probe={"radius": "x"}, mesh={"fien": "1 mm", "coarse": None})
    keys = {problem.key for problem in caught.value.problems}
    assert keys == {"material.young", "material.poisson", "probe.radius", "mesh.fien", "mesh.coarse"}


SYNTAX = {
    "shape = box": ['line 2, column 9, `shape = box`: text is in quotation marks: write shape = "box"'],
    "poisson = 0,45 # of fat": ["line 2", "write poisson = 0.45"],
    "radius = 10 mm": ['write radius = "10 mm"'],
    "radius = 2,5 mm": ['write radius = "2.5 mm"'],
    'shape = "box': ["line 2", '`shape = "box`', "a quotation mark is not closed"],
    "shape = “box”": ["quotation marks are straight"],
    "poisson = .45": ["write poisson = 0.45"],
    "top = True": ["small letters"],
    "a = 1\n# a = 2\na = 3": ["line 4: `a` is there twice, first in line 2", "sweep"],
    "a = 1\n[body]\nb = 2": ["line 3: [body] is there twice, first in line 1", "[[body]] for each"],
    "[[body]]\na = 1": ["line 2", "[body]"],
    'size = ["1 mm", 2 mm]': ["line 2", "within a list, too"],
    'size = ["1 mm",\nradius = 2': ["line 3", "a list that begins above is not closed"],
    'radius: "3 mm"': ["line 2", "not a colon"],
    "[probe": ["line 2", "the bracket of a heading is not closed"],
    r'file = "C:\Users\a.stl"': ["line 2", "a backslash"],
    "radius =": ["line 2", "no value"],
}


@pytest.mark.parametrize("lines", SYNTAX)
def test_an_error_of_syntax_has_its_line_and_what_was_meant(tmp_path, lines):
    file = tmp_path / "bad.toml"
    file.write_text(f"[body]\n{lines}\n")
    with pytest.raises(StudyError, match=r"bad.toml: TOML syntax: ") as caught:
        read_study(file)
    assert all(part in str(caught.value) for part in SYNTAX[lines]), caught.value


WORDS = {
    "mu": ({"material": {"mu": "3 kPa"}}, ["material.mu", "2 (1 + poisson) times the shear modulus"]),
    "mu of a tool": ({"probe": {"mu": 0.2}}, ["probe.mu", "`friction`"]),
    "bulk": ({"material": {"bulk": "1 GPa"}}, ["poisson = (3 K - young) / (6 K)"]),
    "c1": ({"material": {"c1": "3 kPa"}}, ["4 (1 + poisson) C1"]),
    "c1 of a layer": ({"body": {"layer": [{"name": "skin", "c1": "3 kPa"}]}}, ["layer[1].c1", "4 (1 + poisson) C1"]),
    "permeability": ({"material": {"permeability": 1e-12}}, ["flow of fluid", "[[material.relaxation]]"]),
    "a cylinder for a punch": ({"probe": {"shape": "cylinder"}}, ['"cylinder"', 'shape = "disc"']),
    "a pyramid": ({"probe": {"shape": "Berkovich"}}, ['shape = "pyramid"', "65.27 deg"]),
    "a sphere for a body": ({"body": {"shape": "sphere"}}, ['shape = "ellipsoid" with three equal `axes`']),
    "a half-space": ({"body": {"shape": "half-space"}}, ["20 contact radii"]),
    "a roller": ({"body": {"roller": "sides"}}, ["body.roller", "`fixed`", "not computed"]),
    "a roller as a support": ({"body": {"fixed": "roller"}}, ["body.fixed", "'bottom'", "a roller", "not computed"]),
    "contact that slides": (
        {"probe": {"contact": "sliding"}},
        ["probe.contact", "along a known footprint", '"frictionless"'],
    ),
    "a diameter": ({"probe": {"diameter": "3 mm"}}, ["probe.diameter", "`radius`, half"]),
    "E": ({"material": {"E": "3 mm"}}, ["material.E", "`young`"]),
    "nu": ({"material": {"nu": "3 mm"}}, ["material.nu", "`poisson`"]),
    "a tool of its own": ({"indenter": {}}, ["indenter", "the tool is [probe]"]),
}


@pytest.mark.parametrize("word", WORDS)
def test_a_word_of_other_programs_has_a_sentence_that_says_what_to_write(word):
    changes, parts = WORDS[word]
    said = refusal(raw(**changes))
    assert all(part in said for part in parts), said


def test_missing_file():
    with pytest.raises(StudyError, match=r"nowhere\.toml: No such file"):
        read_study("nowhere.toml")


@pytest.mark.parametrize("file", STUDIES, ids=lambda path: path.name)
def test_every_study_validates(file):
    study = read_study(file)
    assert study.axes or measurements_of(study) or spread_of(study).varied


def test_doubtful_input_is_a_warning():
    words = " ".join(study(probe={"depth": "1 mm"}, mesh={"epsilon": "2 mm"}).warnings)
    assert "linear elasticity" in words
    assert "less than the tool's radius" in words
    assert "F_max" in words
    assert "lock" in " ".join(study(material={"poisson": 0.495}, mesh={"element": "displacement"}).warnings)
    assert not study().warnings
    thin = study(body={"size": ["40 mm", "40 mm", "1 mm"]}, probe={"depth": "0.15 mm"})
    assert "15% of the thickness of the tissue under the tool, 1 mm" in " ".join(thin.warnings)


def test_sweeps_become_dimensions_in_the_file_s_order():
    result = study(
        material={"poisson": [0.3, 0.4]},
        mesh={"epsilon": ["5 mm", "full"], "outside": ["coarse", "free"]},
    )
    assert [axis.name for axis in result.axes] == ["poisson", "epsilon", "outside"]
    cases = list(result.cases())
    assert len(cases) == 8
    assert dict(cases[-1].labels) == {"poisson": 0.4, "epsilon": float("inf"), "outside": "free"}
    assert cases[-1].material.poisson == 0.4


def test_a_list_that_all_tables_of_an_array_have_is_a_sweep():
    """Each table with each value: the array's dimension first, then that of the list."""
    content = raw()
    depths = ["0.1 mm", "0.2 mm", "0.3 mm"]
    content["probe"] = [
        {"name": "needle", **raw()["probe"], "depth": depths},
        {"name": "knife", **BLADE, "depth": depths},
    ]
    result = parse(content)
    assert [axis.name for axis in result.axes[:2]] == ["probe", "depth"]
    found = [(dict(case.labels)["probe"], case.probe.shape, case.probe.depth) for case in result.cases()]
    expected = [("needle", "disc", d) for d in (1e-4, 2e-4, 3e-4)] + [("knife", "blade", d) for d in (1e-4, 2e-4, 3e-4)]
    assert found == expected
    assert all(dict(case.labels)["depth"] == case.probe.depth for case in result.cases())
    content["probe"][1]["depth"] = depths[:2]
    with pytest.raises(StudyError, match="the same list in all tables"):
        parse(content)


def test_equal_cases_have_equal_keys():
    def key(**changes):
        return case_key(study(**changes).case(()), folded=True)

    assert key(probe={"radius": "3 mm"}) == key(probe={"radius": "0.3 cm"})
    assert key(material={"poisson": 0.1}) == key(material={"poisson": 1e-1})
    assert key(mesh={"epsilon": "1 m"}) == key(mesh={"epsilon": "full"})
    assert key(material={"poisson": 0}) == key(material={"poisson": 0.0})
    assert key(probe={"radius": "3 mm"}) != key(probe={"radius": "3.001 mm"})
    assert key(mesh={"degree": 3}) != key()


def test_the_text_of_a_study_is_read_as_if_it_lay_in_its_folder(tmp_path):
    """A dataset carries the text, and the folder from which files of bodies are found."""
    organs.write_stl(tmp_path / "box.stl", *organs.box(40e-3, 40e-3, 20e-3))
    body = {"shape": "surface", "file": "box.stl", "unit": "mm", "fixed": {"below": "-16 mm"}}
    text = to_toml(raw(body=body), "study.toml")
    (case,) = read_text(text, f"{tmp_path}/study.toml").cases()
    assert case.body.volume == pytest.approx(32e-6)
    with pytest.raises(StudyError, match=r"box\.stl"):
        read_text(text, f"{tmp_path}/elsewhere/study.toml")


def test_several_materials_beside_layers_are_told_to_be_a_sweep():
    layers = [{"name": "skin", "thickness": "2 mm", "young": "30 kPa", "poisson": 0.3}]
    materials = [{"name": name, "young": "10 kPa", "poisson": 0.3} for name in ("a", "b")]
    content = raw(body={"layer": layers}) | {"material": materials}
    (warning,) = (text for text in parse(content).warnings if "[[material]]" in text)
    assert "one material below the layers (a, b)" in warning


MISSPELT = {
    "probe": {"radius": "raduis"},
    "mesh": {"epsilon": "epsylon"},
    "material": {"young": "E"},
    "body": {"shape": "shpae"},
}


@pytest.mark.parametrize("section", MISSPELT)
def test_a_misspelt_key_is_one_error(section):
    """That the key is then required is no second one, unless it is required of another table."""
    content = raw()
    ((right, wrong),) = MISSPELT[section].items()
    content[section][wrong] = content[section].pop(right)
    (line,) = refusal(content).splitlines()
    assert f"{section}.{wrong}" in line
    assert f"`{right}`" in line


def test_what_another_table_lacks_is_reported_beside_a_misspelt_key():
    first, second = ({"name": name, **raw()["probe"]} for name in ("a", "b"))
    first["raduis"] = first.pop("radius")
    del second["radius"]
    found = refusal(raw() | {"probe": [first, second]})
    assert "probe[1].radius" not in found
    assert "probe[2].radius: is required" in found


def test_a_misspelt_section_is_one_error():
    content = raw()
    content["msh"] = content.pop("mesh")
    (line,) = refusal(content).splitlines()
    assert "msh: unknown section; did you mean `mesh`?" in line


def _cut(epsilon):
    return study(mesh=NO_SIZES | {"accuracy": "1 %", "outside": "free", "epsilon": epsilon}).warnings


def test_an_accuracy_of_columns_alone_is_warned_of():
    assert any('"free": cuts the body at epsilon in every case' in one for one in _cut("9 mm"))
    assert not any("cuts the body" in one for one in _cut(["9 mm", "full"]))


def test_a_radius_beyond_the_body_is_said_to_be_the_full_order():
    """A warning that there is none, beside a plan that merges this case with it, would contradict the plan."""
    said = [[one for one in study(mesh={"epsilon": ["8 mm", far]}).warnings if "F_max" in one]
            for far in ("30 mm", "60 mm", "full")]  # fmt: skip
    assert [len(warnings) for warnings in said] == [1, 1, 0]
    assert 'the list has no "full" case' in said[0][0]
    assert 'mesh.epsilon = "60 mm": extends beyond the body: write "full" in its place' in said[1][0]


ROUNDED = {"edge": "0.5 mm", "contact": "unilateral"}
SLAT = {"shape": "blade", "radius": None, "length": "8 mm", "width": "6 mm"}


@pytest.mark.parametrize("tool", [{}, ROUNDED, SLAT, SLAT | ROUNDED], ids=["disc", "rounded", "blade", "rounded blade"])
@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
def test_a_flat_tool_pressed_deep_into_linear_tissue_is_warned_of(tool, law):
    def warnings(depth):
        found = study(probe=tool | {"radius": "3 mm", "depth": depth} | tool, material={"law": law}).warnings
        return [one for one in found if "an extrapolation" in one]

    assert not warnings("0.29 mm")
    assert [("300% of the tool's half width 3 mm" in one) for one in warnings("9 mm")] == [True] * (law == "linear")
