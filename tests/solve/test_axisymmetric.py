"""Mechanics of the axisymmetric solver: closed forms, published tables, limits, invariances, its error bar."""

from itertools import product
from math import inf, pi

import numpy as np
import pytest

from epsmesh.mesh.meridian import Grading, Meridian
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import compiling
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.meridian.problem import MeridianProblem, compile_axisymmetric
from epsmesh.solve.movement import Motion, Movement
from epsmesh.solve.physics import MaterialLaw, Parameters
from tests.sampling import sampled
from tests.verification import known


@pytest.fixture(autouse=True, scope="module")
def _forms():
    with compiling():
        for degree in (4, 5):
            compile_axisymmetric(degree)


def solve_axisymmetric(meridian, poisson, bonded, *, young=1.0, depth=1.0, **options):
    return solve_layers(meridian, [(young, poisson)], bonded, depth=depth, **options)


def solve_layers(meridian, moduli, bonded, *, depth=1.0, **options):
    """Solve for the moduli (E, ν) of each region."""
    law = MaterialLaw(tuple(Parameters.of_moduli(*each) for each in moduli))
    with MeridianProblem(meridian, Conditions(bonded), **options) as problem:
        return problem.solve(law, Movement.along((0.0, 0.0, -depth)))


@sampled("bonded, poisson", product((True, False), (0.0, 0.3, 0.45, 0.49, 0.4999, 0.5)), by_day=3)
def test_half_space(bonded, poisson):
    """In a body a million times as wide as the disc, F is that of a half-space (closed forms), to 1e-6."""
    exact, _ = known.half_space_disc(1.0, poisson, 1.0, 1.0, "bonded" if bonded else "frictionless")
    assert solve_axisymmetric(Meridian(1e6, 1e6, 1), poisson, bonded).reaction[2] == pytest.approx(exact, rel=3e-6)


def test_element_does_not_depend_on_youngs_modulus():
    """F/E does not depend on the unit of E, also at the Poisson's ratio from which elements are mixed."""
    meridian = Meridian(20.0, 10.0, 1.0)
    moduli = (1.0, 23.0, 820000.0)  # rounding makes the ratio of the last two slightly less than 0.49
    found = [solve_axisymmetric(meridian, 0.49, True, young=young) for young in moduli]
    assert len({solution.dofs for solution in found}) == 1
    ratios = [solution.reaction[2] / young for solution, young in zip(found, moduli, strict=True)]
    assert ratios == pytest.approx([ratios[0]] * len(ratios), rel=1e-10)


@pytest.mark.parametrize("column", [inf, 1.0])
@pytest.mark.parametrize("bonded", [True, False])
def test_uniaxial_compression(bonded, column):
    """Without lateral contraction, tissue wholly under a probe is in uniform strain: F = E A d/H."""
    meridian = Meridian(1 if column == inf else 9, 2, 3, column=column)
    solution = solve_axisymmetric(meridian, 0.0, bonded)
    assert solution.reaction[2] == pytest.approx(pi / 2, rel=1e-10)
    assert solution.energy == pytest.approx(pi / 4, rel=1e-10)
    assert solution.max_strain == pytest.approx(0.5, rel=1e-8)


@pytest.mark.parametrize(("bonded", "factor"), [pytest.param(True, 1.0, marks=pytest.mark.nightly), (False, 0.25)])
def test_incompressible_thin_layer(bonded, factor):
    """An incompressible layer is squeezed out: F = 3π μ a⁴ d/(2 h³) between rough faces, a quarter with one smooth."""
    h, mu = 1e-3, 1 / 3
    force = solve_axisymmetric(Meridian(300, h, 1), 0.5, bonded).reaction[2]
    assert force == pytest.approx(factor * 1.5 * pi * mu / h**3, rel=8 * h)


def test_clamped_thin_plate():
    """A sheet with fixed sides bends: F = 16π D d/R², D = E h³/(12(1 - ν²)), up to the shear under a small disc."""
    h, radius, nu = 1.0, 300.0, 0.3
    force = solve_axisymmetric(Meridian(radius, h, 1, "sides"), nu, True).reaction[2]
    assert force == pytest.approx(16 * pi * h**3 / (12 * (1 - nu**2)) / radius**2, rel=1e-3)


@pytest.mark.parametrize(
    ("meridian", "bonded"),
    [(Meridian(5, 3, 1), False), pytest.param(Meridian(9, 2, 1, column=2), True, marks=pytest.mark.nightly)],
)
def test_incompressible_is_the_limit(meridian, bonded):
    limit = solve_axisymmetric(meridian, 0.5, bonded).reaction[2]
    gaps = [solve_axisymmetric(meridian, 0.5 - x, bonded).reaction[2] / limit - 1 for x in (1e-4, 1e-5)]
    assert gaps[0] < 0
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=0.05)


