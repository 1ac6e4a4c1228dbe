"""Laws that take F to F_exact: constants that are there are found, and what is left out of a fit judges it."""

from math import inf, isnan

import numpy as np
import pytest

from epsmesh.report import accessor  # noqa: F401 (registers dataset.epsmesh)
from epsmesh.report.compliance import beyond
from epsmesh.report.figures import choose, figure
from epsmesh.report.guide import guide
from epsmesh.report.laws import LAWS, Forces, judge
from epsmesh.report.sinking import why_not
from epsmesh.report.study import DatasetError
from epsmesh.study.read import parse
from tests.cases import raw
from tests.report.chosen import dataset

TEXT = """
title = "discs"
[body]
shape = "cylinder"
radius = "40 mm"
height = ["20 mm", "30 mm"]
[material]
young = ["10 kPa", "20 kPa"]
poisson = 0.3
[probe]
shape = "disc"
radius = ["1 mm", "2 mm", "3 mm", "4 mm"]
depth = "0.1 mm"
[mesh]
outside = ["coarse", "free"]
epsilon = ["6 mm", "10 mm", "full"]
fine = "2 mm"
coarse = "8 mm"
"""
BALL = """
[[probe]]
name = "disc"
shape = "disc"
radius = "1 mm"
depth = "0.1 mm"
[[probe]]
name = "ball"
shape = "sphere"
radius = "9 mm"
depth = "0.2 mm"
"""
# What a column adds to the compliance (1/m), by ε, for a height of 20 mm.
ADDED = {6e-3: 90.0, 10e-3: 22.0}


def with_probe(probe):
    """Return the study with other probes."""
    return TEXT.split("[probe]", maxsplit=1)[0] + probe + "[mesh]" + TEXT.split("[mesh]")[1]


def exact_force(case):
    """Of a tool on a half-space, but for a constant: a disc's 2 E a d, and the 3/2 power of a ball's depth."""
    if case.probe.shape == "sphere":
        return 0.05 * case.material.young * case.probe.depth**1.5
    return 2 * case.material.young * case.probe.radius * case.probe.depth


def ratio(second=0.0):
    """Return F/F_exact if c, and ``second`` × c a² (1/m²), are added to the compliance."""

    def of(case):
        if case.is_full or case.mesh.outside == "coarse":
            return 1.0
        c = ADDED[case.mesh.epsilon] * (1.0 if case.body.height < 25e-3 else 1.5)
        if case.probe.shape == "disc":
            c *= 1 + second * case.probe.radius**2
        exact, scale, n = exact_force(case), case.material.young * case.probe.depth, case.probe.force_exponent
        force = exact
        for _ in range(200):  # the exact force at the depth that is left
            force = 0.5 * (force + exact * max(1 - c * force / scale, 0.0) ** n)
        return force / exact

    return of


def discs(text=TEXT, second=0.0, **options):
    return dataset(text, ratio=ratio(second), exact_force=exact_force, **options)


def of(probe):
    """Return the case of a scene with another probe."""
    (case,) = parse(raw() | {"probe": probe}).cases()
    return case


def free(found, epsilon):
    return next(v for v in found.verdicts if v.labels == {"outside": "free", "epsilon": epsilon})


