"""An identification in words, as a figure and as a page."""

import tomllib

import numpy as np
import pytest
import xarray as xr

from epsmesh.report.read import read_any, read_file
from epsmesh_identify.estimation.dataset import dataset_of, joined, write
from epsmesh_identify.estimation.parts import SOURCES
from epsmesh_identify.report.figures.identification import draw
from epsmesh_identify.report.figures.identification import identification as figure
from epsmesh_identify.report.identified import answer, engineering, material, parts, title
from epsmesh_identify.report.page import render
from tests.identifications import estimate, identification

NONE = {name: np.full(3, np.nan) for name in ("low", "high", "low_hidden", "high_hidden")}


def test_both_error_bars_are_told_each_with_what_it_supposes():
    first, second = answer(identification())
    assert first == (
        "E = 12.0 kPa ± 5 % if the body is as declared; ± 17 % if an undeclared layer, base or stiffening cannot be "
        "excluded."
    )
    assert second == "ν = 0.400 ± 0.030 as declared; 0.3 to 0.44 with what may be undeclared."


def test_one_bar_is_told_where_nothing_may_hide():
    ends = {name: estimate().low if "low" in name else estimate().high for name in NONE}
    assert answer(identification(may_hide="", **ends))[0] == "E = 12.0 kPa ± 5 %."


def test_an_unknown_that_the_curves_do_not_tell_has_no_value():
    lines = answer(identification(seen=np.array([True, False, True]), notes=("A second punch would tell it.",)))
    assert lines[1] == "ν is not in this curve: all values from 0.37 to 0.43 fit."
    assert lines[2] == "A second punch would tell it."
    assert "poisson" not in material(identification(seen=np.array([True, False, True])))


def test_a_law_that_does_not_fit_has_no_bar_but_moduli_by_depth():
    dataset = identification(verdict="does not fit: the residuals bend", **NONE)
    text = " ".join(answer(dataset))
    assert "±" not in text
    assert "does not fit: the residuals bend" in text
    assert "9.00 kPa to a depth of 200 µm, 12.0 kPa to a depth of 1.00 mm" in text
    assert material(dataset) == ""
    assert "±" not in render(dataset, "one").split("<main>")[0]


def test_parts_are_told_from_the_largest_on():
    assert parts(identification(), "young").startswith(
        "E: noise 3.9 %, contact point and baseline 2.2 %, machine 1.6 %"
    )


def test_the_squares_of_parts_add_up_to_the_bar():
    dataset = identification()
    half = (dataset["high"] - dataset["low"]) / 2
    assert list(dataset["source"].values) == list(SOURCES)
    xr.testing.assert_allclose(np.sqrt((dataset["part"] ** 2).sum("source")), half)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(12345.0, "Pa", "12.3 kPa"), (999.9e3, "Pa", "1.00 MPa"), (-2e-5, "m", "-20.0 µm"), (0.45, "1", "0.45"),
     (0.0, "N", "0.00 N"), (6.4e4, "N/m", "64.0 kN/m"), (5e-12, "m", "5.00 pm"), (1.1e-4, "m", "110 µm")],
)  # fmt: skip
def test_values_have_a_prefix_that_suits_them(value, unit, text):
    assert engineering(value, unit) == text
    assert "e" not in engineering(value, unit, 2)


def test_names_of_unknowns_are_for_people():
    assert [title(name) for name in ("young", "skin_young", "poisson", "relaxation_time_1", "machine_stiffness")] == [
        "E", "E of skin", "ν", "relaxation time 1", "stiffness of the machine",
    ]  # fmt: skip


def test_a_file_has_all_of_an_identification(tmp_path):
    dataset = identification()
    write(dataset, tmp_path / "one.nc")
    again = read_any(tmp_path / "one.nc")
    xr.testing.assert_equal(again, dataset)
    assert again.attrs["verdict"] == "fits"
    assert all("long_name" in variable.attrs for variable in again.variables.values())


def test_many_files_are_one_dataset(tmp_path):
    found = [identification(), identification(verdict="does not fit: it bends", **NONE), identification()]
    dataset = joined(found, ["a.csv", "b.csv", "c.csv"])
    write(dataset, tmp_path / "many.nc")
    dataset = read_file(tmp_path / "many.nc")
    assert dataset.sizes["file"] == 3
    lines = answer(dataset)
    assert lines[0] == "3 files: the declared law fits 2."
    assert lines[1] == "It does not fit b.csv."
    assert "median 12.0 kPa" in lines[2] and "± 5 % if the body is as declared, ± 17 %" in lines[2]
    assert render(dataset, "many").count("b.csv") >= 2
    assert len(figure(dataset, "").axes) == 2


def test_figure_and_page_are_written_whole(tmp_path):
    dataset = identification()
    files = draw(dataset, tmp_path / "one")
    assert [file.name for file in files] == ["one.png", "one.svg"]
    page = render(dataset, "one")
    assert page.count("<svg") == 1
    assert 'from = "results/one.nc"' in page


def test_the_outer_bar_is_seen_or_ends_in_an_arrow():
    dataset = identification()
    one = dataset.sel(unknown="young")
    estimate, low, high = (float(one[name]) for name in ("estimate", "low", "high"))
    for times, arrows in ((2.0, 0), (50.0, 2)):
        outer = {"low": estimate - times * (estimate - low), "high": estimate + times * (high - estimate)}
        is_it = dataset["unknown"] == "young"
        wide = dataset.assign({f"{end}_hidden": dataset[end].where(~is_it, at) for end, at in outer.items()})
        (ax,) = (ax for ax in figure(wide, "").axes if ax.get_xlabel().startswith("E,"))
        assert sum(line.get_marker() in "<>" for line in ax.lines) == arrows
        assert np.ptp(ax.get_xlim()) > 2.5 * 1e-3 * (high - low)  # kPa


def test_curves_of_any_length_and_number_are_shown():
    curves = estimate().curves
    short = [type(one)(f"curve {n}", *(getattr(one, name)[: 200 + n] for name in ("depth", "force", "fit", "band")),
                       one.noise) for n, one in enumerate(curves * 5)]  # fmt: skip
    drawn = figure(dataset_of(estimate(curves=tuple(short)), {}), "")
    assert "The first 3 of 5 curves are shown." in drawn.get_label()


def test_a_material_to_paste_has_what_the_study_knew_of_it():
    known = '[material]\nlaw = "holzapfel"\nyoung = "1 kPa"\nfibres = {direction = [1, 0, 0], k1 = 0.5}\n'
    text = material(identification().assign_attrs(study=known))
    assert text.count("young") == 1
    assert 'law = "holzapfel"  # as known before' in text
    found = tomllib.loads(text)["material"]
    assert found["fibres"] == {"direction": [1, 0, 0], "k1": 0.5}
    assert "poisson" in found


def test_a_depth_that_is_nearly_a_millimetre_has_the_unit_of_its_axis():
    dataset = identification()
    drawn = figure(dataset.assign(depth=dataset["depth"] * (0.9999e-3 / float(dataset["depth"].max()))), "")
    lower = drawn.axes[1]
    shown = max(float(line.get_xdata().max()) for line in lower.lines[:1])
    assert lower.get_xlabel() == "depth of the tool, µm"
    assert shown == pytest.approx(999.9)
