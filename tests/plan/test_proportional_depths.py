"""Depths of a tool whose contact does not grow with them: one is solved, and the others are what each would be."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.describe import story
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.study.read import parse
from tests.cases import raw

# A disc on a stiff skin, from which tissue lifts off within: the area of contact is a question, and has no depth in it.
LIFTS = {
    "body": {
        "shape": "cylinder", "radius": "8 mm", "height": "8 mm", "fixed": "bottom",
        "layer": [{"name": "skin", "thickness": "1 mm", "young": "300 kPa", "poisson": 0.3}],
    },
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "disc", "radius": "3 mm", "depth": ["0.1 mm", "0.25 mm"], "contact": "unilateral"},
    "mesh": {"rim": "1 mm", "growth": 1.0},
}  # fmt: skip
SLIDES = {
    "body": {"shape": "box", "size": ["12 mm", "8 mm", "6 mm"], "fixed": "bottom"},
    "probe": {
        "shape": "blade", "length": "4 mm", "width": "0.8 mm", "incision": "3 mm", "ahead": "1 mm",
        "depth": ["0.1 mm", "0.3 mm"], "contact": "frictionless",
    },
    "mesh": {"fine": "2 mm", "coarse": "4 mm", "rim": "0.5 mm", "growth": 1.0},
}  # fmt: skip
# Of the cases' results, and how each goes with the depth where F is proportional to it.
POWERS = {"force": 1, "force_error": 1, "energy": 2, "max_strain": 1, "contact_area": 0, "contact_radius": 0}


def dataset(changes, without=()):
    content = raw(**changes)
    content["plan"] = {"without": ["axisymmetric", *without]}
    plan = make_plan(parse(content))
    return plan, build(plan, compute(plan, MPI.COMM_SELF))


def test_flat_tools_of_which_tissue_lifts_off_are_solved_at_one_depth():
    (plan, scaled), (plain, solved) = dataset(LIFTS), dataset(LIFTS, without=("scaling",))
    assert (len(plan.solves), len(plain.solves)) == (1, 2)
    assert float(solved["contact_area"].max()) < 0.95 * np.pi * 3e-3**2  # it does lift off
    for name, power in POWERS.items():
        np.testing.assert_allclose(scaled[name], solved[name], rtol=5e-6)
        ratio = (scaled[name][1] / scaled[name][0]).values
        np.testing.assert_allclose(ratio, 2.5**power, rtol=1e-12)
    told = story(plan, (1,))
    assert told["key"] == story(plan, (0,))["key"]
    assert "F is proportional" in told["changes"]["depth"]


def test_an_exact_force_and_all_stiffnesses_are_of_one_depth():
    content = raw(**LIFTS | {"body": {"shape": "cylinder", "radius": "12 mm", "height": "10 mm", "fixed": "bottom"}})
    content["material"]["young"] = ["5 kPa", "10 kPa"]
    content["solve"] = {"exact": True}
    plan = make_plan(parse(content))
    assert len(set(plan.keys)) == len(set(plan.reference_keys)) == 1
    scales = [plan.scale_of(case) for case in plan.study.cases()]
    assert [scale.stress for scale in scales] == [5e3, 5e3, 10e3, 10e3]
    np.testing.assert_allclose([scale.length for scale in scales], [1, 2.5, 1, 2.5], rtol=1e-12)


@pytest.mark.parametrize("kind", ["curved", "tilted", "ball"])
def test_what_is_not_in_proportion_is_solved_at_each_depth(kind):
    """On a curved surface, where the tool is tilted, and under one that is not flat, contact grows with depth."""
    ball = {"shape": "ellipsoid", "axes": ["20 mm", "20 mm", "20 mm"], "fixed": {"below": "-10 mm"}}
    changes = {
        "curved": {"body": ball, "probe": LIFTS["probe"]},
        "tilted": {"probe": LIFTS["probe"] | {"axis": [0.002, 0.0, -1.0]}},
        "ball": {"probe": LIFTS["probe"] | {"shape": "sphere"}},
    }
    plan = make_plan(parse(raw(**changes[kind])))
    assert not plan.proportional
    assert len(plan.solves) == 2


def test_depth_does_nothing_where_tissue_slides_along_a_blade_in_a_slit():
    plan, found = dataset(SLIDES)
    assert len(plan.solves) == 1
    for name in ("force", "energy", "energy_release"):
        assert found[name][1] == found[name][0]
    assert plan.keys[0] == plan.keys[1]
