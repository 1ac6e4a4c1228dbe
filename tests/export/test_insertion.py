"""Insertions in real time: the model of a path against its dataset, and parameters of needles for SOFA and iMSTK."""

import json
import pickle
import runpy
import shutil
import subprocess
import tomllib
from dataclasses import replace
from math import isclose
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from epsmesh import workflow
from epsmesh.insertion.steps import CUTTING, PHASES
from epsmesh.report.dataset import build
from epsmesh.study.read import parse
from epsmesh.study.toml import to_toml
from epsmesh_realtime import Insertion, ModelError, PathModel, read, read_path
from epsmesh_realtime.export.file import open_model
from epsmesh_realtime.export.insertion import path_model
from epsmesh_realtime.export.needle import imstk_text, needle_numbers, sofa_text
from epsmesh_realtime.export.scope import ExportError
from tests.insertion import scenes
from tests.insertion.test_needle import FRICTION, NEEDLE, SCENE, SQUEEZE, STORED, TORN, layered, scene, solved
from tests.realtime.test_c import compiled

PUBLISHED = tomllib.loads((Path(__file__).parent / "plugins.toml").read_text("utf-8"))
_BLADE = parse(scenes.SCENE | {"probe": scenes.BLADE | {"insertion": {"to": "6 mm", "steps": 12, "withdraw": True}}})


def dataset_of(study):
    return build(*solved(study))


def exported(study):
    dataset = dataset_of(study)
    return dataset, path_model(study, dataset)


def steps(count, to="6 mm"):
    return scene(insertion={"to": to, "steps": count, "withdraw": True})


def test_the_advance_is_the_datasets():
    for study in (scene(), layered("20 J/m^2"), layered("400 J/m^2")):
        dataset, model = exported(study)
        forward = dataset.isel(stroke=0)
        found = Insertion(model).query_many(dataset["depth"].values)
        assert set(found.status) == {"ok"}
        np.testing.assert_allclose(found.force, forward["force"], rtol=1e-12)
        np.testing.assert_allclose(found.crack_depth, forward["crack_depth"], rtol=1e-12)
        assert np.all(found.force_error >= forward["force_error"].values * (1 - 1e-12))
        cuts = forward["phase"].values == PHASES.index(CUTTING)
        np.testing.assert_array_equal(found.stage == "cutting", cuts)


def test_between_its_depths_it_is_within_its_bars_of_a_finer_path():
    for make in (steps, lambda count: layered("20 J/m^2", insertion={"to": "9 mm", "steps": count, "withdraw": True})):
        coarse, fine = path_model(study := make(18), dataset_of(study)), dataset_of(make(90))
        own = Insertion(coarse)
        for stroke, order in ((0, 1), (1, -1)):
            truth = fine.isel(stroke=stroke)
            depths = truth["depth"].values[::order]
            found = own.query_many(depths)
            assert set(found.status) == {"ok"}
            off = abs(found.force - truth["force"].values[::order])
            turned = stroke  # where the tool turns it is not yet on its way back
            assert np.all((off <= found.force_error + truth["force_error"].values[::order])[turned:])
    assert np.median(found.force_error) < 0.2 * found.force.max()


def test_the_withdrawal_is_the_datasets_and_the_channel_stays_open():
    dataset, model = exported(scene())
    back, tool = dataset.isel(stroke=1), Insertion(model)
    depths = dataset["depth"].values
    tool.query_many(depths)
    found = tool.query_many(depths[-2::-1])
    np.testing.assert_allclose(found.force, back["force"].values[-2::-1], rtol=1e-9)
    assert set(found.stage) == {"channel"} and np.all(found.crack_depth == depths[-1])
    assert tool.query(-1e-3).status == "no contact" and tool.query(-1e-3).punctures == 1
    again = tool.query_many(depths[:-1])
    rubs = -back["force_friction"].values[:-1]
    np.testing.assert_allclose(again.force, back["force_elastic"].values[:-1] + rubs, rtol=1e-9)
    last = tool.query(depths[-1])
    assert last.stage == "cutting" and last.force == pytest.approx(float(dataset["force"][0, -1]))


def test_before_the_puncture_it_is_elastic():
    dataset, model = exported(scene())
    tool, peak = Insertion(model), float(dataset["puncture_depth"])
    depths = np.linspace(0, 0.99 * peak, 40)
    up, down = tool.query_many(depths), tool.query_many(depths[::-1])
    np.testing.assert_array_equal(down.force[::-1], up.force)
    assert set(up.stage[1:]) == {"indentation"} and not up.punctures.any()
    assert tool.query(peak).punctures == 1 and tool.query(0.5 * peak).stage == "channel"


def test_a_channel_may_be_left_at_any_depth():
    """A needle at rest does not feel how deep it was: a path to 3 mm and one to 6 mm are pulled out alike."""
    _, model = exported(scene())
    short = dataset_of(scene(insertion={"to": "3 mm", "steps": 12, "withdraw": True}))
    tool = Insertion(model)
    tool.query_many(short["depth"].values)
    found = tool.query_many(short["depth"].values[-2::-1])
    np.testing.assert_allclose(found.force, short["force"].isel(stroke=1).values[-2::-1], rtol=1e-9)


