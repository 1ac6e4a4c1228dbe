"""`material.from`: what an identification found, in a study of its own."""

import numpy as np
import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.report.uncertainty import bars
from epsmesh.study.identified import NOTHING
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping, read_text
from epsmesh_identify.estimation.dataset import joined, write
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.report.identified import material
from tests import identifications
from tests.cases import raw
from tests.identifications import VALUES, identification
from tests.report.synthetic import dataset


def write_one(path, **changes):
    """Write the dataset of an identification to a folder."""
    write(identification(**changes), path / "one.nc")


def using(folder, **changes):
    """Return a study of a disc whose material is that of the identification in the folder."""
    study = raw(**changes) | {"material": {"from": "one.nc"} | changes.get("material", {})}
    return read_mapping(study, "using", folder)


def test_a_study_has_the_values_that_were_found(tmp_path):
    write_one(tmp_path)
    (case,) = using(tmp_path).cases()
    assert (case.material.young, case.material.poisson, case.material.law) == (12e3, 0.4, "linear")


def test_layers_have_the_values_found_under_their_names(tmp_path):
    write_one(tmp_path, names=[name for name in VALUES if name != "scale" and not name.startswith("relaxation")])
    layer = [{"name": "skin", "poisson": 0.3}, {"name": "fat", "young": "5 kPa", "poisson": 0.3, "thickness": "3 mm"}]
    (case,) = using(tmp_path, body={"layer": layer}).cases()
    assert [one.young for one in case.body.layer] == [90e3, 5e3]
    assert [one.thickness for one in case.body.layer] == [1e-3, 3e-3]


def test_the_text_of_the_study_holds_what_was_read(tmp_path):
    write_one(tmp_path)
    study = using(tmp_path)
    (tmp_path / "one.nc").unlink()
    again = read_text(study.text, study.file)
    assert again == study
    write_one(tmp_path, estimate=np.array([13e3, 0.4, 0.0]))
    assert using(tmp_path).text != study.text


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"verdict": "does not fit: the residuals bend"}, "the residuals bend"),
        ({"seen": np.array([True, False, True])}, "poisson cannot be identified from its curves"),
        ({"names": ("poisson",)}, "has no `young`"),
    ],
)
def test_what_gives_no_material_is_refused(tmp_path, changes, told):
    write_one(tmp_path, **changes)
    with pytest.raises(StudyError, match=told) as error:
        using(tmp_path)
    assert "material.from" in str(error.value)


def test_files_that_are_no_identification_are_refused(tmp_path):
    with pytest.raises(StudyError, match="there is no such file"):
        using(tmp_path)
    (tmp_path / "one.nc").write_text("not netCDF")
    with pytest.raises(StudyError, match="no netCDF file"):
        using(tmp_path)


def test_many_files_have_no_one_material(tmp_path):
    write(joined([identification(), identification()], ["a.csv", "b.csv"]), tmp_path / "one.nc")
    with pytest.raises(StudyError, match="has 2 files"):
        using(tmp_path)


def test_values_beside_those_found_are_refused(tmp_path):
    write_one(tmp_path)
    with pytest.raises(StudyError, match="excludes `from`"):
        using(tmp_path, material={"poisson": 0.3})
    write_one(tmp_path, names=("young",), study='[material]\nyoung = "1 kPa"\npoisson = 0.45\n')
    with pytest.raises(StudyError, match=r"0\.45, with which"):
        using(tmp_path, material={"poisson": 0.3})
    assert using(tmp_path).identified.known == {"poisson": 0.45}


def test_a_table_that_the_program_did_not_write_is_refused(tmp_path):
    with pytest.raises(StudyError, match="written by the program"):
        read_mapping(raw() | {"identified": {"file": "x"}}, "using", tmp_path)
    with pytest.raises(StudyError, match="a row of the correlation"):
        read_mapping(
            raw() | {"material": {"from": "x"}, "identified": {"unknown": ["young"], "estimate": [1.0]}},
            "using",
            tmp_path,
        )


def test_the_ends_of_the_bars_are_solved_once_where_f_is_not_proportional(tmp_path):
    write_one(tmp_path)
    plan = make_plan(using(tmp_path))
    assert len(plan.solves) == 3  # both ends of ν; those of E are the case itself
    assert {solve.end_of for solve in plan.solves} == {"", "poisson"}
    assert all(end.low.study.identified is NOTHING for end in plan.ends)
    assert not make_plan(using(tmp_path), stored=plan.all_keys).solves