def test_displacement_and_mixed_elements_agree(monkeypatch):
    meridian = Meridian(4, 3, 1, -1.0)
    forces = []
    for threshold in (0.3, 0.5):
        monkeypatch.setattr("epsmesh.solve.meridian.region.MIXED_FROM", threshold)
        forces.append(solve_axisymmetric(meridian, 0.4, True).reaction[2])
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)


@pytest.mark.parametrize(("unit", "young"), [(1e-3, 1e12), pytest.param(1 / 3, 1e-3, marks=pytest.mark.nightly)])
def test_units_do_not_matter(unit, young):
    here, there = (
        solve_axisymmetric(Meridian(5 * u, 3 * u, 0.7 * u, -1.1 * u), 0.45, True, young=e, depth=0.1 * u)
        for u, e in ((1.0, 1.0), (unit, young))
    )
    assert there.reaction[2] == pytest.approx(young * unit**2 * here.reaction[2], rel=1e-12)
    assert there.energy == pytest.approx(young * unit**3 * here.energy, rel=1e-12)
    assert there.max_strain == pytest.approx(here.max_strain, rel=1e-9)
    assert there.dofs == here.dofs


def test_more_support_is_stiffer():
    """A larger support can only raise F; so can keeping more of the body."""

    def force(**change):
        return solve_axisymmetric(Meridian(3, 2, 1, **change), 0.45, False).reaction[2]

    held = [force(fixed=f) for f in (-2.0, -0.1, 0.0)]
    assert held == sorted(held)
    assert held[0] == pytest.approx(force(), rel=1e-12)
    assert held[-1] == pytest.approx(force(fixed="bottom+sides"), rel=1e-12)
    kept = [force(column=c) for c in (1.1, 2.0)]
    assert kept == sorted(kept)
    assert force(column=2.0, column_fixed=True) > kept[-1] > force(fixed="sides")


@sampled("seed", range(6), by_day=2)
def test_error_bar_holds_the_truth(seed, monkeypatch):
    """The bar of a coarse mesh covers the result of a fine one of higher degree."""
    random = np.random.default_rng(seed)
    radius, height = (float(np.exp(random.uniform(*np.log(ends)))) for ends in ((1.05, 300), (0.1, 100)))
    support = [-height * random.uniform(0.05, 1), "bottom", "sides", "bottom+sides"][seed % 4]
    meridian, poisson = Meridian(radius, height, 1, support), [0.0, 0.3, 0.45, 0.49, 0.4999, 0.5][seed]
    exact = solve_axisymmetric(meridian, poisson, seed % 2 == 0)
    monkeypatch.setattr("epsmesh.solve.meridian.problem.GRADINGS", (Grading(1e-4, 1.4, 4.0),))
    rough = solve_axisymmetric(meridian, poisson, seed % 2 == 0, degree=4)
    assert exact.bar < rough.bar
    assert rough.reaction[2] == pytest.approx(exact.reaction[2], rel=rough.bar + exact.bar)


@pytest.mark.parametrize("poisson", [pytest.param(0.3, marks=pytest.mark.nightly), 0.5])
def test_layers_of_one_material_change_nothing(poisson):
    layered = solve_layers(Meridian(5, 4, 1, interfaces=(-0.3, -1.7)), [(2.0, poisson)] * 3, True)
    assert layered.reaction[2] == pytest.approx(
        solve_axisymmetric(Meridian(5, 4, 1), poisson, True, young=2.0).reaction[2], rel=1e-7
    )


def test_layers_under_a_wide_punch_are_springs_in_series():
    """Without lateral contraction, compliances of layers that a probe covers add: F = d / Σ h/(E A)."""
    meridian = Meridian(1, 3, 2, interfaces=(-0.5, -2.0), is_filled=True)
    solution = solve_layers(meridian, [(1e9, 0.3), (2.0, 0.0), (100.0, 0.0), (0.5, 0.0)], True)
    assert solution.reaction[2] == pytest.approx(pi / (0.5 / 2 + 1.5 / 100 + 1 / 0.5), rel=1e-10)