def test_a_blade_and_a_path_without_withdrawal_have_the_advance_alone():
    for study, answers in ((scene(insertion={"to": "6 mm", "steps": 24}), solved), (_BLADE, scenes.solved)):
        dataset = build(*answers(study))
        tool = Insertion(path_model(study, dataset))
        force = dataset["force"].values[0] if "stroke" in dataset.dims else dataset["force"].values
        np.testing.assert_allclose(tool.query_many(dataset["depth"].values).force, force, rtol=1e-12)
        assert tool.query(4e-3).status == "history" and "no withdrawal" in tool.query(4e-3).message
        assert tool.query(6e-3).status == "ok"


def test_what_is_no_single_path_is_refused():
    swept = scene(friction=[0.1, 0.2])
    with pytest.raises(ExportError, match="the study has 2 paths, and a model has one"):
        path_model(swept, dataset_of(swept))
    failed = build(*solved(scene(), fails=lambda solve: True))
    with pytest.raises(ExportError, match=r"there is no path: .*turned inside out"):
        path_model(scene(), failed)
    whole = scene(toughness="500 J/m^2", insertion={"to": "2 mm", "steps": 4})
    with pytest.raises(ExportError, match="not pierced down to the last depth"):
        needle_numbers(whole, dataset_of(whole))
    assert path_model(whole, dataset_of(whole)).punctures.shape == (0, 5)
    short = scene(insertion={"to": "1.5 mm", "steps": 2})
    with pytest.raises(ExportError, match="more steps are needed"):
        needle_numbers(short, dataset_of(short))


@pytest.fixture
def command(epsmesh, tmp_path, monkeypatch):
    """Return what runs the command on a study whose states have closed forms."""

    def run(probe, *words):
        study = SCENE | {"probe": NEEDLE | probe, "title": "A needle"}
        (tmp_path / "gel.toml").write_text(to_toml(study, "gel.toml"))
        monkeypatch.setattr(workflow, "solve", lambda study, *_: dataset_of(study))
        return epsmesh("export", tmp_path / "gel.toml", "--output", tmp_path, *words)

    return run


def test_a_study_with_an_insertion_is_exported(command, tmp_path, epsmesh):
    done = command({})
    assert done.exit_code == 0 and "the model of an insertion" in done.stdout, done.stderr
    model = read_path(tmp_path / "gel.epsm")
    assert model.has_withdrawal and model.deepest == 6e-3
    with pytest.raises(ModelError, match="`read_path` reads it"):
        read(tmp_path / "gel.epsm")
    opened = open_model(tmp_path / "gel.epsm")
    assert opened["path_advance"].dims == ("knot", "column") and opened.attrs["title"] == "A needle"
    assert not list(tmp_path.glob("*.sofa.py"))
    data = json.loads(command({"insertion": {"to": "6 mm", "steps": 12}}, "--needle", "--json").stdout)
    assert data["withdrawal"] is False and len(data["files"]) == 2
    told = command({"insertion": {"to": "6 mm", "steps": 12}}).stdout
    assert "no withdrawal once the tissue is pierced: write withdraw = true" in told
    assert "it cannot know" in command({}, "--needle").stdout
    planned = epsmesh("plan", tmp_path / "gel.toml", "--output", tmp_path).stdout
    assert "export, as the real-time model of its path" in planned


@pytest.mark.parametrize(
    ("probe", "words", "told"),
    [
        ({}, ("--fmu", "x.fmu"), "a unit has a tool that presses"),
        ({}, ("--accuracy", "2%"), "leave it out"),
        ({"friction": [0.1, 0.2]}, (), "give one value"),
    ],
)
def test_what_an_insertion_has_not_is_refused(command, probe, words, told):
    done = command(probe, *words)
    assert done.exit_code == 2 and told in done.stderr


# ---- needles of other programs -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def numbers():
    return needle_numbers(scene(), dataset_of(scene()))


def test_the_numbers_of_a_needle_are_those_of_its_closed_form(numbers):
    (layer,) = numbers.layers
    dataset = dataset_of(scene())
    assert layer.force.value == float(dataset["puncture_force"]) and layer.depth.error > 0
    assert layer.friction.value == pytest.approx(FRICTION * SQUEEZE, rel=1e-3)
    assert layer.cutting.value == pytest.approx(TORN, rel=1e-3)
    assert layer.elastic.value == pytest.approx(STORED, rel=1e-3)
    assert 0 < layer.friction.error < layer.friction.value
    both = needle_numbers(study := layered("20 J/m^2"), dataset_of(study))
    assert [layer.name for layer in both.layers] == ["skin", "tissue below"]
    assert both.layers[1].cutting.value == pytest.approx(4 * TORN, rel=1e-3)


