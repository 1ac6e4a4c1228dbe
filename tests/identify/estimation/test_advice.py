"""What a fit says of the test to make next."""

import re
from dataclasses import replace

import pytest

from epsmesh.study.read import read_mapping
from epsmesh_identify.estimation.advice import advice
from epsmesh_identify.estimation.estimate import identify
from tests.identify.estimation.synthetic import POISSON, YOUNG
from tests.identify.estimation.test_seen import punches

PAD = {
    "body": {"shape": "cylinder", "radius": "100 mm", "height": "10 mm", "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.4},
    "probe": {"shape": "disc", "radius": "1 mm", "contact": "frictionless"},
    "measurement": [{"name": "narrow", "file": "narrow.csv", "baseline": "level"}],
    "identify": {"young": ["1 kPa", "1 MPa"], "poisson": [0.2, 0.5]},
}


def study(**probe):
    """Return the study of a punch on a pad, with other keys of the probe."""
    return read_mapping(PAD | {"probe": PAD["probe"] | probe}, "pad")


@pytest.fixture(scope="module")
def one():
    """The fit of one narrow punch."""
    return identify(punches("narrow"), [YOUNG, POISSON])


def test_a_wide_punch_is_proposed_where_a_narrow_one_does_not_see_poissons_ratio(one):
    (sentence,) = advice(study(), one)
    found = re.fullmatch(r"A further punch of radius 3\.00 mm would give ν ± (0\.\d+)\.", sentence)
    assert found
    assert float(found[1]) < 0.1


def test_there_is_no_advice_where_all_is_seen_nothing_fits_or_the_scene_needs_solves(one):
    assert advice(study(contact="bonded"), one) == ()
    assert advice(study(), replace(one, verdict="does not fit")) == ()
    both = identify(punches("narrow", "wide"), [YOUNG, POISSON])  # a/h = 0.1 and 1
    assert both.seen[:2].all() and both.low[1] <= 0.45 <= both.high[1] < both.low[1] + 0.1
    assert advice(study(), both) == ()