def test_soft_layer_on_a_rigid_one_is_a_layer_on_a_rigid_base():
    alone = solve_axisymmetric(Meridian(20, 1, 1), 0.45, False).reaction[2]
    ratios = [1e4, 1e5]
    on = [
        solve_layers(Meridian(20, 2, 1, interfaces=(-1.0,)), [(r, 0.3), (1.0, 0.45)], False).reaction[2] for r in ratios
    ]
    gaps = [force / alone - 1 for force in on]
    assert -1e-3 < gaps[0] < 0
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=0.05)


LAYERED = [
    (Meridian(10, 8, 1, interfaces=(-0.7, -2.0)), [(0.3, 0.3), (1.0, 0.45), (60.0, 0.48)]),
    (Meridian(6, 4, 1, interfaces=(-1.0,)), [(1.0, 0.3), (5.0, 0.49)]),
    (Meridian(6, 4, 1, interfaces=(-1.0,)), [(1.0, 0.0), (1.0, 0.5)]),
    (Meridian(4, 3, 1, "sides", interfaces=(-1.0, -2.0)), [(1e3, 0.3), (1.0, 0.45), (0.1, 0.5)]),
    (Meridian(1.3, 3, 1, interfaces=(-0.2, -1.0)), [(1e3, 0.3), (1.0, 0.45), (0.1, 0.49)]),
    (Meridian(30, 20, 1, interfaces=(-0.02,)), [(1.0, 0.45), (100.0, 0.49)]),
    (Meridian(3, 3, 1, -1.0, interfaces=(-1.0,)), [(10.0, 0.45), (1.0, 0.3)]),
    (Meridian(9, 3, 1, column=2.0, interfaces=(-1.0,)), [(10.0, 0.45), (1.0, 0.3)]),
]


@sampled("number", range(len(LAYERED)), by_day=3)
def test_error_bar_of_layers_holds_the_truth(number, monkeypatch):
    """The bar of a coarse mesh covers the result of a fine one of higher degree, which has a bar of 1e-5."""
    meridian, moduli = LAYERED[number]
    exact = solve_layers(meridian, moduli, number % 2 == 0)
    assert exact.bar < 1e-5
    monkeypatch.setattr("epsmesh.solve.meridian.problem.GRADINGS", (Grading(1e-4, 1.4, 4.0),))
    rough = solve_layers(meridian, moduli, number % 2 == 0, degree=4)
    assert exact.bar < rough.bar < 1e-2
    assert rough.reaction[2] == pytest.approx(exact.reaction[2], rel=rough.bar + exact.bar)


def test_regions_of_the_mesh_are_the_layers():
    arrays = Meridian(7.3, 2.1, 0.9, -1.3, interfaces=(-0.2, -1.31)).mesh(Grading())
    corners = arrays.points[arrays.cells] * arrays.unit
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    sizes = [area[arrays.regions == n].sum() for n in range(3)]
    assert sizes == pytest.approx([7.3 * (2.1 - 1.31), 7.3 * 0.2, 7.3 * 1.11], rel=1e-10)
    heights = [corners[arrays.regions == n][..., 1] for n in range(3)]
    assert [float(z.max()) for z in heights] == pytest.approx([-1.31, 0.0, -0.2], rel=1e-10)


def test_mesh_is_repeatable_and_exact():
    meridian = Meridian(7.3, 2.1, 0.9, -1.3)
    first, second = (meridian.mesh(Grading()) for _ in range(2))
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.cells, second.cells)
    corners = first.points[first.cells]
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    assert area.min() > 0
    assert area.sum() == pytest.approx(7.3 * 2.1 / 0.9**2, rel=1e-10)  # lengths have 12 digits
    probe = first.points[first.facets["probe"]]
    assert np.all(probe[..., 1] == 0)
    assert probe[..., 0].max() == 1


@pytest.mark.parametrize(
    ("meridian", "message"),
    [
        (Meridian(1, 2, 1, "sides"), "covers the top"),
        (Meridian(5, 2, 1, column=0.8, column_fixed=True), "covers the top"),
        (Meridian(5, 2, 1, "sides", column=2.0), "float"),
        (Meridian(5, 2, 1, -2.5), "float"),
    ],
)
def test_impossible_scenes_are_refused(meridian, message):
    with pytest.raises(SolveError, match=message):
        solve_axisymmetric(meridian, 0.5, True)


@pytest.mark.parametrize("motion", [Motion((1.0, 0.0, 0.0)), Motion(rotation=(0.0, 0.0, 1.0))])
def test_other_movements_are_refused(motion):
    with pytest.raises(SolveError, match="along its axis"):
        MeridianProblem(Meridian(5, 2, 1), Conditions()).solve(MaterialLaw.of(1.0, 1.0), Movement((motion,), (1.0,)))
