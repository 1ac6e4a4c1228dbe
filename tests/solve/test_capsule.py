"""The capsule: closed forms, the limit of thin layers, and that it combines with all the rest."""

from contextlib import contextmanager
from math import log, pi

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.key import case_key, mesh_key
from epsmesh.plan.plan import make_plan
from epsmesh.run.loads import terms_of
from epsmesh.run.meshing import mesh_case
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.spaces import Spaces
from tests.cases import force, refusal, solve, solved, study
from tests.cases import raw as changes_of

SKIN = {"young": "1 MPa", "thickness": "0.1 mm", "poisson": 0.4}
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
ROUNDED = BALL | {"shape": "disc", "radius": "3 mm", "edge": "1 mm", "depth": "0.2 mm"}
SPHERE = {"shape": "ellipsoid", "size": None, "axes": ["20 mm", "20 mm", "20 mm"], "fixed": {"below": "-19.9 mm"}}
LARGE = {"law": "neo-hookean", "young": "10 kPa", "poisson": 0.45}
CYLINDER = {"shape": "cylinder", "size": None, "radius": "30 mm", "height": "30 mm", "fixed": "bottom+sides"}


def skin(**keys):
    return {"body": {"capsule": SKIN | keys}}


@contextmanager
def on_mesh(case, comm=MPI.COMM_SELF):
    """Lend the displacement and the capsule of a case, on its mesh."""
    with Spaces(mesh_case(case, (), comm)) as spaces:
        space = spaces.get(2, Conditions(terms=terms_of(case)))
        yield space.forms.displacement, space.terms[0]


def stored(case, *displacements):
    """Return the energies (J) of a case's capsule at displacements, functions of the undeformed place."""
    found = []
    with on_mesh(case) as (u, capsule):
        for displacement in displacements:
            u.interpolate(displacement)
            found.append(capsule.energy())
    return found if len(found) > 1 else found[0]


def on_top(**keys):
    """Return a case of a capsule on the top of a box, 40 mm wide, that bears tension only."""
    return study(**skin(tension_only=True, on="top", **keys)).case(())


def linear(matrix):
    """Return the displacement of a deformation gradient."""
    return lambda x: (np.array(matrix) - np.eye(3)) @ x


def test_a_ball_that_swells_has_the_energy_of_a_pressurised_sphere():
    """It is half the pressure 2 E t ε / (R (1 - ν)) times the change of volume."""
    case = study(body=SPHERE | {"capsule": SKIN}).case(())
    strain, radius, stiff = 1e-3, 20e-3, 1e6 * 0.1e-3
    energy = 4 * pi * radius**2 * stiff * strain**2 / (1 - 0.4)
    assert stored(case, lambda x: strain * x) == pytest.approx(energy * (1 - 0.1 / 40), rel=0.01)


def test_a_stretched_membrane_under_a_disc():
    """F = 2π T d / ln(R/a), on tissue without stiffness."""
    body = CYLINDER | {"capsule": SKIN | {"young": "1 mPa", "tension": "3 N/m"}}
    soft = {"young": "0.1 Pa", "poisson": 0.3}
    found = solved(body=body, material=soft, mesh={"fine": "4 mm", "rim": "0.5 mm"})
    known = 2 * pi * 3 * 0.2e-3 / log(30 / 3)
    assert found.force == pytest.approx(known, rel=2e-3)
    assert abs(found.force / known - 1) < found.force_error


def test_an_inflated_sphere_has_the_pressure_of_a_membrane_at_large_strain():
    """Of a stretch λ it is 2/(R λ²) times the tension per undeformed length, λ E t (λ² - 1)/2 / (1 - ν)."""
    case = study(body=SPHERE | {"capsule": SKIN | {"tension_only": True}}).case(())
    stretch, step, radius, stiff = 1.3, 1e-3, 20e-3, 1e6 * 0.1e-3
    below, above = stored(case, *(linear((stretch + sign * step) * np.eye(3)) for sign in (-1, 1)))
    pressure = 2 / (radius * stretch**2) * stretch * stiff * (stretch**2 - 1) / 2 / (1 - 0.4)
    volume = 4 * pi * radius**3 * stretch**2 * 2 * step
    assert above - below == pytest.approx(pressure * volume * (1 - 0.1 / 40), rel=0.01)


