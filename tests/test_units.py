"""Quantities: one number and one unit; whatever else pint would calculate is refused with the reason."""

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epsmesh.study.read import read_study
from epsmesh.units import canonical, parse_quantity
from tests.studies import small_text

READ = {
    ("10 kPa", "Pa"): 10e3,
    ("10kPa", "Pa"): 10e3,
    (" 1e1  kPa ", "Pa"): 10e3,
    ("+.5 MPa", "Pa"): 5e5,
    ("2. N/mm^2", "Pa"): 2e6,
    ("2 kN/m²", "Pa"): 2e3,
    ("3 kg/m/s**2", "Pa"): 3.0,
    ("1 N*m^-2", "Pa"): 1.0,
    ("\N{MINUS SIGN}10 mm", "m"): -0.01,
    ("1e\N{MINUS SIGN}3 m", "m"): 1e-3,
    ("5\N{NO-BREAK SPACE}μm", "m"): 5e-6,
    ("5 µm", "m"): 5e-6,
    ("1.06 g/cm³", "kg/m^3"): 1060.0,
    ("-9.81 m/s^2", "m/s^2"): -9.81,
    ("60°", "rad"): canonical(1.0471975511965976),
    ("5%", ""): 0.05,
    ("0.05", ""): 0.05,
}
REFUSED = {
    ("10,5 kPa", "Pa"): "10,5 has a comma: write 10.5",
    ("1,000 kPa", "Pa"): "write 1.000 or 1000",
    ("10 ± 2 kPa", "Pa"): "one number and one unit are taken, and `± 2 kPa` is no unit; allowed are Pa, kPa",
    ("10 kPa;", "Pa"): "`kPa;` is no unit",
    ("10 kPa + 5 kPa", "Pa"): "one number and one unit are taken",
    ("2*3 kPa", "Pa"): "one number and one unit are taken",
    ("1_0 kPa", "Pa"): "one number and one unit are taken",
    ("10 (kPa)", "Pa"): "one number and one unit are taken",
    ("10 kP\N{CYRILLIC SMALL LETTER A}", "Pa"): "CYRILLIC SMALL LETTER A",
    ("1e300 m", "m"): "numbers from 1e-30 to 1e+30 m are taken",
    ("-1e-400 mm", "m"): "numbers from 1e-30 to 1e+30 m are taken",
    ("10.5.2 kPa", "Pa"): "the number comes first",
    ("kPa", "Pa"): "the number comes first",
    ("\N{EN DASH}10 mm", "m"): "EN DASH",
    ("١٠ mm", "m"): "ARABIC-INDIC DIGIT ONE",
    ("", "m"): "the number comes first",
    ("10 kpa", "Pa"): "unknown unit `kpa`; did you mean kPa?",
    ("10 cmHg", "Pa"): "unknown unit `cmHg`; allowed are Pa, kPa",
    ("10 MM", "m"): "did you mean mm?",
    ("10 mm", "Pa"): "`mm` is no unit of a pressure",
    ("10 %*kPa", "Pa"): "`%*kPa` is no unit of a pressure",
    ("10 N/m s", "Pa"): "one number and one unit are taken",
    ("10", "m"): "the unit is missing; allowed are mm",
    ("60", "rad"): "the unit is missing",
    ("60 %", "rad"): "`%` is no unit of an angle",
    ("1 rad", ""): "`rad` is no unit of a share",
    ("1 mm/mm", ""): "`mm/mm` is no unit of a share",
    ("5", ""): '5 without a unit would be 500 %: is "5 %" meant, that is 0.05?',
    ("1e999", ""): "the number must be finite",
    ("1e999 kPa", "Pa"): "the number must be finite",
    ("1e308 GPa", "Pa"): "the number must be finite",
    ("inf m", "m"): "the number must be finite",
    ("nan m", "m"): "the number must be finite",
}


@pytest.mark.parametrize(("text", "unit"), READ)
def test_one_number_and_one_unit_are_read(text, unit):
    assert parse_quantity(text, unit) == READ[text, unit]


@pytest.mark.parametrize(("text", "unit"), REFUSED)
def test_anything_else_is_refused_and_says_why(text, unit):
    with pytest.raises(ValueError, match=r", such as \"") as problem:
        parse_quantity(text, unit)
    assert REFUSED[text, unit] in str(problem.value)


@given(st.one_of(st.just(0.0), st.floats(1e-27, 1e30), st.floats(-1e30, -1e-27)), st.sampled_from(["mm", "m", "cm"]))
def test_a_number_means_what_it_says(number, unit):
    assert parse_quantity(f"{number!r} {unit}", "m") == pytest.approx(number * {"mm": 1e-3, "m": 1, "cm": 1e-2}[unit])


@pytest.mark.parametrize("unit", ["m", "Pa", "s", "rad", "kg/m^3", "m/s^2"])
def test_units_that_people_write_are_worth_what_they_are_elsewhere(unit):
    with pytest.raises(ValueError, match="the unit is missing") as problem:
        parse_quantity("1", unit)
    written = str(problem.value).partition("allowed are ")[2].split(", ")
    assert len(written) > 1
    for one in written:
        worth = pint.get_application_registry().Quantity(1.0, one).to(unit).magnitude
        assert parse_quantity(f"0.5 {one}", unit) == canonical(0.5 * worth)


@given(st.text(max_size=12))
def test_any_text_is_a_finite_number_or_refused(text):
    try:
        assert abs(parse_quantity(text, "m")) < float("inf")
    except ValueError as problem:
        assert 'a length, such as "10 mm"; ' in str(problem)


def test_a_file_may_begin_with_the_mark_of_its_encoding(tmp_path):
    file = tmp_path / "marked.toml"
    file.write_text(small_text(), encoding="utf-8-sig")
    assert read_study(file).cases()
    assert not read_study(file).text.startswith("\ufeff")
