"""Slits that make no sense, or have no room in the body, are refused with a sentence."""

import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.cases import BLADE, raw

BOX = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}
SLIT = {**BLADE, "width": "1 mm", "incision": "4 mm"}
LAYERED = {**BOX, "layer": [{"name": "skin", "thickness": "4.1 mm", "young": "20 kPa", "poisson": 0.4}]}
TUMOUR = {"name": "tumour", "at": ["0 mm", "2 mm", "-3 mm"], "radius": "1.5 mm", "young": "20 kPa", "poisson": 0.4}
ORGAN = {"shape": "ellipsoid", "axes": ["30 mm", "30 mm", "30 mm"], "fixed": {"below": "-10 mm"}}


def problems(**changes):
    with pytest.raises(StudyError) as caught:
        parse(raw(**changes))
    return [(problem.key, problem.allowed) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("key", "said", "changes"),
    [
        ("probe.direction", "must be along x or y", {"probe": {**SLIT, "contact": "frictionless",
                                                           "direction": [1.0, 0.2, 0.0]}}),
        ("probe.incision", "leaves 0 mm between the blade's tip", {"probe": {**SLIT, "contact": "frictionless",
                                                                  "incision": "5.1 mm"}, "body": LAYERED}),
        ("probe.slice", "slides without force", {"probe": {**SLIT, "contact": "frictionless",
                                                                "slice": "0.1 mm"}}),
        ("probe.ahead", "leaves no part of the blade in the slit", {"probe": {**SLIT, "incision": "1 mm"}}),
        ("probe.ahead", "there is no incision", {"probe": {**BLADE, "ahead": "1 mm"}}),
        ("probe.beside", "there is no incision", {"probe": {**BLADE, "beside": "1 mm"}}),
        ("probe.beside", "has no front there", {"probe": {**SLIT, "ends": "open", "beside": "1 mm"}}),
        ("probe.slice", "past the slit's front at its end, which is 0.5 mm", {"probe": {
            **SLIT, "beside": "0.5 mm", "slice": "0.6 mm"}}),
        ("probe.ends", "there is no incision", {"probe": {**BLADE, "ends": "open"}}),
        ("probe.incision", "through the whole body", {"probe": {**SLIT, "incision": "20 mm"}}),
        ("probe.incision", "through the support", {"probe": {**SLIT, "incision": "16 mm"},
                                                   "body": {**BOX, "fixed": {"below": "-15 mm"}}}),
        ("probe.incision", "at least 0.25 mm", {"probe": {**SLIT, "incision": "19.9 mm"}}),
        ("probe.incision", "the end of a layer", {"probe": SLIT, "body": LAYERED}),
        ("probe.at", "the slit must be inside", {"probe": {**SLIT, "at": ["14.5 mm", "0 mm"]}}),
        ("probe.at", "the footprint of the blade", {"probe": {**SLIT, "ends": "open", "at": ["16 mm", "0 mm"]}}),
        ("probe.ends", "the sides, which are fixed", {"probe": {**SLIT, "ends": "open"},
                                                    "body": {**BOX, "fixed": "sides"}}),
        ("body.inclusion[1].at", "must be at least 1 mm", {"probe": SLIT, "body": {**BOX, "inclusion": [TUMOUR]}}),
        ("probe.incision", "flat top of a box or a cylinder", {"probe": SLIT, "body": ORGAN}),
        ("probe.incision", "flat top of a box or a cylinder", {"probe": {**SLIT, "axis": [0.1, 0.0, -1.0]}}),
        ("probe.depth", "past the slit's front below its tip", {"probe": {**SLIT, "depth": "1 mm"}}),
        ("probe.slice", "past the slit's front at its end", {"probe": {**SLIT, "slice": "1.5 mm"}}),
        ("mesh.epsilon", "the slit reaches out of", {"probe": SLIT, "mesh": {"epsilon": "5 mm", "outside": "free"}}),
        ("mesh.outside", "would stop the open slit", {"probe": {**SLIT, "ends": "open"},
                                                        "mesh": {"epsilon": "10 mm", "outside": "fixed"}}),
    ],
)  # fmt: skip
def test_refused(key, said, changes):
    """Once each, by key."""
    assert [(name, said in text) for name, text in problems(**changes)] == [(key, True)]


@pytest.mark.parametrize("at", [3.5, 5.25, 15.5])
@pytest.mark.parametrize("beside", [0.0, 0.65])
def test_inclusions_of_any_size_are_seen(at, beside):
    """However long the slit is, and small the ball."""
    ball = {"name": "cyst", "at": [f"{at} mm", f"{beside} mm", "-2.55 mm"], "radius": "0.4 mm"}
    body = {**BOX, "inclusion": [{**ball, "young": "20 kPa", "poisson": 0.4}]}
    ((key, text),) = problems(probe={**SLIT, "ends": "open", "ahead": "0.3 mm", "width": "0.3 mm"}, body=body)
    assert key == "body.inclusion[1].at"
    assert ("the distance is 0.25 mm" if beside else "the slit cuts it") in text


def test_no_incision():
    """An incision of nothing is a blade on the surface, whose F is proportional to depth; in a slit it is not."""
    flat, deep = (parse(raw(probe={**BLADE, "incision": d})).case(()).probe for d in ("0 mm", "4 mm"))
    assert flat.slit is None
    assert flat.proportional_to == ("depth", "slice")
    assert deep.proportional_to == ()


def test_depth_has_no_effect_without_bond_in_a_slit():
    """The study warns of it. Each Poisson's ratio is solved: a reduced basis gives the work only."""
    poisson = [0.035 * n for n in range(12)]
    sliding = parse(raw(probe={**SLIT, "contact": "frictionless"}, material={"poisson": poisson}))
    assert any("no effect" in warning for warning in sliding.warnings)
    assert not any(solve.reduced for solve in make_plan(sliding).solves)