@pytest.mark.parametrize(
    "text", [TEXT, TEXT.split("[probe]", maxsplit=1)[0] + BALL + "[mesh]" + TEXT.split("[mesh]")[1]]
)
def test_what_was_added_is_found_whatever_the_tool(text):
    data = discs(text)
    for against in ("exact", "full"):
        found = data.epsmesh.compliance(against)
        assert found["compliance"].dims == data["force"].dims
        assert found["compliance"].attrs["units"] == "m-1"
        for epsilon, c in ADDED.items():
            here = found["compliance"].sel(outside="free", epsilon=epsilon)
            np.testing.assert_allclose(here.sel(height=20e-3), c, rtol=1e-9)
            np.testing.assert_allclose(here.sel(height=30e-3), 1.5 * c, rtol=1e-9)
        np.testing.assert_allclose(found["compliance"].sel(outside="coarse"), 0.0, atol=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_bar_of_a_compliance_is_that_of_both_forces(exponent):
    whole, ratio, bars = 300.0, 0.8, (1e-6, 3e-7)
    c, bar = beyond(whole, ratio, exponent, *bars)
    worst = max(
        abs(beyond(whole / (1 + f), ratio * (1 + f) / (1 + e), exponent, 0, 0)[0] - c)
        for f in (-bars[0], bars[0]) for e in (-bars[1], bars[1])
    )  # fmt: skip
    assert bar == pytest.approx(worst, rel=1e-4)


def test_one_compliance_serves_all_tools_and_a_ratio_does_not():
    found = guide(discs(bar=0.002), "5%")
    ratio_law, one, _ = free(found, 6e-3).laws.laws
    assert (one.least, one.most) == pytest.approx((90.0, 135.0))
    assert one.others == pytest.approx(0.0, abs=1e-12)
    assert dict(one.carried)["probe_radius"] == pytest.approx(0.0, abs=1e-12)
    assert ratio_law.others > 0.2
    assert dict(one.carried)["height"] > 0.1  # c is the body's
    assert max(dict(law.carried)["young"] for law in (one, ratio_law)) == pytest.approx(0.0, abs=1e-12)
    assert free(found, 6e-3).laws.best is one
    # With what the bars of F and of F_exact (0.1 %) become: of F at a = 4 mm and twice the compliance of full order.
    whole, c = 1 / (2 * 4e-3) + 135.0, 135.0
    assert one.error == pytest.approx(whole / (whole - c) * 0.002 + 0.001)
    assert found.carried.labels == {"outside": "free", "epsilon": 6e-3}
    text = found.text(verbose=True)
    assert "ε = 6 mm, outside free, 1/F_exact ≈ 1/F - c/(E d), c = 90 … 135 1/m, depending on the tissue" in text
    assert "disc, bonded, 1 to 4 mm" in text
    row = found.to_dict()["carried"]
    assert row["laws"]["best"] == "compliance"
    assert row["laws"]["compliance"]["carried"]["height"] == dict(one.carried)["height"]


def test_a_term_of_second_order_is_used_where_it_is_worth_it():
    found = guide(discs(second=1e4), "5%")
    _, one, two = free(found, 6e-3).laws.laws
    assert two.others == pytest.approx(0.0, abs=1e-10)
    assert (two.least, two.most) == pytest.approx((90.0, 135.0))
    assert one.others > 0.02
    assert free(found, 6e-3).laws.best is two
    full = next(v for v in found.verdicts if v.labels["epsilon"] == inf)
    assert full.laws.best.name == "ratio"  # the simplest of those that are as good
    three = guide(discs(TEXT.replace(', "3 mm", "4 mm"]', "]"), second=1e4), "5%")
    assert isnan(free(three, 6e-3).laws.laws[2].others)  # one disc left to fit two constants to


@pytest.mark.parametrize("seed", range(5))
def test_left_out_fits_against_brute_force(seed):
    random = np.random.default_rng(seed)
    n = 24
    axes = {"probe": np.arange(n) % 4, "body": np.arange(n) // 4 % 3, "young": np.arange(n) // 12}
    exponent, square = random.choice([1.0, 1.5], n), (1e-3 * (1 + axes["probe"])) ** 2
    forces = Forces(
        random.uniform(0.6, 0.9, n), np.zeros(n), np.zeros(n), random.uniform(200, 400, n), exponent, square
    )
    found = judge(forces, axes, ("probe",), ())
    c = forces.whole * (1 - forces.ratio ** (1 / exponent))
    weight = exponent / (forces.whole - c)
    columns = {"ratio": [forces.ratio], "compliance": [weight], "second order": [weight, square * weight]}
    for law in found.laws:
        matrix, target = np.stack(columns[law.name], axis=1), 1 + 0 * c if law.name == "ratio" else c * weight
        worst = 0.0
        for i in range(n):
            others = [j for j in range(n) if axes["probe"][j] != axes["probe"][i]
                      and axes["body"][j] == axes["body"][i] and axes["young"][j] == axes["young"][i]]  # fmt: skip
            x = np.linalg.lstsq(matrix[others], target[others], rcond=None)[0]
            if law.name == "ratio":
                made = forces.ratio[i] * x[0]
            else:
                own = x[0] + (square[i] * x[1] if len(x) > 1 else 0.0)
                made = forces.ratio[i] * (forces.whole[i] / (forces.whole[i] - own)) ** exponent[i]
            worst = max(worst, abs(made - 1))
        assert law.others == pytest.approx(worst)
    assert [law.name for law in found.laws] == list(LAWS)


def test_scenes_in_which_compliances_do_not_add_have_none_and_say_why():
    ball = {"shape": "sphere", "radius": "6 mm", "depth": "0.1 mm"}
    wedge = {"shape": "wedge", "angle": "70 deg", "length": "6 mm", "depth": "0.1 mm"}
    cone = {"shape": "cone", "angle": "70 deg", "radius": "3 mm", "depth": "0.1 mm"}
    cut = {"shape": "blade", "length": "6 mm", "width": "1 mm", "depth": "0.1 mm", "slice": "0.1 mm"}
    slit = cut | {"slice": "0 mm", "incision": "3 mm"}
    assert not any(why_not(of(probe)) for probe in (ball, cone, cut))
    assert "wedge is not a power" in why_not(of(wedge))
    assert "rounded cone" in why_not(of(cone | {"tip": "0.1 mm"}))
    assert "slit" in why_not(of(slit))
    assert "no mirror plane" in why_not(of(cut | {"at": ["3 mm", "0 mm"]}))
    assert not why_not(of(cut | {"at": ["0 mm", "3 mm"]}))  # drawn along x, in the plane x = 0
    alone = '[probe]\nshape = "wedge"\nangle = "70 deg"\nlength = "6 mm"\ndepth = "0.1 mm"\n'
    with pytest.raises(DatasetError, match="compliances do not add: F of a wedge"):
        dataset(with_probe(alone)).epsmesh.compliance()
    with pytest.raises(DatasetError, match="no F_exact"):
        discs(exact=lambda case: False).epsmesh.compliance()
    with pytest.raises(DatasetError, match="no F_max"):
        discs(TEXT.replace(', "full"', "")).epsmesh.compliance("full")
    with pytest.raises(ValueError, match="against = 'half'"):
        discs().epsmesh.compliance("half")


def test_part_of_a_dataset_and_another_text():
    data = discs()
    part = data.sel(outside="free", epsilon=6e-3, height=20e-3).epsmesh.compliance()
    np.testing.assert_allclose(part["compliance"], 90.0)
    with pytest.raises(DatasetError, match="does not identify the scene"):
        data.assign_attrs(study="").epsmesh.compliance()
    assert "needs a study of several tools" in guide(data.isel(probe_radius=[0]), "5%").text(verbose=True)


def test_lines_of_the_figure_are_as_far_apart_as_the_compliances():
    data = discs()
    assert "compliance" in choose(data)
    assert "compliance" not in choose(data.isel(probe_radius=[0]))
    one = data.assign(force=data["force"].where(data["probe_radius"] == data["probe_radius"][0]))
    assert "compliance" not in choose(one)  # its axes would be empty
    drawn = figure(data, "compliance")
    columns = {ax.get_title(): ax for ax in drawn.axes}
    ax = columns["20 mm, outside free"] if "20 mm, outside free" in columns else drawn.axes[1]
    full, ten, six = (line for line in ax.get_lines() if line.get_linestyle() == "-" and line.get_marker() == "None")
    np.testing.assert_allclose(full.get_xdata(), [0.25, 1 / 3, 0.5, 1.0])
    np.testing.assert_allclose(ten.get_ydata() - full.get_ydata(), 22e-3, rtol=1e-9)
    np.testing.assert_allclose(six.get_ydata() - full.get_ydata(), 90e-3, rtol=1e-9)
    assert "1 / radius of the tool a" in drawn.axes[-1].get_xlabel()
