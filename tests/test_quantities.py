"""The table of quantities: values are written in the units that people read, and nothing is guessed."""

from math import inf, nan, pi

import pytest

from epsmesh.quantities import MESH_DIMENSIONS, QUANTITIES, quantity_of, symbol, write
from epsmesh.study.schema import Mesh
from tests.cases import study


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("epsilon", 10e-3, "10 mm"),
        ("epsilon", inf, "full"),
        ("young", 12e3, "12 kPa"),
        ("poisson", 0.45, "0.45"),
        ("mesh_accuracy", 0.003, "0.3 %"),
        ("force", 9.97e-3, "9.97 mN"),
        ("force_error", 2e-5, "0.02 mN"),
        ("angle", pi / 3, "60 °"),
        ("outside", "free", "free"),
        ("force", nan, ""),
        ("something new", 0.001, "0.001"),
    ],
)
def test_values_are_written_as_people_read_them(name, value, text):
    assert write(name, value) == text


def test_a_unit_that_is_given_is_used():
    assert write("something new", 0.001, "m") == "1 mm"
    assert write("something new", 3.0, "K") == "3 K"


def test_every_key_of_a_mesh_is_known():
    keys = set(Mesh.model_fields) - {"name", "accuracy"}
    assert keys | {"mesh", "mesh_accuracy"} == set(MESH_DIMENSIONS)
    assert {name for name, quantity in QUANTITIES.items() if quantity.finest} <= set(MESH_DIMENSIONS)


def test_symbols():
    assert symbol("poisson") == "ν"
    assert symbol("probe_radius") == "probe radius"


def test_cases_are_named_in_the_units_of_their_axes():
    case = study(probe={"radius": ["2 mm", "3 mm"]}, material={"young": ["10 kPa", "20 kPa"]}).case((0, 1))
    assert case.words == {"young": "10 kPa", "probe_radius": "3 mm"}
    assert str(case) == "young = 10 kPa, probe_radius = 3 mm"


def test_keys_of_layers_and_inclusions_are_read_like_others():
    assert write("skin_young", 60e3) == "60 kPa"
    assert write("tumour_radius", 4e-3) == "4 mm"
    assert (symbol("skin_young"), symbol("skin_thickness")) == ("E of skin", "thickness of skin")
    found = quantity_of("inner_skin_poisson")
    assert found is not None
    assert (found.unit, found.meaning) == ("1", "Poisson's ratio of inner_skin")
    assert quantity_of("body_radius").meaning == "radius of the body"
    assert quantity_of("young_man") is None
