"""The page of credibility: what it says is the dataset's and the tables', and what nothing tells it asks for."""

import re
import tomllib
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report import credibility
from epsmesh.report.credibility import near
from epsmesh.report.credibility.inputs import inputs
from epsmesh.report.credibility.limits import excluded, inertia, speed_of
from epsmesh.report.dataset import build, write
from epsmesh.report.study import study_of
from epsmesh.report.words import percent
from epsmesh.shapes.registry import BODIES, PROBES
from epsmesh.shapes.tissue import LAWS
from epsmesh.study.read import parse, read_study
from epsmesh.viscoelastic import Motion
from tests import organs
from tests.cases import raw
from tests.commands import epsmesh
from tests.fuzz.studies import toml
from tests.insertion import test_needle as needles
from tests.report.synthetic import dataset
from tests.verification.scenes import every

ROOT = Path(__file__).parents[2]
ONE = {"mesh": {"epsilon": "8 mm"}}
STATED = {
    "question": "Is <b>20 mN</b> enough?",
    "context_of_use": "It decides what is tried first.",
    "decision_consequence": "low",
    "model_influence": "medium",
}
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}


def text_of(data):
    """Return the texts of a page, without its elements."""
    body = credibility.render(data, "one").partition("<body>")[2]
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", re.sub(r"</?(span|code)[^>]*>", "", body))).split())


def scene(**changes):
    study = parse(raw(**changes))
    cases = near.scenes(study)
    return study, cases, near.kinds(study, cases)


@pytest.fixture(scope="module")
def needle():
    text = toml(needles.SCENE)
    return build(*needles.solved(parse(needles.SCENE, text=text)))


def test_the_bar_is_the_datasets_and_what_is_not_stated_is_asked_for():
    data = dataset(**ONE)
    found = text_of(data)
    assert f"error bar (95 %) at most {percent(float(data['force_error'] / data['force']))} of F" in found
    wider = data.assign(force_error=7 * data["force_error"])
    assert f"at most {percent(7 * float(data['force_error'] / data['force']))} of F" in text_of(wider)
    assert "Not stated: question of interest, context of use, consequence" in found
    assert all(f"{key} = " in found for key in STATED)
    lines = credibility.paste(study_of(data))
    assert parse(raw() | tomllib.loads(lines)).credibility.model_influence == "medium"


def test_what_is_stated_is_on_the_page_as_text_and_not_asked_for():
    found = credibility.render(dataset(**ONE, credibility=STATED), "one")
    assert "Is &lt;b&gt;20 mN&lt;/b&gt; enough?" in found
    assert "<b>20 mN" not in found
    assert "Not stated" not in found
    some = {key: text for key, text in STATED.items() if key != "context_of_use"}
    asked = text_of(dataset(**ONE, credibility=some))
    assert "Not stated: context of use. Add" in asked
    assert "context_of_use = " in asked and "question = " not in asked


def test_forces_do_not_depend_on_what_is_stated():
    keys = [dataset(**ONE, **more)["force"].item() for more in ({}, {"credibility": STATED})]
    assert keys[0] == keys[1]


def test_rows_of_verification_are_the_nearest_first_and_say_in_what_they_differ():
    cylinder = {"shape": "cylinder", "radius": "50 mm", "height": "50 mm"}
    *_, kinds = scene(body=cylinder, **ONE)
    (kind, *others) = [one for _, one, _ in near.near(kinds)]
    assert (kind, near.differs(kinds[0], kind)) == (kinds[0], "nothing")
    assert kind.law == kind.tool.replace("disc", "linear") == "linear"
    distances = [kinds[0].distance(one) for one in (kind, *others)]
    assert distances == sorted(distances)
    *_, of_layers = scene(
        body=cylinder | {"layer": [{"name": "skin", "thickness": "2 mm", "young": "20 kPa", "poisson": 0.4}]}, **ONE
    )
    assert near.differs(of_layers[0], kind) == "without layers"
    *_, other = scene(material={"law": "ogden", "terms": [{"alpha": 3.0}]}, **ONE)
    assert all("law: " in near.differs(*pair) for *pair, _ in near.near(other) if pair[1].law != "ogden")


