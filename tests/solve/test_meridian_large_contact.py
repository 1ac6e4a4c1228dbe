"""Contact at large displacements on the meridian: the linear limit, another code's forces, and the deformed surface."""

import numpy as np
import pytest

from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Meridian
from epsmesh.shapes.contour import Contour
from epsmesh.shapes.distance import revolved
from epsmesh.shapes.rounded import Rounded
from epsmesh.solve.compiled import compiling
from epsmesh.solve.meridian.contact import MeridianContact
from epsmesh.solve.meridian.large import DEGREE
from epsmesh.solve.meridian.large_contact import LargeMeridianContact
from epsmesh.solve.meridian.problem import compile_axisymmetric
from epsmesh.solve.meridian.punch import TRIAL_DEGREE, RoundTool
from epsmesh.solve.movement import Movement
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from tests.cases import solve

BODY = Meridian(6.0, 5.0, 1.0)


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    with compiling():
        compile_axisymmetric(lowest=TRIAL_DEGREE)
        compile_axisymmetric(DEGREE, laws=("neo-hookean",))
        compile_axisymmetric(DEGREE, laws=("neo-hookean",), curved=True)


def round_tool(section, limit, fall=lambda radii: 0 * radii):
    contour = Contour(section, limit)
    return RoundTool(
        lambda radii: section.height(radii) + fall(radii),
        limit,
        (section.tangent,) if section.angle else (),
        lambda points, depth: revolved(contour, points + np.array([0.0, 0.0, depth])),
    )


BALL = round_tool(Rounded(0.0, 1.0), 1.0)
CONE = round_tool(Rounded(np.pi / 3, 0.3), 3.0)


def law(poisson, name="neo-hookean", **further):
    return MaterialLaw.of_moduli(1.0, poisson, name, **further)


def pressed(tool, depth, poisson, body=BODY, **how):
    return LargeMeridianContact(body, tool, **how).solve(law(poisson), Movement.along((0.0, 0.0, -depth)))


@pytest.mark.parametrize(
    ("tool", "poisson", "depth"),
    [
        (BALL, 0.3, 1e-3),
        pytest.param(BALL, 0.5, 1e-3, marks=pytest.mark.nightly),
        pytest.param(CONE, 0.3, 1e-3, marks=pytest.mark.nightly),
        pytest.param(BALL, 0.3, 1e-4, marks=pytest.mark.nightly),
    ],
    ids=["ball", "ball, ν = ½", "cone", "tiny depth"],
)
def test_small_depths_are_linear(tool, poisson, depth):
    """A cone keeps its slopes: its difference is of the order of its rounding's contact radius over its radius.

    At the tiny depth, rounding in the far field is a residual that Newton's method cannot reduce.
    """
    known = MeridianContact(BODY, tool).solve(law(poisson, "linear"), Movement.along((0.0, 0.0, -depth)))
    found = pressed(tool, depth, poisson)
    assert found.reaction[2] == pytest.approx(known.reaction[2], rel=3e-3)
    assert found.contact.radius == pytest.approx(known.contact.radius, rel=2e-2)
    assert found.bar < 1e-4


def test_finer_meshes_agree_within_the_bar():
    coarse, fine = (pressed(BALL, 0.5, 0.4, accuracy=accuracy) for accuracy in (1e-2, 1e-5))
    assert coarse.reaction[2] == pytest.approx(fine.reaction[2], rel=coarse.bar)
    assert fine.bar < coarse.bar / 3
    assert coarse.contact.area == pytest.approx(fine.contact.area, rel=0.03)


def test_the_work_of_the_force_is_the_energy():
    first, middle, last = (pressed(CONE, depth, 0.4) for depth in (0.28, 0.32, 0.36))
    work = 0.08 / 6 * sum(w * s.reaction[2] for w, s in zip((1, 4, 1), (first, middle, last), strict=True))
    assert last.energy - first.energy == pytest.approx(work, rel=1e-4)


def test_an_ellipsoid_is_linear_at_small_depths():
    tool = round_tool(Rounded(0.0, 1.0), 1.0, lambda r: 3 * (1 - np.sqrt(1 - (r / 4) ** 2)))
    egg, depth = EllipticMeridian(4.0, 3.0, 1.0, -1.0), 1e-3
    known = MeridianContact(egg, tool).solve(law(0.4, "linear"), Movement.along((0.0, 0.0, -depth)))
    found = pressed(tool, depth, 0.4, egg, accuracy=1e-3)
    assert found.reaction[2] == pytest.approx(known.reaction[2], rel=3e-3)


def test_load_steps_that_end_tell_where():
    """A cone with a sharp tip goes through neo-Hookean tissue to a few radii of its tip, here none."""
    with pytest.raises(LargeError, match="load steps reached") as stopped:
        pressed(round_tool(Rounded(np.pi / 8, 0.02), 3.0), 1.0, 0.3)
    depth, force = stopped.value.reached
    assert 0.01 < depth < 1.0
    assert force > 0


def test_a_study_is_solved_on_the_meridian_as_in_three_dimensions():
    scene = {
        "body": {"shape": "cylinder", "radius": "20 mm", "height": "15 mm", "fixed": "bottom"},
        "material": {"law": "neo-hookean", "poisson": 0.4},
        "probe": {"shape": "sphere", "radius": "4 mm", "depth": "1 mm", "contact": "unilateral"},
        "mesh": {"rim": "0.7 mm", "fine": "4 mm", "coarse": "6 mm", "growth": 1.2},
    }
    (plane,), (space,) = (solve(**scene, plan={"without": without}).values() for without in ([], ["axisymmetric"]))
    assert (plane.status, plane.kind) == ("ok", "meridian large")
    assert plane.force == pytest.approx(space.force, rel=space.force_error + plane.force_error)
    assert plane.contact_area == pytest.approx(space.contact_area, rel=0.1)
    assert plane.force_error < 1e-4


def test_a_study_tells_the_depth_that_a_path_reached():
    (found,) = solve(
        body={"shape": "cylinder", "radius": "24 mm", "height": "20 mm", "fixed": "bottom"},
        material={"law": "neo-hookean", "poisson": 0.3},
        probe={"shape": "disc", "radius": "4 mm", "depth": "12 mm", "contact": "bonded"},
        plan={"without": []},
    ).values()
    assert found.status == "partial"
    assert 4e-3 < found.depth_reached < 12e-3
    assert found.force_reached > 0
    assert "unstable" in found.message


@pytest.mark.parametrize(("tool", "depth"), [(BALL, 0.1), pytest.param(CONE, 0.1, marks=pytest.mark.nightly)])
def test_the_area_has_a_bar_of_its_own(tool, depth):
    """F is stationary with respect to the area, which errs by more than F."""
    found, fine = (pressed(tool, depth, 0.3, accuracy=accuracy).contact for accuracy in (5e-3, 1e-9))
    assert abs(found.area / fine.area - 1) < found.bar + fine.bar
    assert 5 * fine.bar < 4 * found.bar < 0.2
