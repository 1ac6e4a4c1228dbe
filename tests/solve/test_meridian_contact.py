"""Unilateral contact of axisymmetric scenes: closed forms, work, and contact that is not one round patch."""

from math import log, pi, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Meridian
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.scene.model import PROBE
from epsmesh.shapes.rounded import Rounded
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import compiling
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.meridian.contact import MeridianContact
from epsmesh.solve.meridian.problem import DEGREE, MeridianProblem, compile_axisymmetric
from epsmesh.solve.meridian.punch import TRIAL_DEGREE, RoundTool
from epsmesh.solve.meridian.signs import LiftsOff, check_signs
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from tests.cases import study
from tests.verification.known import half_space_contact

LAW = MaterialLaw.of(0.3 / 1.3 / 0.4, 0.5 / 1.3)  # E = 1, ν = 0.3


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    with compiling():
        compile_axisymmetric(lowest=TRIAL_DEGREE)
        compile_axisymmetric(4, curved=True)


def pressed(tool, depth, meridian, law=LAW, degree=DEGREE):
    return MeridianContact(meridian, tool, degree=degree).solve(law, Movement.along((0.0, 0.0, -depth)))


def flat(radius):
    return RoundTool(np.zeros_like, radius)


def test_a_flat_tool_wider_than_a_column_covers_it():
    """Tissue that cannot lift off is pressed as by a frictionless tool of the same depth."""
    column = Meridian(12.0, 6.0, 3.0, column=2.0)
    found = pressed(flat(3.0), 0.1, column)
    known = MeridianProblem(column, Conditions(bonded=False)).solve(LAW, Movement.along((0.0, 0.0, -0.1)))
    assert found.response.stiffness == pytest.approx(known.response.stiffness, rel=1e-9)
    assert found.contact.area == pytest.approx(4 * pi, rel=1e-12)
    with pytest.raises(SolveError, match="edge of the modelled part"):
        pressed(RoundTool(Rounded(0.0, 200.0).height, 200.0), 0.1, column)


@pytest.mark.parametrize(
    ("section", "kinks", "depth"),
    [(Rounded(0.0, 8.0), (), 1 / 8), (Rounded(pi / 3), (0.0,), 0.9)],
    ids=["ball", "cone"],
)
def test_force_and_depth_on_a_deep_body_are_those_of_the_half_space(section, kinks, depth):
    """F at a given radius hardly depends on the body's size, since singular stresses at the edge dominate. The depth
    does: the surface of a body of 200 radii sinks less by c F, with c about 0.4 % of 1 / (2 E* a).
    """
    found = pressed(RoundTool(section.height, 20.0 if kinks else 8.0, kinks), depth, Meridian(200.0, 200.0, 1.0))
    exact = half_space_contact(1.0, 0.3, section.slope, found.contact.radius)
    assert found.reaction[2] == pytest.approx(exact, rel=1e-6)
    assert found.bar < 1e-5
    assert found.contact.area == pytest.approx(pi * found.contact.radius**2)
    assert found.contact.radius == pytest.approx(section.contact_radius(depth), rel=5e-3)
    closed = half_space_contact(1.0, 0.3, section.slope, section.contact_radius(depth))
    assert found.reaction[2] / closed - 1 == pytest.approx(3.97e-3, rel=0.02)
    assert found.iterations <= 6


def test_a_flat_disc_touches_with_all_of_its_face():
    """It agrees with the prescribed footprint, and has the same bar: nothing lifts off."""
    meridian, depth = Meridian(50.0, 50.0, 3.0), 0.5
    found = pressed(flat(3.0), depth, meridian)
    known = MeridianProblem(meridian, Conditions(bonded=False)).solve(LAW, Movement.along((0.0, 0.0, -depth)))
    assert found.reaction[2] == pytest.approx(known.reaction[2], rel=1e-9)
    assert found.energy == pytest.approx(known.energy, rel=1e-9)
    assert found.contact.radius == 3.0


def test_a_thin_layer_is_touched_as_far_as_it_is_pressed_down():
    """On a layer much thinner than the contact, a ball touches up to its intersection with the surface."""
    ball, depth = Rounded(0.0, 200.0), 0.005
    found = pressed(RoundTool(ball.height, 200.0), depth, Meridian(20.0, 0.04, 1.0), MaterialLaw.of(0.0, 0.5))
    assert found.contact.radius == pytest.approx(sqrt(2 * 200.0 * depth), rel=0.01)
    assert found.reaction[2] == pytest.approx(pi * 200.0 * depth**2 / 0.04, rel=0.03)  # springs of E / H, ν = 0


@pytest.mark.nightly
def test_the_work_of_the_force_is_the_energy():
    """Between depths dU = F dd, on an ellipsoid: force, radius and energy are consistent."""
    section, semi_height, radius = Rounded(pi / 2.4, 0.5), 25.0, 40.0

    def gap(r):
        return section.height(r) + semi_height * (1 - np.sqrt(1 - (r / radius) ** 2))

    tool, body = RoundTool(gap, 20.0, (section.tangent,)), EllipticMeridian(radius, semi_height, 1.0, -5.0)
    first, middle, last = (pressed(tool, depth, body, degree=4) for depth in (0.4, 0.5, 0.6))
    work = 0.2 / 6 * sum(w * s.reaction[2] for w, s in zip((1, 4, 1), (first, middle, last), strict=True))
    assert last.energy - first.energy == pytest.approx(work, rel=1e-4)
    power = log(last.reaction[2] / first.reaction[2]) / log(1.5)
    assert 1.4 < power < 2.1
    assert middle.energy < middle.reaction[2] * 0.5 / 2


