"""The JSON schema of a study file takes every study that there is, and refuses what no study is."""

import copy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest

from epsmesh.study.json_schema import schema_text, study_schema
from epsmesh.study.keys import all_sections, keys_of
from epsmesh.study.named import SCHEMA, examples
from epsmesh.study.starter import starter
from tests.commands import epsmesh

STUDIES = [*Path("studies").glob("*.toml"), *Path("docs/scenes").glob("*.toml")]


@pytest.fixture(scope="module")
def validator():
    jsonschema.Draft202012Validator.check_schema(study_schema())
    return jsonschema.Draft202012Validator(study_schema())


@pytest.mark.parametrize("path", STUDIES, ids=str)
def test_every_study_fits_the_schema(validator, path):
    validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("probe", "radius", 2),
        ("probe", "shape", "disk"),
        ("probe", "friction", 2.3),
        ("solve", "tolerance", 1e-8),
        ("material", "poisson", 0.7),
        ("material", "poison", 0.3),
        ("mesh", "outside", "nowhere"),
        ("solve", "energy_tolerance", 1e-3),
        ("solve", "repeats", [1, 2]),
    ],
)
def test_a_mistake_does_not_fit(validator, section, key, value):
    study = tomllib.loads(starter("study"))
    validator.validate(study)
    wrong = copy.deepcopy(study)
    wrong.setdefault(section, {})[key] = value
    assert not validator.is_valid(wrong)


@pytest.mark.parametrize(
    ("jaw", "fits"),
    [
        ({"together": "grasp"}, True),
        ({"together": "grasp", "depth": "0.2 mm"}, True),
        ({"depth": "0.2 mm"}, False),
        ({"together": "grasp", "colour": "red"}, False),
    ],
)
def test_a_second_jaw_has_what_it_leaves_out_from_the_first(validator, jaw, fits):
    study = tomllib.loads(Path("studies/pull.toml").read_text(encoding="utf-8"))
    study["probe"] = [study["probe"][0], jaw]
    assert validator.is_valid(study) == fits


@pytest.mark.parametrize(
    ("value", "fits"),
    [
        ({"from": "1 mm", "to": "3 mm", "steps": 3}, True),
        ([{"from": "1 mm", "to": "3 mm", "steps": 3}, "9 mm"], True),
        ({"from": "1 mm", "to": "3 mm"}, False),
        ({"from": "1 mm", "to": "3 mm", "steps": 3, "by": 2}, False),
    ],
)
def test_ranges_of_quantities(validator, value, fits):
    study = tomllib.loads(starter("study"))
    assert validator.is_valid(study | {"probe": study["probe"] | {"depth": value}}) == fits


@pytest.fixture(scope="module")
def taplo():
    """The linter that editors use, of the same schema."""
    found = Path(sys.executable).with_name("taplo")
    return str(found) if found.exists() else shutil.which("taplo") or pytest.skip("taplo is not installed")


@pytest.mark.nightly
def test_taplo_takes_every_study_and_finds_a_broken_one(taplo, tmp_path, monkeypatch):
    """By the file that `epsmesh new` writes beside a study, and by the settings of the project."""
    for path in (Path(".taplo.toml"), *STUDIES):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, tmp_path / path)
    monkeypatch.chdir(tmp_path)
    Path("studies", SCHEMA).write_text(schema_text(), encoding="utf-8")
    checked = subprocess.run([taplo, "check", *map(str, STUDIES)], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    shutil.rmtree("studies")
    Path(".taplo.toml").unlink()
    for name in sorted(examples()):
        assert epsmesh("new", name, "--like", name).exit_code == 0
    fine = [str(path) for path in Path("studies").glob("*.toml")]
    assert len(fine) == len(examples())
    checked = subprocess.run([taplo, "check", *fine], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    broken = Path("studies/broken.toml")
    broken.write_text(Path("studies/pad.toml").read_text().replace("poisson =", "poison ="))
    checked = subprocess.run([taplo, "check", str(broken)], capture_output=True, text=True, check=False)
    assert checked.returncode != 0
    assert "poison" in checked.stderr


def test_every_key_of_the_reference_is_in_the_schema():
    definitions = study_schema()["$defs"].values()
    known = {key for definition in definitions for key in definition.get("properties", {})}
    assert {key.name for section in all_sections() for key in keys_of(section)} <= known
