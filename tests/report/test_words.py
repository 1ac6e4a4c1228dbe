"""Values of a dataset in words."""

from math import nan

import pytest

from epsmesh.report.words import barred, span, without_shared


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (
            ["around 12 mm 0 mm 0 mm radius 5 mm", "around 18 mm 0 mm 0 mm radius 5 mm"],
            ["12 mm 0 mm 0 mm", "18 mm 0 mm 0 mm"],
        ),
        (["the top of it", "the side of it"], ["top", "side"]),
        (["above", "above the plate"], ["above", "above the plate"]),
        (["a b a", "a b b a"], ["a", "b a"]),
        (["soft", "stiff"], ["soft", "stiff"]),
    ],
)
def test_words_that_all_names_share_are_left_out(names, short):
    assert without_shared(names) == short


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((25.02e-3, 31e-3), "25.02 to 31.00 mN"),
        ((20.261e-3, 20.261e-3), "20.26 mN"),
        ((1.0, 1.0 + 1e-6), "1000 mN"),
        ((0.5e-3, 0.51e-3), "0.50 to 0.51 mN"),
        ((-10e-3, 20e-3), "-10 to 20 mN"),
        ((0.3e-3, 120e-3), "0.3 to 120 mN"),
        ((1.0, 123.4), "1000 to 123400 mN"),
        ((nan, 0.0, 0.1), "0 to 100 mN"),
        ((0.0,), "0 mN"),
    ],
)
def test_both_ends_of_a_range_have_as_many_decimals(values, words):
    assert span("force", values) == words


@pytest.mark.parametrize(
    ("bar", "words"),
    [
        (0.025, "5.3 to 12.0 mN"),
        (0.2, "5 to 12 mN"),
        (3.0, "5 to 12 mN"),
        (1e-4, "5.35 to 12.00 mN"),
        (nan, "5.35 to 12.00 mN"),
    ],
)
def test_a_range_has_no_more_digits_than_its_bar_leaves(bar, words):
    assert span("force", (5.3456e-3, 12.001e-3), bar=bar) == words


@pytest.mark.parametrize(
    ("value", "bar", "words"),
    [
        (31.0046, 0.2512, "31.00 ± 0.25 mN"),
        (13.0, 0.0996, "13.00 ± 0.10 mN"),
        (-0.4, 0.03, "-0.400 ± 0.030 mN"),
        (12345.6, 230.0, "12346 ± 230 mN"),
        (0.3, 120.0, "0 ± 120 mN"),
        (0.0, 0.012, "0.000 ± 0.012 mN"),
        (1.5, 1e-12, "1.500000 ± 0.000001 mN"),
        (1.23456, 0.0, "1.235 ± 0 mN"),
        (1.23456, nan, "1.235 mN"),
    ],
)
def test_a_value_and_its_bar_end_at_one_decimal_place(value, bar, words):
    assert barred(value, bar, "mN") == words
