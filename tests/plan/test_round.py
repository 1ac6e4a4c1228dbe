"""Which scenes are solved in two dimensions."""

from typing import Any

import pytest

from epsmesh.mesh.of_case import meridian_of
from epsmesh.plan.symmetry import is_round
from tests.cases import study

CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "10 mm", "fixed": "bottom"}
SKIN: dict[str, Any] = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.48}
FAT: dict[str, Any] = {"name": "fat", "young": "2 kPa", "poisson": 0.45}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-6 mm"], "radius": "2 mm", "young": "50 kPa", "poisson": 0.45}


def case(body: Any = None, **changes: Any):
    """Return the case of a study with a cylinder, with changes."""
    return study(body=CYLINDER | (body or {}), **changes).case(())


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ({}, True),
        ({"layer": [SKIN]}, True),
        ({"layer": [SKIN, FAT]}, True),
        ({"inclusion": [BALL]}, False),
        ({"layer": [SKIN], "inclusion": [BALL]}, False),
        # Held from where a stiff layer ends: the displacement goes like r to a power below one half.
        ({"layer": [SKIN], "fixed": {"below": "-2 mm"}}, False),
        ({"layer": [SKIN], "fixed": {"below": "-2.1 mm"}}, True),
        ({"layer": [SKIN | {"young": "5 kPa"}], "fixed": {"below": "-2 mm"}}, True),
    ],
)
def test_layered_cylinders_are_round(body, expected):
    assert is_round(case(body=body)) is expected


def test_layers_reach_the_meridian():
    whole, part = (meridian_of(case(body={"layer": layers})) for layers in ([SKIN, FAT], [SKIN]))
    assert (whole.interfaces, whole.is_filled) == ((-0.002,), True)
    assert (part.interfaces, part.is_filled) == ((-0.002,), False)


def test_deep_bonded_tools_are_not_pressed_on_the_meridian():
    """Its elements fold at the edge of a disc of 3 mm; linear ones do not."""
    law = {"law": "neo-hookean"}
    assert is_round(case(material=law, probe={"depth": "0.7 mm"}))
    assert not is_round(case(material=law, probe={"depth": "0.8 mm"}))
    assert is_round(case(probe={"depth": "0.8 mm"}))


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("10 kPa*(1 + r/(20 mm) - z/(9 mm))", True),
        ("10 kPa*(1 + (y*y + x^2)/(20 mm)^2)", True),
        ("10 kPa*(1 + sqrt(x**2 + y**2)/(20 mm))", True),
        ("10 kPa*(1 + x^2/(20 mm)^2 + r/(20 mm))", False),
        ("10 kPa*(1 + (x^2 + x^2)/(20 mm)^2)", False),
        ("10 kPa*(1 + (x^2 - y^2)/(90 mm)^2)", False),
    ],
)
def test_formulas_of_r_and_z_are_round(formula, expected):
    field = {"young": {"formula": formula}}
    assert is_round(case(material=field)) is expected
    assert is_round(case(body={"layer": [SKIN | field]})) is expected
    assert not is_round(case(material=field, probe={"at": ["1 mm", "0 mm"]}))


def test_a_layer_that_is_stiffer_where_the_support_begins_is_not_round():
    """A field counts with its value there, at r = 20 mm."""
    soft, stiff = ({"young": {"formula": f"5 kPa*(1 + {factor}*(r/(20 mm))^4)"}} for factor in (0.1, 3))
    assert is_round(case(body={"layer": [SKIN | soft], "fixed": {"below": "-2 mm"}}))
    assert not is_round(case(body={"layer": [SKIN | stiff], "fixed": {"below": "-2 mm"}}))
