"""Ranges ``{from, to, steps}``: the same study as with the list of their values."""

import pytest

from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.cases import raw, refusal, study


def spread(start, to, steps):
    return {"from": start, "to": to, "steps": steps}


@pytest.mark.parametrize(
    ("section", "key", "given", "values"),
    [
        ("probe", "depth", spread("0.1 mm", "0.3 mm", 3), ["0.1 mm", "0.2 mm", "0.3 mm"]),
        ("probe", "depth", spread("0.3 mm", "0.1 mm", 3), ["0.3 mm", "0.2 mm", "0.1 mm"]),
        ("material", "young", spread("5 kPa", "25 kPa", 5), ["5 kPa", "10 kPa", "15 kPa", "20 kPa", "25 kPa"]),
        ("material", "poisson", spread(0.1, 0.4, 4), [0.1, 0.2, 0.3, 0.4]),
        ("mesh", "degree", spread(1, 3, 3), [1, 2, 3]),
        ("mesh", "epsilon", [spread("4 mm", "6 mm", 3), "full"], ["4 mm", "5 mm", "6 mm", "full"]),
    ],
)
def test_a_range_is_the_list_of_its_values(section, key, given, values):
    one, other = study(**{section: {key: given}}), study(**{section: {key: values}})
    assert one.axes == other.axes
    assert one.sections == other.sections


def test_ranges_in_pieces_and_in_arrays_of_tables():
    skin = {"name": "skin", "thickness": "2 mm", "young": spread("10 kPa", "30 kPa", 3), "poisson": 0.4}
    (axis,) = study(body={"layer": [skin]}).axes
    assert (axis.name, axis.labels) == ("skin_young", (10e3, 20e3, 30e3))
    disc = raw()["probe"] | {"depth": spread("0.1 mm", "0.2 mm", 2)}
    found = parse(raw() | {"probe": [disc | {"name": "one"}, disc | {"name": "two", "radius": "4 mm"}]})
    assert [axis.name for axis in found.axes] == ["probe", "depth"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"from": "0.1 mm", "to": "1 mm"}, ["probe.depth", "from, to and steps"]),
        (spread("0.1 mm", "1 cm", 3), ["probe.depth", "one unit"]),
        (spread("0.1 mm", 1, 3), ["probe.depth", "one unit"]),
        (spread("0.1 mm", "0.3 mm", 1), ["probe.depth.steps = 1", "from 2 to"]),
        (spread("0.1 mm", "0.3 mm", 10**9), ["probe.depth.steps", "from 2 to"]),
        (spread("-0.1 mm", "0.3 mm", 2), ['probe.depth = "-0.1 mm"', "greater than 0"]),
        ([spread("1 mm", "2 mm", 9_000)] * 999, ["probe.depth", "at most 10000"]),
        (spread(1, 3, 2), ["probe.depth = 1", "a number with a unit"]),
    ],
    ids=str,
)
def test_a_wrong_range_is_told_once(given, words):
    said = refusal(raw(probe={"depth": given}))
    assert all(word in said for word in words), said


def test_sections_that_are_not_swept_have_no_ranges():
    with pytest.raises(StudyError, match=r"solve\.repeats"):
        study(solve={"timing": True, "repeats": spread(1, 3, 3)})