def test_a_disc_on_a_stiff_skin_lifts_off_in_a_ring():
    """It presses at its edge and its centre. A prescribed face would have tension between, and take more force. A
    smooth tool has no such edge. In three dimensions F is 2.087 with a bar of 0.95 %, the area 16.7.
    """
    skin, depth = Meridian(30.0, 20.0, 5.0, interfaces=(-1.0,)), 0.1
    stiff = MaterialLaw.of(0.3 / 1.3 / 0.4 * 30, 0.5 / 1.3 * 30)
    law = MaterialLaw.of(LAW.lame_lambda + stiff.lame_lambda, LAW.lame_mu + stiff.lame_mu)
    press = Movement.along((0.0, 0.0, -depth))
    found = MeridianContact(skin, flat(5.0), degree=4, accuracy=1e-3).solve(law, press)
    assert found.reaction[2] == pytest.approx(2.07474, rel=1e-4)
    assert found.contact.area == pytest.approx(16.17, rel=1e-2)
    assert found.contact.radius == pytest.approx(sqrt(found.contact.area / pi))
    assert found.energy == pytest.approx(found.reaction[2] * depth / 2, rel=1e-9)  # flat on flat: F goes like the depth
    assert found.reaction[2] < MeridianProblem(skin, Conditions(bonded=False)).solve(law, press).reaction[2]


def test_contact_as_wide_as_the_body_is_refused():
    with pytest.raises(SolveError, match="edge of the modelled part"):
        pressed(RoundTool(Rounded(0.0, 500.0).height, 500.0), 0.5, Meridian(5.0, 5.0, 1.0))


def test_a_round_study_has_area_and_radius_of_contact():
    """With two moduli and two depths: F is proportional to the modulus, the radius does not depend on it."""
    found = study(
        body={"shape": "cylinder", "radius": "30 mm", "height": "20 mm", "size": None},
        material={"young": ["10 kPa", "20 kPa"]}, solve={"exact": False}, plan={"without": []},
        probe={"shape": "sphere", "radius": "8 mm", "depth": "0.2 mm", "contact": "unilateral"},
        mesh={"accuracy": "1 %", "epsilon": None, "fine": None, "coarse": None, "rim": None, "growth": None,
              "degree": None},
    )  # fmt: skip
    plan = make_plan(found)
    from mpi4py import MPI

    dataset = build(plan, compute(plan, MPI.COMM_SELF))
    assert list(dataset["status"].values) == ["ok", "ok"]
    assert set(dataset["origin"].values) == {"axisymmetric", "scaled"}
    assert dataset["force"].values[1] == pytest.approx(2 * dataset["force"].values[0])
    assert dataset["contact_radius"].values == pytest.approx(1.28e-3, rel=0.05)
    assert dataset["contact_area"].values == pytest.approx(pi * dataset["contact_radius"].values ** 2)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
@pytest.mark.parametrize(("steep", "pulls"), [(1.0, False), (1.016, False), (1.02, True)])
def test_a_pull_is_judged_by_the_mean_pressure(scale, steep, pulls):
    """Pressures 1 - c r² over a patch of radius 1, with mean 1 - c/2, in elements of degree 2."""
    ends, radii = np.linspace(0.0, 1.0, 81), np.linspace(0.0, 1.0, 161)
    place, weights = np.polynomial.legendre.leggauss(5)
    shapes = np.stack([place * (place - 1) / 2, 1 - place**2, place * (place + 1) / 2])
    residual = np.zeros(2 * len(radii))
    for number, r in enumerate((ends[:-1, None] + ends[1:, None] + place / 80) / 2):
        residual[4 * number + 1 : 4 * number + 7 : 2] -= shapes @ (weights / 160 * r * scale * (1 - steep * r**2))
    here = np.arange(2 * len(radii)).reshape(-1, 2), np.column_stack([radii, 0 * radii])
    nowhere = np.zeros((0, 2), dtype=int), np.zeros((0, 2))
    forms = SimpleNamespace(on=lambda name: here if name == PROBE else nowhere)
    edges = np.column_stack([np.arange(80), np.arange(1, 81)])
    arrays = SimpleNamespace(points=np.column_stack([ends, 0 * ends]), facets={PROBE: edges}, unit=2e-3, order=1)
    asked, tool = (forms, arrays, residual, residual), RoundTool(lambda r: r, 3e-3)
    if not pulls:
        check_signs(*asked, tool=tool, depth=1e-4)
        return
    with pytest.raises(LiftsOff, match=r"1.99 mm from the axis it has a tension of 1.5% of the mean"):
        check_signs(*asked, tool=tool, depth=1e-4)
