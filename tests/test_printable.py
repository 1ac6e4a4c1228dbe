"""What people and scripts read: numbers with their nouns, and letters as they are."""

import pytest

from epsmesh.printable import counted, printable_json


@pytest.mark.parametrize(
    ("number", "noun", "words"),
    [
        (0, "case", "0 cases"),
        (1, "case", "1 case"),
        (2, "case", "2 cases"),
        (1, "mesh", "1 mesh"),
        (2, "mesh", "2 meshes"),
    ],
)
def test_a_number_has_its_noun(number, noun, words):
    assert counted(number, noun) == words


def test_signs_that_nobody_sees_are_escaped():
    assert printable_json('"µ\u202e"') == '"µ\\u202e"'