def test_distances_of_measurements_are_ratios_of_numbers():
    ball = next(one for one in near.compared() if one.scene.tool == "sphere")
    assert near.factor((1.0, 2.0), (1.0, 4.0)) == 1
    assert near.factor((1.0, 12.0), (1.0, 4.0)) == 3
    assert near.factor((0.1, 2.0), (1.0, 4.0)) == pytest.approx(10)
    data = dataset(probe=BALL, **ONE)
    data["contact_radius"] = data["force"].copy(data=np.full(data["force"].shape, 1.6e-3))
    study, cases, (kind, *_) = scene(probe=BALL, **ONE)
    here = near.numbers(data, study, cases)
    assert here["depth"] == pytest.approx((0.5 / 1.6,) * 2)
    assert here["size"] == pytest.approx((1.6 / 20,) * 2)  # on a body of 20 mm
    assert here["force"] == (data["force"].item(),) * 2
    same = here | {"depth": (ball.scene.depth,) * 2}
    deep = here | {"depth": (ball.scene.depth, 3 * ball.scene.depth)}
    assert f"d/a there {ball.scene.depth:g} (within)" in near.far(kind, same, ball)
    assert f"d/a there {ball.scene.depth:g} (off by a factor of 3)" in near.far(kind, deep, ball)
    assert near.distance(kind, deep, ball) == pytest.approx(near.distance(kind, same, ball) + np.log(3))
    assert near.measured(kind, here)[0].scene.tool == "sphere"
    assert near.distance(replace(kind, law="gent"), here, ball) == near.distance(kind, here, ball) + 1
    assert "depth" not in near.numbers(data.drop_vars("contact_radius"), study, cases)  # not known
    assert all(("agree within" in near.result(one)) == one.agrees for one in near.compared())


def test_an_organ_is_near_a_body_from_a_file(tmp_path):
    file = organs.write_stl(tmp_path / "organ.stl", *organs.ellipsoid(6))
    body = {"shape": "surface", "file": str(file), "unit": "mm", "fixed": {"below": "-10 mm"}}
    data = dataset(body=body, probe={"radius": "8 mm"}, **ONE)
    study = study_of(data)
    (kind, *_) = near.kinds(study, near.scenes(study))
    nearest = near.near([kind])[0][1]
    assert (kind.body, nearest) == ("surface", kind)
    file.unlink()
    with pytest.raises(credibility.DatasetError, match="a file that the study names"):
        credibility.render(data, "one")


def test_a_needle_has_bars_of_its_puncture_and_the_balance_of_its_energies(needle):
    found = text_of(needle)
    for name, what in (("force", "the force of the puncture"), ("depth", "its depth")):
        bar = float(needle[f"puncture_{name}_error"] / needle[f"puncture_{name}"])
        assert f"{percent(bar)} of {what}" in found
    worst = float(abs(needle["energy_balance"]).max())
    assert f"energies of the insertion balance to {worst:.1g}" in found
    study = study_of(needle)
    (kind,) = near.kinds(study, near.scenes(study))
    assert "insertion" in kind.further
    assert "puncture and cutting" not in excluded(study, near.scenes(study))
    here = near.numbers(needle, study, near.scenes(study))
    assert here["depth"] == pytest.approx((12, 12))  # 6 mm of a shaft of 0.5 mm
    assert all("without insertion" in near.far(kind, here, one) for one in near.measured(kind, here))
    assert next(there.further for _, there, _ in near.near([kind])) == ("insertion",)  # the section of a shaft
    assert "a smaller accuracy: at large displacements, F_exact would not be" in found
    assert "exact = true" in text_of(dataset(**ONE))
    assert "probe.toughness = 5 J/m^2 none stated not known Validation" in found  # F is not in proportion to E
    assert "The speed of the tool is not known: give speed in [credibility]" in found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"credibility": {"speed": "10 mm/s"}, "material": {"density": "1060 kg/m^3"}}, "1e-05 of F; v = 10 mm/s"),
        ({"probe": {"history": {"ramp": "0.1 s"}}}, "4e-07 of F; v = 2 mm/s ([probe.history])"),
        ({"probe": {"history": {"hold": "1 s"}}}, "at once: give a `ramp`"),
        ({}, "give `speed` in [credibility]"),
    ],
)
def test_inertia_is_compared_with_stiffness_or_a_speed_is_asked_for(changes, words):
    study, cases, _ = scene(**ONE, **changes)
    assert words in inertia(study, cases)


def test_the_speed_of_an_oscillation_is_that_of_its_steepest_part():
    assert speed_of(Motion((0.0, 2.0), (0.0, 4.0), 1.0, 1.0, 3.0)) == pytest.approx(2 * np.pi)


