"""Other methods' error bars: on sequences and fields whose errors are known, and what the report counts."""

import copy
import itertools
import math
from functools import partial

import numpy as np
import pytest
from dolfinx import fem, mesh
from mpi4py import MPI

from benchmarks.bars import Row
from benchmarks.grids import Estimate, extrapolated, grid_convergence_index, median_interval, observed_order
from benchmarks.recovery import recovered_error
from benchmarks.rivals import METHODS, OURS, SIZES, draw, judged, lines, report, scaled, unfit, verdict
from epsmesh import compat
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.physics import MaterialLaw
from tests.isolated import isolated
from tests.pairs import BASE

LIMIT = 3.0


def values(order, change=0.2, sizes=SIZES):
    return [LIMIT + change * h**order for h in sizes]


@pytest.mark.parametrize("sizes", [SIZES, (1.0, 0.7, 0.4, 0.25)])
@pytest.mark.parametrize("order", [0.6, 1.0, 3.7])
def test_a_power_of_the_size_gives_its_order_and_its_limit(order, sizes):
    found = values(order, sizes=sizes)
    assert observed_order(found[1:], sizes[1:]) == pytest.approx(order)
    assert extrapolated(found[1:], sizes[1:]) == pytest.approx(LIMIT)
    finest = grid_convergence_index(found[1:], sizes[1:], 2, 4)
    assert finest == Estimate(found[-1], pytest.approx(1.25 * abs(found[-1] - LIMIT)))
    interval = median_interval(found, sizes)
    assert interval.value == pytest.approx(LIMIT) and interval.bar < 1e-9


def test_without_a_sensible_order_the_index_is_of_the_formal_one_and_three():
    two = grid_convergence_index([1.2, 1.1], [1.0, 0.5], 1, 2)
    assert two == Estimate(1.1, pytest.approx(0.3), is_regular=False)
    for first in (1.0, 1.3, 9.0):  # a turn; p = 0; p above the largest
        found = grid_convergence_index([first, 1.2, 1.1], [2.0, 1.0, 0.5], 1, 2)
        assert found == two, first
    assert math.isnan(observed_order([1.0, 1.2, 1.1], [2.0, 1.0, 0.5]))


def test_an_interval_is_as_wide_as_the_four_extrapolations_differ():
    found, noise = np.array(values(1.0)), np.array([0.0, 0.002, -0.001, 0.0005])
    (wide, narrow) = (median_interval(found + share * noise, SIZES) for share in (1.0, 0.1))
    assert 0 < 5 * narrow.bar < wide.bar
    triples = itertools.combinations(range(4), 3)  # the last one is of the three finest meshes
    four = [extrapolated((found + noise)[list(three)], np.take(SIZES, three)) for three in triples]
    middle = (sum(four) - min(four) - max(four)) / 2
    assert wide.value == pytest.approx(2 / 3 * four[-1] + middle / 3)
    assert wide.bar == pytest.approx(2 * 1.4826 * np.median(np.abs(np.array(four) - middle)))


def test_no_interval_where_the_finest_meshes_do_not_converge():
    assert median_interval([3.0, 2.0, 1.0, 1.1], SIZES) is None


def on_a_cube(count, field, law, share=1.0):
    """Return η² and U of a field on a cube, whose cells up to ``share`` of its height are of region 0."""
    body = mesh.create_unit_cube(MPI.COMM_SELF, count, count, count)
    displacement = fem.Function(vector_space(body, 1))
    displacement.interpolate(field)
    regions = np.ones(body.topology.index_map(3).size_local, np.int32)
    regions[mesh.locate_entities(body, 3, lambda x: x[2] < share + 1e-9)] = 0
    return recovered_error(displacement, law, compat.cell_tags(body, regions))


def linear(x):
    return np.array([0.1 * x[0] + 0.3 * x[1], -0.2 * x[2], 0.05 * x[1] - 0.1 * x[2]])


def curved(x):
    return np.array([np.sin(x[0]) * x[1], x[2] ** 2, x[0] * x[1]])


def test_a_uniform_stress_has_no_recovered_error_and_a_curved_field_one_that_falls_with_h():
    law = MaterialLaw.of_moduli(10e3, 0.3)
    squared, energy = on_a_cube(2, linear, law)
    assert squared < 1e-8 * energy
    # U = lambda/2 (tr e)^2 + mu e:e of the uniform strain, in a volume of 1.
    (lame_lambda,), (lame_mu,) = law.lame_lambda, law.lame_mu
    assert energy == pytest.approx(lame_mu * (0.1**2 + 0.1**2 + 2 * 0.15**2 + 2 * 0.075**2) + 0 * lame_lambda)
    (coarse, first), (fine, second) = (on_a_cube(count, curved, law) for count in (2, 4))
    assert 0.75 < math.log2(coarse / fine) / 2 < 1.6
    assert first == pytest.approx(second, rel=0.1)


