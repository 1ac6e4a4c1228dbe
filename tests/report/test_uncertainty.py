"""Error bars of F side by side, and which of them is said to decide."""

import re

import numpy as np
import pytest

from epsmesh.report.guide import guide
from epsmesh.report.page import render
from epsmesh.report.uncertainty import IMAGE, NAME, SPREAD, bars, next_step, unknowns
from tests.report.synthetic import dataset

EPSILON = {"mesh": {"epsilon": ["4 mm", "10 mm", "full"]}}
SAID = {
    "force_error": "The mesh decides: refine it before you measure more.",
    NAME: "The tissue's parameters decide: measure young, poisson more exactly.",
    SPREAD: "The tissue's spread decides: measure the stiffness from place to place within 6.2 mm of the point of "
    "contact, where half of F is decided.",
    IMAGE: "The image decides: find the boundary more exactly.",
}
COMMENTS = {NAME: "young, poisson from one.nc", SPREAD: "tissue ± 30 % over 5 mm", IMAGE: "boundary ± 1 mm"}


def with_bars(*names, largest="", **changes):
    """Return a dataset with bars of these names, of 1 % of F; the largest has 7 % in one of its cases."""
    found = dataset(**changes)
    force, radii = found["force"], ("decided", [2e-3, 6.2e-3, 20e-3])
    found = found.assign(influence_radius=radii, influence_radius_error=radii)
    found = found.assign_coords(decided=[0.1, 0.5, 0.9])
    for name in ("force_error", *names):
        shares = np.full(force.shape, 0.01)
        shares[(0,) * force.ndim] = 0.07 if name == largest else 0.01
        found[name] = (shares * force).assign_attrs(comment=COMMENTS.get(name, "a note on meshes"))
    return found


@pytest.mark.parametrize("largest", SAID)
def test_the_largest_bar_says_what_comes_next(largest):
    found = with_bars(NAME, SPREAD, IMAGE, largest=largest, **EPSILON)
    said = unknowns(found)
    assert said.endswith(SAID[largest])
    assert said.count("± 7 %") == 1 and said.count("± 1 %") == 3
    assert all(f"({comment})" in said for comment in COMMENTS.values())


def test_page_and_guide_have_the_bars_and_the_sentence():
    found = with_bars(NAME, SPREAD, largest=SPREAD, **EPSILON)
    page = render(found, "one").replace("&#39;", "'")
    assert SAID[SPREAD] in page
    rows = re.findall("<tr><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td></tr>", page)
    assert ("mesh", "± 1 %", "") in rows
    assert ("tissue's parameters", "± 1 %", COMMENTS[NAME]) in rows
    assert ("tissue's spread", "± 7 %", COMMENTS[SPREAD]) in rows
    assert SAID[SPREAD] in guide(found, "5 %").text()


def test_one_bar_is_compared_with_nothing():
    found = dataset(**EPSILON)
    assert [one.cause for one in bars(found)] == ["mesh"]
    assert unknowns(found) == next_step(bars(found)) == ""
    assert "error bar of F by" not in render(found, "one")


def test_a_bar_that_is_not_computed_is_not_the_largest():
    found = with_bars(SPREAD, largest=SPREAD)
    found[SPREAD] = found[SPREAD] * np.nan
    assert "tissue's spread not computed" in unknowns(found)
    assert next_step(bars(found)) == ""


def test_without_a_distance_the_place_is_left_out():
    found = with_bars(SPREAD, largest=SPREAD).drop_vars("influence_radius")
    assert next_step(bars(found)) == "The tissue's spread decides: measure the stiffness from place to place."
