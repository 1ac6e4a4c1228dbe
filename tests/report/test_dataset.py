"""The dataset: dimensions of the study, SI units, ratios to the full order of the same scene."""

import json

import numpy as np
import pytest
import xarray as xr

import epsmesh.report.accessor  # noqa: F401
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build, write
from epsmesh.report.read import read
from epsmesh.report.study import study_of
from epsmesh.study.axis import Axis
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_study
from tests.cases import raw
from tests.fuzz.studies import toml
from tests.organs import ellipsoid, write_stl
from tests.report.synthetic import FIGURE, dataset


def test_ratios_are_to_the_full_order_of_the_same_scene():
    data = dataset(**FIGURE)
    full = data.sel(epsilon=np.inf)
    xr.testing.assert_allclose(data["force_ratio"], data["force"] / full["force"].drop_vars("epsilon"))
    assert (data["force_ratio"].sel(epsilon=np.inf) == 1).all()
    assert (data["speedup"].sel(epsilon=10e-3) > 1).all()
    assert dataset()["force_ratio"] == 1.0


def test_without_full_order_there_is_no_ratio():
    data = dataset(mesh={"epsilon": ["4 mm", "8 mm"]})
    assert np.isnan(data["force_ratio"]).all()
    assert np.isfinite(data["force"]).all()


def test_failed_and_pending_cases_have_no_force():
    data = dataset(failed=2, pending=3, **FIGURE)
    assert (np.isnan(data["force"]) == (data["status"] != "ok")).all()
    assert set(np.unique(data["status"])) == {"ok", "failed", "pending"}
    assert (data["message"].where(data["status"] == "failed", "it went wrong") == "it went wrong").all()


def test_swept_accuracy_and_reached_accuracy_are_told_apart():
    data = dataset(
        material={"poisson": [0.3, 0.4]}, solve={"exact": True},
        mesh={"epsilon": None, "fine": None, "coarse": None, "rim": None, "growth": None, "accuracy": ["5 %", "1 %"]},
    )  # fmt: skip
    assert data["force_exact_ratio"].dims == data["force"].dims == ("poisson", "mesh_accuracy")
    assert list(data["mesh_accuracy"].values) == [0.05, 0.01]
    assert np.isfinite(data["force_exact_ratio"]).all()


def test_what_was_skipped_and_why_is_kept():
    data = dataset(material={"young": ["1 kPa", "2 kPa", "4 kPa"]})
    skipped = {item["name"]: item for item in json.loads(data.attrs["reductions"])}
    assert skipped["scaling"]["count"] == 2
    assert "proportional" in skipped["scaling"]["reason"]
    assert data.attrs["study_file"] == "study"


def test_earlier_result_survives_a_failed_write(tmp_path):
    path = tmp_path / "a.nc"
    write(dataset(), path)
    before = path.read_bytes()
    with pytest.raises(TypeError):
        write(dataset().assign_attrs(bad={"not": "allowed"}), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]


def test_what_was_done_to_a_bodys_file_is_told_beside_its_forces(tmp_path):
    points, facets = ellipsoid()
    body = {"shape": "surface", "unit": "mm", "fixed": {"below": "-10 mm"}, "repair": True}
    whole = body | {"file": str(write_stl(tmp_path / "whole.stl", points, facets))}
    facets[0] = facets[0, ::-1]
    mended = body | {"file": str(write_stl(tmp_path / "mended.stl", points, facets))}
    probe = {"at": ["5 mm", "3 mm"], "radius": "4 mm"}
    found = dataset(body=whole, probe=probe)
    assert "body_message" not in found and "surface_deviation" not in dataset()
    assert "surface_deviation" in found
    data = dataset(body=mended, probe=probe)
    assert data["status"] == "ok" and "repaired: 1 inverted facets turned" in str(data["body_message"].values)


def test_names_of_the_dataset_are_refused_as_dimensions_before_anything_is_computed():
    """Tables of loads are a dimension; what would bear the name of a result is refused with the study."""
    pressed = {"traction": [{"on": "free", "pressure": "1 kPa"}]}
    assert dataset(load=[{"name": "pressed", **pressed}, {"name": "plain"}])["force"].dims == ("load",)
    ball = {"name": "contact", "at": ["0 mm", "0 mm", "-12 mm"], "radius": ["2 mm", "3 mm"], "young": "50 kPa"}
    with pytest.raises(StudyError, match=r"a dimension contact_radius, the name of a result .* another name"):
        dataset(body={"inclusion": [ball | {"poisson": 0.4}]})


def test_a_dataset_finds_the_files_of_its_study_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "study").mkdir()
    write_stl(tmp_path / "study" / "whole.stl", *ellipsoid())
    body = {"shape": "surface", "unit": "mm", "fixed": {"below": "-10 mm"}, "file": "whole.stl"}
    content = raw(body=body, probe={"at": ["5 mm", "3 mm"], "radius": "4 mm"})
    file = tmp_path / "study" / "own.toml"
    file.write_text(toml(content))
    data = build(make_plan(read_study(file)), {})
    monkeypatch.chdir(tmp_path)
    write(data, tmp_path / "own.nc")
    found = study_of(read(tmp_path / "own.nc"))
    assert found is not None and found.text == file.read_text()


def test_every_entry_of_a_stiffness_has_its_unit(tmp_path):
    write(dataset(probe={"motion": "all"}), tmp_path / "a.nc")
    data = read(tmp_path / "a.nc")
    assert "units" not in data["stiffness"].attrs
    unit = {"x": "N/m", "rx": "N m"}
    for one, other in (("x", "x"), ("x", "rx"), ("rx", "x"), ("rx", "rx")):
        expected = unit[one] if one == other else "N"
        assert str(data["stiffness"].sel(movement=one, reaction=other)["stiffness_unit"].values) == expected
        assert data.epsmesh.to_frame().attrs["units"][f"stiffness_{one}_{other}"] == expected


def test_a_swept_key_that_no_table_names_is_named_in_words():
    axes = (Axis("material", "direction", ("a", "b"), "", piece="fibres"), Axis("load", "push_in", (1, 2), "1", "pads"))
    assert [axis.words for axis in axes] == ["direction of the fibres", "push in of the pads"]
