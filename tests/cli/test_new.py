"""``epsmesh new``: study files that run as they are, and explain themselves."""

import json
import tomllib
from math import prod
from pathlib import Path

import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.study.json_schema import schema_text
from epsmesh.study.keys import all_sections, keys_of, shapes_of, text_of, words_of
from epsmesh.study.named import SCHEMA, SHORT, examples
from epsmesh.study.read import parse, read_study
from epsmesh.study.starter import starter
from tests.commands import epsmesh
from tests.sampling import sampled

_SCHEMA = "#:schema ./study.schema.json\n"
STUDIES = Path(__file__).parents[2] / "studies"
SOURCES = STUDIES.parent / "pipeline" / "epsmesh_realtime" / "c"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Outside of the checkout."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def new(*arguments):
    return epsmesh("new", *arguments)


def test_every_key_of_the_schema_has_words_and_an_example():
    for section in all_sections():
        assert text_of(section)
        for key in keys_of(section):
            assert key.words.text, f"nothing is said of {section}.{key.name}"
            assert key.words.example, f"there is no example of {section}.{key.name}"


def test_a_key_of_several_shapes_says_what_it_means_for_each():
    for section in all_sections():
        said = {(key.name, shape): key.words.text for key in keys_of(section) for shape in key.shapes}
        for shape, model in shapes_of(section).items():
            for name in {*model.model_fields} & {name for name, _ in said}:
                assert said[name, shape] == words_of(model, name).text


def test_starter_is_a_study_with_every_key():
    text = starter("mine")
    study = parse(tomllib.loads(text), file="mine.toml", text=text)
    assert len(make_plan(study).keys) > 1
    assert not study.warnings
    for section in all_sections():
        for key in keys_of(section):
            assert f"\n{key.name} = " in text or f"\n# {key.name} = " in text


@pytest.mark.parametrize("key", ["mesh.rim", "mesh.growth", "probe.contact", "solve.timing", "plan.stop_near_exact"])
def test_what_the_starter_leaves_out_can_be_let_in(key):
    section, name = key.split(".")
    lines = starter("mine").splitlines()
    table = lines.index(f"[{section}]")
    place = next(i for i in range(table, len(lines)) if lines[i].startswith(f"# {name} = "))
    lines[place] = lines[place].removeprefix("# ")
    study = parse(tomllib.loads("\n".join(lines)), file="mine.toml")
    assert name in next(iter(study.sections[section])).model_fields_set


def test_new_writes_a_short_study_and_leaves_an_existing_one_alone(elsewhere):
    assert new("mine").exit_code == 0
    file = elsewhere / "studies" / "mine.toml"
    assert read_study(file).title == "mine"
    assert len(file.read_text().splitlines()) <= 25
    file.write_text("changed")
    again = new("mine")
    assert again.exit_code == 2
    assert "exists already" in again.stderr
    assert file.read_text() == "changed"


def test_all_writes_every_key(elsewhere):
    assert new("mine", "--all").exit_code == 0
    assert (elsewhere / "studies" / "mine.toml").read_text() == _SCHEMA + starter("mine")


@pytest.mark.parametrize("name", SHORT)
def test_short_examples_are_short_named_in_the_help_and_without_warnings(name):
    assert 10 <= len((STUDIES / f"{name}.toml").read_text().splitlines()) <= 30
    assert name in new("--help").stdout
    study = read_study(STUDIES / f"{name}.toml")
    assert 1 < prod(study.shape) <= 20
    assert not study.warnings


@sampled("name", sorted(path.stem for path in STUDIES.glob("*.toml")), by_day=8)
def test_like_copies_the_studies_that_come_with_the_program(elsewhere, name):
    assert new("mine", "--like", name).exit_code == 0
    assert (elsewhere / "studies" / "mine.toml").read_text() == _SCHEMA + (STUDIES / f"{name}.toml").read_text()
    read_study(elsewhere / "studies" / "mine.toml")  # with the file of its body


def test_the_schema_for_editors_is_beside_every_study_and_up_to_date(elsewhere):
    schema = elsewhere / "deep" / SCHEMA
    new("deep/first.toml")
    assert schema.read_text() == schema_text()
    schema.write_text("{}")
    new("deep/second.toml", "--like", "deep/first.toml")
    assert schema.read_text() == schema_text()
    assert (elsewhere / "deep" / "second.toml").read_text().count("#:schema") == 1