class Node:
    """A node of SofaPython3, as a stand-in that notes what is added to it."""

    def __init__(self):
        self.dt, self.objects = SimpleNamespace(value=0.01), {}

    def addObject(self, kind, **keys):
        self.objects[keys["name"]] = (kind, keys)


def added(path, **keys):
    scope, root = runpy.run_path(str(path)), Node()
    names = ("tip", "shaft", "surface", "volume", "surface_normals", "shaft_directions")
    scope["add_insertion"](root, **{name: f"@{name}" for name in names}, **keys)
    return scope, root.objects


def test_a_scene_of_sofa_has_published_keys_and_its_numbers(numbers, tmp_path):
    (tmp_path / "needle.py").write_text(sofa_text(numbers, "gel.toml", "1"))
    scope, objects = added(tmp_path / "needle.py", spacing=2e-3)
    known = {
        kind: plugin["components"][kind] | {"plugin": name}
        for name, plugin in PUBLISHED["sofa"].items()
        for kind in plugin["components"]
    }
    outputs = set()
    for kind, keys in objects.values():
        component = known[kind]
        assert component["plugin"] in scope["PLUGINS"]
        for key, value in keys.items():
            if key == "name":
                continue
            (group,) = (group for group, names in component.items() if isinstance(names, list) and key in names)
            takes = {"links": str, "numbers": float, "flags": bool, "lists": list}[group]
            assert isinstance(value, takes), key
            if group == "links" and value.startswith("@insertion"):
                outputs.add(value.split(".")[1])
    assert outputs == set(known["InsertionAlgorithm"]["outputs"])
    by_kind = dict(objects.values())
    assert isclose(by_kind["InsertionAlgorithm"]["punctureForceThreshold"], numbers.layers[0].force.value, rel_tol=1e-5)
    # Friction of one coupling point, as an impulse: N/m times m times s.
    expected = numbers.layers[0].friction.value * 2e-3 * 0.01
    assert by_kind["ConstraintInsertion"]["maxForce"] == [pytest.approx(expected, rel=1e-5)]
    assert scope["CUTTING"][0][0] == pytest.approx(TORN, rel=1e-3) and "cannot know" in scope["__doc__"]


def test_a_layer_has_objects_of_its_own(tmp_path):
    both = needle_numbers(study := layered("20 J/m^2"), dataset_of(study))
    (tmp_path / "needle.py").write_text(sofa_text(both, "gel.toml", "1"))
    _, first = added(tmp_path / "needle.py", layer=0)
    _, second = added(tmp_path / "needle.py", layer=1)
    assert not first.keys() & second.keys()
    thresholds = [objects[f"insertion{n}"][1]["punctureForceThreshold"] for n, objects in enumerate((first, second))]
    assert thresholds == [pytest.approx(layer.force.value, rel=1e-5) for layer in both.layers]


_CALLS = """
#include "needle.h"
#include <cstdio>
struct Interaction {
    double puncture = 0, rub = 0;
SETTERS
};
int main() {
    Interaction one;
    epsmesh::setNeedle(one);
    std::printf("%.9g %.9g %.9g\\n", one.puncture, one.rub, epsmesh::layers[0].friction.value);
    return 0;
}
"""
_KEPT = {"setPunctureForceThreshold": "puncture = force;", "setStaticFrictionForceThreshold": "rub = force;"}


@pytest.mark.skipif(shutil.which("c++") is None, reason="there is no C++ compiler")
def test_a_header_for_imstk_has_published_setters_and_its_numbers(numbers, tmp_path):
    (tmp_path / "needle.h").write_text(imstk_text(numbers, "gel.toml", "1"))
    setters = "\n".join(
        f"    void {name}(const double force) {{ {_KEPT.get(name, '(void)force;')} }}"
        for name in PUBLISHED["imstk"]["setters"]
    )
    (tmp_path / "calls.cpp").write_text(_CALLS.replace("SETTERS", setters))
    compiled("c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", tmp_path / "calls.cpp", "-o", tmp_path / "calls")
    said = subprocess.run([tmp_path / "calls"], capture_output=True, text=True, check=True).stdout.split()
    expected = (numbers.layers[0].force.value, numbers.last.value, numbers.layers[0].friction.value)
    assert [float(word) for word in said] == [pytest.approx(value, rel=1e-5) for value in expected]


def test_texts_of_a_study_end_no_comment(tmp_path):
    title = 'a """ \n \\ gel \\'
    safe = needle_numbers(study := replace(scene(), title=title), dataset_of(study))
    (tmp_path / "needle.py").write_text(sofa_text(safe, 'studies/"""x\\', "1"))
    assert runpy.run_path(str(tmp_path / "needle.py"))["DEEPEST"] == 6e-3


def test_a_model_is_copied_with_its_bytes():
    _, model = exported(scene())
    copy = pickle.loads(pickle.dumps(model))
    assert isinstance(copy, PathModel) and Insertion(copy).query(4e-3) == Insertion(model).query(4e-3)
    with pytest.raises(TypeError, match="cannot be copied"):
        pickle.dumps(Insertion(model))
