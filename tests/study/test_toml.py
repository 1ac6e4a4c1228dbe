"""Studies that stand in dictionaries: what is written of them is what stands in them, and is read as any file is."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import epsmesh
from epsmesh.study.read import read_mapping, read_study
from epsmesh.study.toml import to_toml
from tests.cases import raw

STUDIES = sorted(Path("studies").glob("*.toml"))
_VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("file", STUDIES, ids=lambda path: path.name)
def test_written_studies_are_the_same_with_dimensions_in_order(file):
    content = tomllib.loads(file.read_text())
    again = tomllib.loads(to_toml(content, "x"))
    assert again == content
    assert [list(part) for part in again.values()] == [list(part) for part in content.values()]


@settings(max_examples=30, deadline=None)
@given(st.dictionaries(st.text(), _VALUES, max_size=4))
def test_whatever_is_written_is_read_back(content):
    assert tomllib.loads(to_toml(content, "x")) == content


def test_a_dictionary_is_a_study():
    content = raw(mesh={"epsilon": ("4 mm", "full"), "degree": np.int64(2), "growth": np.float32(0.5)})
    content["material"]["poisson"] = np.array([0.3, 0.4])
    study = epsmesh.read(content, name="mine")
    assert (study.name, study.title, study.shape) == ("mine", "mine", {"poisson": 2, "epsilon": 2})
    assert tomllib.loads(study.declared.text)["material"]["poisson"] == [0.3, 0.4]
    assert study.plan().keys == epsmesh.read(tomllib.loads(study.declared.text)).plan().keys


def test_the_study_of_a_file_and_that_of_its_content_are_one():
    file = Path("studies/organ.toml")
    one, other = read_study(file), read_mapping(tomllib.loads(file.read_text()), "organ", "studies")
    assert (one.axes, one.sections, one.warnings) == (other.axes, other.sections, other.warnings)


def test_what_has_no_place_in_a_study_is_refused_all_at_once():
    content = raw(body={"shape": None}, probe={"radius": 2, "depth": object()})
    with pytest.raises(epsmesh.StudyError) as caught:
        epsmesh.read(content | {"mesh": {3: "x", "fine": None}})
    assert {problem.key for problem in caught.value.problems} == {"probe.depth", "mesh.3", "mesh.fine"}
    with pytest.raises(epsmesh.StudyError, match=r'probe\.radius = 2: must be .*such as "10 mm"'):
        epsmesh.read(raw(probe={"radius": 2}))
    with pytest.raises(epsmesh.StudyError, match="larger than 1 MB"):
        epsmesh.read(raw() | {"title": "x" * 1_000_000})
    loop = raw()
    loop["body"]["inclusion"] = [loop]
    with pytest.raises(epsmesh.StudyError, match="too deeply"):
        epsmesh.read(loop)
    for name in ("../mine", "a b", ""):
        with pytest.raises(ValueError, match="must be letters"):
            epsmesh.read(raw(), name=name)


def test_an_integer_that_toml_does_not_take_is_told_with_its_place():
    for number in (2**63, -(2**63) - 1, 10**5000):
        with pytest.raises(epsmesh.StudyError, match=r"material\.poisson.* 64 bits"):
            epsmesh.read(raw(material={"poisson": number}))
