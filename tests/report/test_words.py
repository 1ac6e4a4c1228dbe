"""Values of a dataset in words."""

import pytest

from epsmesh.report.words import without_shared


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
