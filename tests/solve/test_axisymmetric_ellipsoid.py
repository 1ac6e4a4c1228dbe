"""Mechanics of ellipsoids under a disc on their pole: limits, invariances, agreement of elements, error bar."""

from math import pi

import numpy as np
import pytest

from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import compiling
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.meridian.problem import MeridianProblem, compile_axisymmetric
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from tests.sampling import sampled
from tests.verification import known

SCENES = {
    "ball": EllipticMeridian(10, 10, 1, -2),
    "slender": EllipticMeridian(3, 9, 1, -2),
    "flat": EllipticMeridian(9, 3, 1, 1),
    "wide footprint": EllipticMeridian(2, 2, 1, 0),
    "held at the very bottom": EllipticMeridian(5, 4, 1, -3.9),
    "held beside the footprint": EllipticMeridian(4, 3, 1, 2.5),
}


@pytest.fixture(autouse=True, scope="module")
def _forms():
    with compiling():
        for degree in (4, 5):
            compile_axisymmetric(degree, curved=True)


def solve(meridian, poisson, bonded, *, young=1.0, depth=1.0, **options):
    with MeridianProblem(meridian, Conditions(bonded), **options) as problem:
        return problem.solve(MaterialLaw.of_moduli(young, poisson), Movement.along((0.0, 0.0, -depth)))


@pytest.mark.parametrize(("bonded", "poisson"), [(True, 0.3), pytest.param(False, 0.5, marks=pytest.mark.nightly)])
def test_half_space(bonded, poisson):
    """A disc on a ball a million times as large is a disc on a half-space."""
    exact, _ = known.half_space_disc(1.0, poisson, 1.0, 1.0, "bonded" if bonded else "frictionless")
    found = solve(EllipticMeridian(1e6, 1e6, 1, 0), poisson, bonded)
    assert found.reaction[2] == pytest.approx(exact, rel=5e-6)
    assert found.bar < 1e-5


@sampled("name, bonded, poisson", [(name, *of) for name in SCENES for of in ((True, 0.3), (False, 0.5))], by_day=1)
def test_error_bar_holds_the_truth(name, bonded, poisson, monkeypatch):
    """The bar of a coarse mesh covers the result of a fine one of higher degree, which has a bar of 1e-5."""
    exact = solve(SCENES[name], poisson, bonded)
    assert exact.bar < 1e-5
    assert exact.balance < 1e-9
    monkeypatch.setattr("epsmesh.solve.meridian.problem.GRADINGS", (Grading(1e-4, 1.4, 4.0),))
    rough = solve(SCENES[name], poisson, bonded, degree=4)
    assert rough.reaction[2] == pytest.approx(exact.reaction[2], rel=rough.bar + exact.bar)


def test_arcs_are_followed_closely_enough(monkeypatch):
    """Triangles with half of the angle give the same F."""
    before = solve(SCENES["slender"], 0.3, False).reaction[2]
    monkeypatch.setattr("epsmesh.mesh.elliptic_meridian._WIDEST", pi / 12)
    assert solve(SCENES["slender"], 0.3, False).reaction[2] == pytest.approx(before, rel=1e-7)


def test_mesh_is_repeatable_and_follows_the_surface():
    meridian = EllipticMeridian(7.3, 2.1, 0.9, -1.3)
    first, second = (meridian.mesh(Grading()) for _ in range(2))
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.cells, second.cells)
    points = first.points * first.unit
    surface = points[np.unique(np.vstack([first.facets[name] for name in ("probe", "free", "fixed")]))]
    assert np.abs((surface[:, 0] / 7.3) ** 2 + (surface[:, 1] / 2.1 + 1) ** 2 - 1).max() < 1e-10
    corners = points[first.cells[:, :3]]
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    assert area.min() > 0
    assert 0.98 < area.sum() / (pi * 7.3 * 2.1 / 2) < 1
    probe, fixed = points[first.facets["probe"]], points[first.facets["fixed"]]
    assert probe[..., 0].max() == pytest.approx(0.9, rel=1e-12)
    assert fixed[..., 1].max() == pytest.approx(-1.3 - 2.1, rel=1e-11)
    assert np.all(points[first.facets["axis"]][..., 0] == 0)


@pytest.mark.parametrize(
    ("level", "message"), [(2.95, "covers the top"), (-3.0, "float"), (-4.0, "float")]
)  # fmt: skip
def test_impossible_scenes_are_refused(level, message):
    with pytest.raises(SolveError, match=message):
        solve(EllipticMeridian(4, 3, 1, level), 0.5, True)


def test_a_probe_as_wide_as_the_body_is_refused():
    with pytest.raises(ValueError, match="covers all"):
        EllipticMeridian(4, 3, 4, 0)
