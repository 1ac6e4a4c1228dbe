"""The term that CONTRIBUTING shows, as one file: its keys, its pairs, its records and its forces."""

import json
import math
import re
import subprocess
import sys

import pytest

from tests.commands import ENVIRONMENT, ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
STUDIES = """
import json, sys
import epsmesh.shapes.terms
epsmesh.shapes.terms.__path__.insert(0, sys.argv[1])
import epsmesh
from epsmesh.study.json_schema import study_schema
from epsmesh.study.keys import keys_of, text_of

box = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "sides"}
mesh = {"epsilon": "full", "fine": "5 mm", "coarse": "8 mm", "rim": "1 mm"}
material = {"young": "10 kPa", "poisson": 0.4}
tools = {
    "bonded": {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"},
    "found": {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"},
}


def study(tool, **more):
    springs = {"spring": [{"name": "floor", "on": "bottom", "stiffness": ["10 Pa/mm", "10 kPa/mm"]}]}
    return {"body": box, "material": material, "probe": tools[tool], "mesh": mesh, "load": springs} | more


def floating(tool, stiffness, kind="spring", on="bottom"):
    load = {kind: [{"on": on, "stiffness": stiffness}]}
    return epsmesh.read(study(tool, body=box | {"fixed": "none"}, load=load), "floating").run(output=sys.argv[2])


"""
RUN = """
found = {"keys": [key.name for key in keys_of("load.spring")], "about": text_of("load.spring")}
found["schema"] = list(study_schema()["$defs"]["Spring"]["properties"])
for tool in tools:
    result = epsmesh.read(study(tool), tool).run(output=sys.argv[2])
    fixed = epsmesh.read(study(tool, body=box | {"fixed": "bottom+sides"}, load={}), "fixed").run(output=sys.argv[2])
    found[tool] = [*result.force.values.tolist(), float(fixed.force)]
    lies = epsmesh.read(study(tool, body=box | {"fixed": "bottom"}, load={}), "lies").run(output=sys.argv[2])
    found[f"{tool} instead"] = [float(floating(tool, "1 MPa/mm").force), float(lies.force)]
found["soft"] = float(floating("bonded", "1 Pa/mm").force)
cap = {"around": ["0 mm", "0 mm", "-20 mm"], "radius": "7 mm"}
found["cap"] = float(floating("bonded", "1 Pa/mm", on=cap).force)
found["rolls"] = str(floating("bonded", "1 kPa/mm", "roller").message.values)
for name, changes in {
    "floats": {"body": box | {"fixed": "none"}, "load": {}},
    "slit": {"probe": {"shape": "blade", "length": "10 mm", "width": "1 mm", "depth": "0.1 mm", "incision": "4 mm"}},
    "history": {"probe": tools["bonded"] | {"history": {"ramp": "1 s", "hold": "1 s"}}},
    "face": {"load": {"spring": [{"on": "floor", "stiffness": "10 kPa/mm"}]}},
    "off": {"load": {"spring": [{"on": cap | {"around": ["0 mm", "0 mm", "9 mm"]}, "stiffness": "10 kPa/mm"}]}},
}.items():
    try:
        epsmesh.read(study("bonded", **changes), name)
    except epsmesh.StudyError as error:
        found[name] = str(error)
print(json.dumps(found))
"""
PLAN = """
from epsmesh.plan.cost import kind_of
from epsmesh.plan.estimate import case_memory
from epsmesh.plan.key import case_key
from epsmesh.plan.plan import make_plan
from epsmesh.run.compile import _forms
from epsmesh.study.read import read_mapping

springs, none = (make_plan(read_mapping(study("found", load=load), "planned")).solves[0] for load in (
    {"spring": [{"on": "bottom", "stiffness": "1 kPa/mm"}]}, {}
))
print(json.dumps({
    "key": case_key(springs.case),
    "kinds": [kind_of(springs), kind_of(none)],
    "memory": [case_memory(springs.case), case_memory(none.case)],
    "forms": [_forms(springs).is_nonlinear, _forms(none).is_nonlinear],
}))
"""


def spring(folder, changed=""):
    """Write the page's term into a folder, with a line more, and one like it that holds no body."""
    (text,) = re.findall(r'```python\n("""Springs.*?)```', PAGE, re.DOTALL)
    (folder / "spring.py").write_text(text + changed, encoding="utf-8")
    rolls = text.replace("class Spring", "class Roller").replace("inner(at.u, at.u)", "dot(at.u, at.normal) ** 2")
    (folder / "roller.py").write_text(rolls, encoding="utf-8")


def printed(script, folder):
    """Return what a script prints in a process that finds the folder's term."""
    command = [sys.executable, "-c", STUDIES + script, str(folder), str(folder)]
    done = subprocess.run(
        command, capture_output=True, text=True, env=ENVIRONMENT, cwd=folder, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return what studies with the page's term give, in a process that finds its file."""
    folder = tmp_path_factory.mktemp("terms")
    spring(folder)
    return printed(RUN, folder)


def test_its_keys_are_those_of_its_class(found):
    assert found["keys"] == ["name", "on", "stiffness"]
    assert {"on", "stiffness"} <= set(found["schema"])
    assert found["about"].startswith("Springs")


@pytest.mark.parametrize("contact", ["bonded", "found"])
def test_springs_are_between_a_free_and_a_fixed_face(found, contact):
    soft, stiff, fixed = found[contact]
    assert soft < stiff < fixed * 1.001
    assert stiff == pytest.approx(fixed, rel=0.01)


def test_springs_replace_a_support(found):
    """Stiff ones are a fixed face; on soft ones the body moves like a rigid one, whose force is k A d."""
    for contact in ("bonded", "found"):
        stiff, fixed = found[f"{contact} instead"]
        assert stiff == pytest.approx(fixed, rel=3e-4)
    assert found["soft"] == pytest.approx(1e3 * 0.04**2 * 0.2e-3, rel=0.03)


def test_springs_act_on_a_cap_as_tractions_do(found):
    """Its edge crosses facets of its own size: the soft body moves like a rigid one, whose force is k A d."""
    assert found["cap"] == pytest.approx(1e3 * math.pi * 0.007**2 * 0.2e-3, rel=0.02)
    assert "load.spring[1].on" in found["off"]
    assert "off the surface of the body" in found["off"]


def test_what_nothing_holds_is_refused(found):
    assert "nothing holds the body: fix a face, or add [[load.roller]] or [[load.spring]]" in found["floats"]
    assert "nothing of the body is fixed, and the terms that act on it let it move along" in found["rolls"]


def test_pairs_that_it_and_all_terms_exclude_are_refused(found):
    assert "a slit with springs" in found["slit"]
    assert "springs that relax are not computed" in found["history"]
    assert "no such face" in found["face"]


def test_a_term_is_planned_as_what_newtons_method_solves_and_its_file_is_part_of_the_key(tmp_path):
    spring(tmp_path)
    first = printed(PLAN, tmp_path)
    assert first["kinds"] == ["linear 2 found", "displacement 2 found"]
    assert first["forms"] == [True, False]
    assert first["memory"][0] >= first["memory"][1]
    spring(tmp_path, "\n\n# Stiffer now.\n")
    assert printed(PLAN, tmp_path)["key"] != first["key"]