@pytest.mark.parametrize("correlation", [-0.5, 0.0, 1.0])
def test_forces_carry_the_bars_of_the_tissue(tmp_path, monkeypatch, correlation):
    monkeypatch.chdir(tmp_path)
    write_one(tmp_path, correlation=correlation)
    found = dataset(material={"from": "one.nc", "young": None, "poisson": None})
    force = float(found["force"])
    # The synthetic force goes as E (1 + ν).
    of_young, of_poisson = 2e3 / 12e3, 0.07 / 1.4
    # Errors are correlated as far as the narrower bars go: 600 Pa of 2 kPa, and 0.03 of 0.07.
    common = correlation * (600 / 2e3) * (0.03 / 0.07)
    expected = np.sqrt(of_young**2 + of_poisson**2 + 2 * common * of_young * of_poisson)
    assert float(found["force_uncertainty"]) / force == pytest.approx(expected, rel=1e-9)
    mesh, of_tissue = bars(found)
    assert mesh.share == pytest.approx(float(found["force_error"]) / force, rel=1e-9)
    assert of_tissue.share == pytest.approx(expected, rel=1e-9)


def test_relaxation_is_read_into_its_terms(tmp_path):
    write_one(tmp_path, names=("young", "relaxation_share_1", "relaxation_time_1"), study="[material]\npoisson = 0.4\n")
    history = {"ramp": "1 s", "hold": "10 s"}
    (term,) = next(using(tmp_path, probe={"history": history}).cases()).material.relaxation
    assert (term.share, term.time) == (0.4, 2.0)


@pytest.mark.parametrize(
    ("law", "names", "key", "expected"),
    [
        ("fibres = {direction = [1, 0, 0], k1 = 0.5, k2 = 2.0}", ("k1", "k2"), "fibres", {"k1": 0.3, "k2": 3.0}),
        ("terms = [{share = 0.7, alpha = 2.0}, {alpha = 9.0}]", ("share_1", "alpha_2"), "terms", [0.6, 2.0, 0.4, 8.0]),
        ('terms = [{name = "stiff", alpha = 2.0}]', ("stiff_alpha",), "terms", [1.0, 5.0]),
    ],
)
def test_fibres_and_terms_of_a_law_are_passed_on(tmp_path, monkeypatch, law, names, key, expected):
    """They are in tables of [material]: of these, what was known stays."""
    values = {"k1": 0.3, "k2": 3.0, "share_1": 0.6, "alpha_2": 8.0, "stiff_alpha": 5.0}
    unknowns = tuple(Unknown(name, 0.0, 30.0, "1") for name in names)
    monkeypatch.setattr(identifications, "UNKNOWNS", (*identifications.UNKNOWNS, *unknowns))
    for name in names:
        found = values[name]
        monkeypatch.setitem(identifications.VALUES, name, (found, 0.9 * found, 1.1 * found, 0.8 * found, 1.2 * found))
    kind = "holzapfel" if key == "fibres" else "ogden"
    write_one(tmp_path, names=("young", *names), study=f'[material]\npoisson = 0.45\nlaw = "{kind}"\n{law}\n')
    study = using(tmp_path)
    (case,) = study.cases()
    assert case.material.young == 12e3
    if key == "fibres":
        fibres = case.material.fibres
        assert {"k1": fibres.k1, "k2": fibres.k2} == expected and fibres.direction == (1.0, 0.0, 0.0)
    else:
        flat = [number for term in range(len(case.material.terms)) for number in _term(case, term + 1)]
        assert flat == pytest.approx(expected)
    assert read_text(study.text, study.file) == study
    ends = {solve.end_of for solve in make_plan(study).solves} - {""}
    assert ends >= set(names)


def _term(case, number):
    """Return share and exponent of a term, as the solver has them."""
    further = case.material.further
    return further[f"share{number}"], further[f"alpha{number}"]


def test_layers_that_fill_the_body_have_the_relaxation_that_was_found(tmp_path):
    """There is no [material] that could have it: each layer has it in the study, and in what is told to paste."""
    names = ("skin_young", "relaxation_share_1", "relaxation_time_1")
    write_one(tmp_path, names=names, study="[body]\n")
    layer = [{"name": "skin", "poisson": 0.3, "thickness": "1 mm"}, {"name": "fat", "young": "5 kPa", "poisson": 0.3}]
    history = {"ramp": "1 s", "hold": "10 s"}
    (case,) = using(tmp_path, body={"layer": layer}, probe={"history": history}).cases()
    assert case.relaxations[1:] == (((0.4, 2.0),),) * 2
    assert not case.way.in_time
    pasted = material(identification(names=names, study="[body]\n"))
    assert "# in the table of each layer:\nrelaxation = [{" in pasted
    assert "[material]" not in pasted