def test_like_takes_a_path_and_a_study_of_the_folder(elsewhere):
    assert new("deep/first.toml").exit_code == 0
    assert new("second", "--like", "deep/first.toml").exit_code == 0
    assert new("third", "--like", "second").exit_code == 0
    assert (elsewhere / "studies" / "third.toml").read_text() == (elsewhere / "deep" / "first.toml").read_text()


def test_the_file_of_a_body_is_taken_along_within_the_project(elsewhere):
    mesh = elsewhere / "meshes" / "liver.stl"
    assert f"{Path('studies', '..', 'meshes', 'liver.stl')}" in new("mine", "--like", "organ").stdout
    assert mesh.read_bytes() == (STUDIES.parent / "meshes" / "liver.stl").read_bytes()
    mesh.write_bytes(b"mine")
    assert json.loads(new("second", "--like", "organ", "--json").stdout) == {"file": "studies/second.toml"}
    assert mesh.read_bytes() == b"mine"
    mesh.unlink()
    assert new("mine", "--like", "organ").exit_code == 2
    assert not mesh.exists()
    wrong = new(str(elsewhere.parent / "alone" / "mine.toml"), "--like", "organ")
    assert (wrong.exit_code, "copy it there first" in wrong.stderr) == (2, True)
    assert not (elsewhere.parent / "meshes").exists()


ALL_FILES = """
[[body]]
name = "one"
shape = "surface"
file = ["one.stl", "two.stl"]

[[body.region]]
name = "tumour"
file = "meshes/tumour.stl"

[[body]]
name = "other"
shape = "image"
file = "scan [2].nii.gz"
names = "labels.txt"

[material]
from = "results/gel.nc"

[[measurement]]
name = "a"
file = "curves [1]/*.csv"
probe = {shape = "disc", radius = "1 mm"}
body = {shape = "cad", file = "phantom.step"}

[[output]]
name = "energy"
function = "outputs.py:energy"
"""


def test_all_files_of_a_study_are_taken_along(elsewhere):
    (elsewhere / "old").mkdir()
    texts = {"outputs.py": "import own, json\n", "own.py": "from inner.deep import f\n", "inner/deep.py": ""}
    named = ("one.stl", "two.stl", "meshes/tumour.stl", "scan [2].nii.gz", "labels.txt", "results/gel.nc")
    curves = ("phantom.step", "curves [1]/a.csv", "curves [1]/b.csv")
    for name in (*named, *curves, *texts):
        file = elsewhere / "old" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(texts.get(name, name))
    (elsewhere / "old" / "mine.toml").write_text(ALL_FILES)
    copied = json.loads(new("yours", "--like", "old/mine.toml", "--json").stdout)["carried"]
    assert sorted(copied) == sorted(f"studies/{name}" for name in (*named, *curves, *texts))
    for name in (*named, *curves, *texts):
        assert (elsewhere / "studies" / name).read_text() == texts.get(name, name)


def test_the_evaluator_in_c_is_copied_and_nothing_overwritten(elsewhere):
    done = epsmesh("export", "--evaluator", "mine/c", "--json")
    names = json.loads(done.stdout)["files"]
    assert {"epsmesh.h", "epsmesh.c", "epsmesh_patch.h", "src/patch.c", "examples/unity.c"} <= {*names}
    for name in names:
        assert (elsewhere / "mine" / "c" / name).read_text() == (SOURCES / name).read_text()
    (elsewhere / "mine" / "c" / "epsmesh.h").unlink()
    again = epsmesh("export", "--evaluator", "mine/c")
    assert (again.exit_code, "is not overwritten" in again.stderr) == (2, True)
    assert not (elsewhere / "mine" / "c" / "epsmesh.h").exists()


def test_unknown_studies_and_bad_names_are_named():
    assert "did you mean `figure3`?" in new("mine", "--like", "figur3").stderr
    assert "no/such.toml" in new("mine", "--like", "no/such.toml").stderr
    bad = new("a/b c")
    assert (bad.exit_code, "letters, digits" in bad.stderr) == (2, True)
    assert "figure3" in examples()
