"""The message of a path that ends names causes that the law and the contact allow, and what a study can change."""

import pytest

from epsmesh.solve.ended import ended
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw

LINEAR, LARGE = MaterialLaw.of_moduli(1.0, 0.3), MaterialLaw.of_moduli(1.0, 0.3, "neo-hookean")
WHY = LargeError("active sets repeat")


@pytest.mark.parametrize(
    ("law", "contact", "named", "not_named"),
    [
        (LARGE, {"is_found": False}, ["unstable", "a larger rim"], ["friction", "contact"]),
        (LARGE, {"is_found": True}, ["unstable", "a smaller depth, or smaller elements"], ["friction", "rim"]),
        (LARGE, {"is_found": True, "friction": 0.3}, ["unstable", "do not settle", "less friction"], ["rim"]),
        (LINEAR, {"is_found": True, "friction": 0.3}, ["with friction do not settle"], ["unstable", "depth;"]),
        (LINEAR, {"is_found": True, "friction": 0.3, "has_own_mesh": True}, ["use less friction"], ["elements"]),
        (LINEAR, {"is_found": True, "times": (0.5, 2.0)}, ["0.5 s of 2 s", "nodes in contact"], ["unstable"]),
    ],
)
def test_causes_and_remedies_are_possible_ones(law, contact, named, not_named):
    error = ended(WHY, law, (1e-3, 0.5), 2e-3, **contact)
    assert error.reached == (1e-3, 0.5)
    assert "reached" in str(error)
    assert "F is 0.5 N (Newton's method: active sets repeat)" in str(error)
    assert all(words in str(error) for words in named), str(error)
    assert not any(words in str(error) for words in not_named), str(error)


def test_a_path_that_ends_at_its_start_has_no_depth():
    assert ended(WHY, LARGE, (0.0, 0.0), 2e-3, is_found=True).reached is None