def test_a_stress_that_jumps_where_materials_meet_is_no_error():
    stiff = MaterialLaw.of((1e4, 1e5), (1e4, 1e5))
    squared, energy = on_a_cube(2, linear, stiff, share=0.5)
    assert squared < 1e-8 * energy


def known(error, bar=0.1, **more):
    numbers = {"force": 1.0 + error, "bar": bar, "degree": 2, "truth": 1.0, "truth's bar": 0.01}
    return numbers | {"cost": 2.0, "solve": 1.0} | more


def row(error, seed=0, **more):
    classes = {"way": "bonded", "mesh": "graded", "order": "2"}
    return Row(seed, "judged", classes, raw=known(error, **more))


def test_a_bar_holds_if_the_error_is_below_it_and_is_undecided_if_the_truth_is_too_uncertain():
    found = [verdict(OURS, known(error)) for error in (0.05, -0.05, 0.095, 0.105, 0.2)]
    assert [one.holds for one in found] == [True, True, True, False, False]
    assert [one.is_undecided for one in found] == [False, False, True, True, False]
    assert found[0].ratio == pytest.approx(2.0) and found[0].cost == 1.0


def test_methods_count_the_scenes_where_they_give_a_bar(tmp_path):
    meshes = {f"force {place}": force for place, force in enumerate((1.4, 1.2, 1.1))}
    meshes |= {f"solve {place}": 0.5 for place in range(3)}
    more = {"force more": 1.02, "solve more": 3.0}
    rows = [row(0.05), row(0.05, 1, **meshes), row(0.03, 2, **more, recovered=0.04, **{"solve recovered": 0.2})]
    rows.append(Row(3, "not static", {"mesh": "graded"}))
    found = {line["method"]: line for line in lines(rows[:3])}
    assert {name: line["scenes"] for name, line in found.items()} == {
        "this program": 3, "GCI, 3 meshes": 1, "GCI, 2 meshes": 1, "Krysl, 4 meshes": 1, "Krysl, on F": 1,
        "Zienkiewicz-Zhu": 1, "one degree more": 1,
    }  # fmt: skip
    assert found["one degree more"]["held"] == 0 and found["one degree more"]["cost"] == 2.0
    # eta^2 / (2U) is a share of F: 0.04 of 1.03, for an error of 0.03.
    assert found["Zienkiewicz-Zhu"]["bar / error"] == pytest.approx(0.04 * 1.03 / 0.03)
    assert found["Zienkiewicz-Zhu"]["cost"] == pytest.approx(0.6)
    # Of 1.2, 1.1, 1.05 the order is 2: with sizes times sqrt(2), the limit is 1.
    assert found["GCI, 3 meshes"]["bar / error"] == pytest.approx(1.25) and found["GCI, 3 meshes"]["cost"] == 1.0
    text = report(rows)
    assert "3 scenes of 4 drawn. Left out: 1 (not static)." in text
    assert "| way: bonded | 3 | 3 of 3; 2.0 |" in text
    draw(rows, tmp_path / "rivals.png")
    assert (tmp_path / "rivals.png").stat().st_size > 10_000


def test_all_sizes_are_scaled_and_scenes_that_have_none_are_left_out():
    half = scaled(BASE, 0.5)["mesh"]
    assert half == BASE["mesh"] | {"fine": "1.5 mm", "coarse": "4 mm", "rim": "0.5 mm", "growth": 0.4}
    assert scaled(BASE, 4)["mesh"]["growth"] == 2.0
    assert unfit(BASE, {}) == ""
    assert unfit(BASE | {"mesh": {"accuracy": "1 %"}}, {}) == "meshes by accuracy"
    assert unfit(BASE, {"history": "history"}) == "not static"
    assert unfit(BASE | {"probe": {"force": "5 mN"}}, {}) == "its force is given"


@pytest.mark.nightly
def test_a_scene_has_an_estimate_of_every_method(tmp_path):
    """In a process of its own, since the processor's time is limited there."""
    classes = {"mesh": "graded", "order": "2"}
    ((_, found),) = isolated(judged, [(0, tmp_path, partial(_base, classes))])
    assert found.result == "judged" and found.classes["way"] == "bonded"
    verdicts = {method.name: verdict(method, found.raw) for method in METHODS}
    assert verdicts["this program"].holds and verdicts["this program"].cost == 1.0
    assert all(0.1 < one.ratio < 100 and one.cost > 0.5 for one in verdicts.values() if one)
    assert {name for name, one in verdicts.items() if one} >= {"Zienkiewicz-Zhu", "one degree more", "GCI, 3 meshes"}
    # Coarser elements give a larger force, and one degree more a smaller one.
    assert found.raw["force 0"] > found.raw["force"] > found.raw["force more"] > found.raw["truth"]


def _base(classes, seed, folder):
    return copy.deepcopy(BASE), dict(classes)