@pytest.mark.parametrize(
    ("stretches", "tension", "density"),
    [
        ((1.2, 1.1), 0.0, (0.22**2 + 0.105**2 + 2 * 0.4 * 0.22 * 0.105) / (1 - 0.4**2)),
        ((1.2, 0.6), 0.0, 0.22**2),
        ((0.9, 0.8), 0.0, 0.0),
        # By a tension of 20 N/m it is stretched by e = 0.12 before.
        ((1.2, 0.6), 20.0, (0.22 + 0.12) ** 2 - 2 * 0.12**2 / (1 - 0.4)),
        ((0.8, 0.7), 20.0, -2 * 0.12**2 / (1 - 0.4)),
        ((1.0, 1.0), 20.0, 0.0),
    ],
    ids=["taut", "wrinkled", "slack", "wrinkled under tension", "slack under tension", "at rest"],
)
def test_what_is_compressed_wrinkles(stretches, tension, density):
    """The energy is E t/2 times that of strains, whatever turns the surface, and however narrow a wrinkled one is."""
    case, turn = on_top(tension=f"{tension} N/m"), np.linalg.qr(np.arange(9.0).reshape(3, 3) ** 2 + np.eye(3))[0]
    along = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    stretch = along @ np.diag([*stretches, 1.3]) @ along.T
    known = 1e6 * 0.1e-3 / 2 * 40e-3**2 * density
    assert stored(case, linear(stretch), linear(turn @ stretch)) == pytest.approx([known, known], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("tension", ["0 N/m", "5 N/m"])
def test_its_forces_and_its_tangent_are_derivatives_of_its_energy(tension):
    """In states that are taut here, wrinkled and slack there; no direction reduces the forces' work."""
    random, step = np.random.default_rng(7), 1e-7
    with on_mesh(on_top(tension=tension)) as (u, capsule):
        u.interpolate(lambda x: 0.02 * np.array([np.sin(150 * x[0]), np.cos(90 * x[1]), np.sin(200 * x[1])]) * 0.1)
        state, direction = u.x.array.copy(), random.standard_normal(len(u.x.array)) * 1e-3
        matrix = capsule.operator()
        vector, product = matrix.createVecs()
        vector.array[:] = direction
        matrix.mult(vector, product)
        found = capsule.forces() @ direction, product.array.copy()
        at = []
        for sign in (-1, 1):
            u.x.array[:] = state + sign * step * direction
            at.append((capsule.energy(), capsule.forces()))
        matrix.destroy()
    assert (at[1][0] - at[0][0]) / (2 * step) == pytest.approx(found[0], rel=1e-5)
    change = (at[1][1] - at[0][1]) / (2 * step)
    assert np.linalg.norm(change - found[1]) < 1e-4 * np.linalg.norm(change)
    assert direction @ found[1] > 0


@pytest.mark.parametrize(
    ("tension", "known"),
    [
        pytest.param("3 N/m", 0.0335141, marks=pytest.mark.nightly, id="taut"),
        pytest.param("0.3 N/m", 0.0092689, id="wrinkled"),
    ],
)
def test_a_membrane_pressed_far_is_that_of_one_dimension(tension, known):
    """Below a disc as deep as it is wide; ``known`` is from the least energy of an annulus along its radius."""
    body = CYLINDER | {"capsule": SKIN | {"poisson": 0.3, "tension_only": True, "tension": tension}}
    soft = {"young": "1 mPa", "poisson": 0.3, "law": "neo-hookean"}
    found = solved(body=body, material=soft, mesh={"fine": "4 mm", "rim": "0.5 mm"}, probe={"depth": "3 mm"})
    assert found.force == pytest.approx(known, rel=3e-4)


@pytest.mark.parametrize("ratio", [pytest.param(10, marks=pytest.mark.nightly), 1000])
@pytest.mark.parametrize(
    "tool",
    [
        pytest.param({}, marks=pytest.mark.nightly),
        BALL,
        pytest.param(ROUNDED, marks=pytest.mark.nightly),
    ],
    ids=["bonded", "found", "rounded"],
)
def test_at_large_displacements_contact_settles_on_any_capsule(ratio, tool):
    """F is the derivative of the energy, above that without a capsule; finer elements are within the bars."""
    keys = {"young": f"{10 * ratio} kPa", "tension_only": True, "poisson": 0.4}
    none, coarse, fine = (
        solved(material=LARGE, probe=tool, **changes)
        for changes in ({}, skin(**keys), skin(**keys) | {"mesh": {"fine": "4 mm", "rim": "0.6 mm"}})
    )
    assert coarse.force > none.force
    assert abs(fine.force / coarse.force - 1) < coarse.force_error + fine.force_error


def test_the_force_is_the_derivative_of_the_energy_by_the_depth():
    depths = {"depth": ["0.49 mm", "0.5 mm", "0.51 mm"], "mesh_depths": ["0.49 mm", "0.51 mm"]}
    below, at, above = solve(material=LARGE, **skin(tension_only=True), probe=BALL | depths).values()
    assert (above.energy - below.energy) / 2e-5 == pytest.approx(at.force, rel=1e-4)


@pytest.mark.parametrize("element", ["displacement", pytest.param("mixed", marks=pytest.mark.nightly)])
@pytest.mark.parametrize(
    ("tool", "only", "law"),
    [
        ({}, False, "linear"),
        (BALL, False, "linear"),
        pytest.param({}, True, "linear", marks=pytest.mark.nightly),
        pytest.param(BALL, True, "linear", marks=pytest.mark.nightly),
        pytest.param({}, True, "neo-hookean", marks=pytest.mark.nightly),
        pytest.param(BALL, True, "neo-hookean", marks=pytest.mark.nightly),
    ],
    ids=["bonded", "found", "bonded, taut", "found, taut", "bonded, large", "found, large"],
)
def test_a_quarter_is_the_whole(tool, element, only, law):
    changes = skin(tension_only=only) | {"probe": tool, "material": {"law": law}}
    quarter, whole = (solved(**changes, mesh={"model": model, "element": element}) for model in ("auto", "3d"))
    assert abs(whole.force / quarter.force - 1) < whole.force_error + quarter.force_error
    assert whole.force == pytest.approx(quarter.force, rel=0.02)


def test_work_is_twice_the_energy_of_tissue_and_capsule():
    """Without tension the problem is linear: the energy of the membrane is part of U in F d = 2U."""
    found = solved(**skin())
    assert found.force * 0.2e-3 == pytest.approx(2 * found.energy, rel=1e-5)
    deeper = solved(**skin(), probe={"depth": "0.4 mm"})
    assert deeper.force == pytest.approx(2 * found.force, rel=1e-5)


def test_force_grows_with_it_and_vanishes_with_it():
    none, soft, stiff = (force(**changes) for changes in ({}, skin(young="1 Pa"), skin(young="10 MPa")))
    assert soft == pytest.approx(none, rel=1e-4)
    assert stiff > 1.03 * none


def test_tissue_and_capsule_scale_together_and_not_tissue_alone():
    """F is proportional to both moduli together; a sweep of the tissue's solves each."""
    (one, two) = solve(**skin(), material={"young": ["10 kPa", "20 kPa"]}).values()
    (both,) = solve(**skin(young="2 MPa"), material={"young": "20 kPa"}).values()
    assert both.force == pytest.approx(2 * one.force, rel=1e-6)
    assert two.force < 1.999 * one.force
    plan = make_plan(study(**skin(), material={"young": ["10 kPa", "20 kPa"]}))
    assert len(plan.solves) == 2


def test_every_value_is_part_of_the_key_and_the_mesh_has_none():
    cases = [
        study(**changes).case(())
        for changes in (
            {},
            skin(),
            skin(young="2 MPa"),
            skin(thickness="0.2 mm"),
            skin(poisson=0.3),
            skin(tension="1 N/m"),
            skin(on="top"),
            skin(tension_only=True),
        )
    ]
    assert len({case_key(case) for case in cases}) == len(cases)
    # Slopes like r^-½ at the disc's edge have no finite energy in a membrane of Green's strain.
    assert [mesh_key(case) for case in cases[:-1]] == [mesh_key(cases[0])] * (len(cases) - 1)
    assert not cases[-1].has_quarter_points


def test_its_values_are_swept_by_its_name():
    swept = study(body={"capsule": SKIN | {"young": ["1 MPa", "2 MPa"]}})
    assert [axis.name for axis in swept.axes] == ["capsule_young"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material": {"law": "neo-hookean"}}, "a membrane that is compressed wrinkles"),
        ({"probe": {"history": {"ramp": "1 s", "hold": "1 s"}}}, "a capsule that relaxes is not computed"),
        ({"mesh": {"epsilon": "8 mm", "outside": "green"}}, "neither those of"),
        ({"mesh": {"epsilon": "8 mm", "outside": "free"}}, "no part of it may be cut away"),
        ({"mesh": {"degree": 1}}, "is too low with springs or other terms"),
    ],
    ids=["large", "time", "far field", "column", "degree 1"],
)
def test_what_it_excludes_is_refused(changes, words):
    assert words in refusal(changes_of(**skin(), **changes))


def test_its_place_must_exist():
    assert "body.capsule.on" in refusal(changes_of(**skin(on="floor")))
    assert "is fixed" in refusal(changes_of(**skin(on="bottom")))


def test_tension_decides_where_the_depth_begins():
    assert "where the depth begins" in refusal(changes_of(**skin(tension="1 N/m"), solve={"influence": True}))


@pytest.mark.mpi
@pytest.mark.parametrize("tool", [{}, BALL], ids=["bonded", "found"])
@pytest.mark.parametrize("only", [pytest.param(False, marks=pytest.mark.nightly), True], ids=["linear", "large"])
def test_ranks_agree(tool, only):
    material = LARGE if only else {}
    changes = skin(tension_only=only) | {"material": material, "probe": tool}
    together, alone = (force(comm, **changes) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together == pytest.approx(alone, rel=1e-6)