def test_inputs_have_their_bars_and_the_others_are_named_as_not_known():
    bar = {"estimate": [1e4], "low": [9e3], "high": [1.2e4], "correlation": [[1.0]]}
    identified = {"file": "gel.nc", "unknown": ["young"], **bar}
    material = {"young": None, "from": "gel.nc"}
    data = dataset(**ONE, material=material, identified=identified, probe={"radius": ["2 mm", "3 mm"]})
    study = study_of(data)
    rows = {row[0]: row[1:] for row in inputs(data, study, near.scenes(study))}
    low, high = data["force"].values.ravel()
    change = percent(abs(high - low) / (high + low) * 2)
    assert rows["probe.radius"] == ["swept, 2 mm to 3 mm", f"F changes by up to {change}"]
    value, effect = rows["tissue, identified (SI units)"]
    assert value == "young 1e+04, 95 % from 9000 to 1.2e+04 (gel.nc)"
    assert effect == f"F ± {percent(float((data['force_uncertainty'] / data['force']).max()))}"
    (rest,) = (name for name, (what, _) in rows.items() if what == "none stated")
    assert "material.poisson = 0.3" in rest and "probe.depth = 0.2 mm" in rest
    assert "young" not in rest and "radius" not in rest


def test_every_kind_of_study_has_a_page():
    raster = {"x": {"from": "-8 mm", "to": "8 mm", "steps": 3}, "y": ["-4 mm", "4 mm"]}
    at = {k: v for k, v in raw()["probe"].items() if k != "at"}
    sweep = {"epsilon": ["4 mm", "10 mm", "full"], "outside": ["coarse", "free"]}
    for changes in (
        {"mesh": sweep},
        {"probe": at | {"path": {"raster": raster}}} | ONE,
        {"failed": 9} | ONE,
        {
            "probe": {"history": {"ramp": "1 s", "hold": "1 s"}},
            "material": {"relaxation": [{"share": 0.4, "time": "1 s"}]},
        }
        | ONE,
    ):
        assert "Ten rules" in text_of(dataset(**changes))
    assert "error bar not known" in text_of(dataset(failed=9, **ONE))
    assert "F is in proportion to E" in text_of(dataset(**ONE))
    assert "the meshes' F within" in text_of(dataset(mesh=sweep))


def test_tools_of_an_array_have_inputs_of_their_own_that_are_not_known():
    tools = [{"name": name, **raw()["probe"], "radius": f"{size} mm"} for name, size in (("thin", 2), ("thick", 4))]
    data = dataset(**ONE, probe=tools)
    study = study_of(data)
    (swept, *_), (rest, *_) = inputs(data, study, near.scenes(study))
    assert swept == "probe"
    assert "probe[1].radius = 2 mm" in rest and "probe[2].radius = 4 mm" in rest


@pytest.mark.nightly
@pytest.mark.parametrize("file", sorted(ROOT.glob("studies/*.toml")), ids=lambda file: file.stem)
def test_every_shipped_study_has_a_page_even_before_its_run(file):
    study = read_study(file)
    if not study.lacking:
        assert "No case has a force" in text_of(build(make_plan(study), {}))


def test_tables_have_known_words_and_forces_within_their_bars():
    _, rows = near.verification()
    for kind, row in rows:
        assert kind.law == "" or {*kind.law.split("+")} <= {*LAWS}
        assert {kind.tool} <= {"", *PROBES} and {kind.body} <= {"", *BODIES}
        assert {*kind.further} <= {*near.FURTHER}
        reference, value = float(row["reference"]), float(row["value"])
        error = abs(value / reference - 1) if reference else abs(value)
        assert error <= 1.05 * float(row["bar"]), row["scene"]  # written with two digits
    assert len(rows) > 190


@pytest.mark.nightly
def test_the_table_is_that_of_the_comparisons():
    """Scenes and their kinds; numbers are another machine's, within their bars."""
    known = {(row["scene"], row["path"]): kind for kind, row in near.verification()[1]}
    for row, kind in every(MPI.COMM_SELF, quick=True):
        assert known[row.scene, row.path] == kind


def test_the_command_writes_the_page_of_cases_alone(tmp_path):
    write(dataset(**ONE), tmp_path / "one.nc")
    done = epsmesh("report", tmp_path / "one.nc", "--credibility")
    assert (done.exit_code, done.stdout.strip()) == (0, str(tmp_path / "one_credibility.html"))
    assert "--credibility" in (tmp_path / "one_credibility.html").read_text()
    for more in ("--figures", "--scene=none"):
        done = epsmesh("report", tmp_path / "one.nc", "--credibility", more)
        assert (done.exit_code, "a page of its own" in done.stderr) == (2, True)
