"""The capsule: closed forms, the limit of thin layers, and that it combines with all the rest."""

from math import log, pi

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
CYLINDER = {"shape": "cylinder", "size": None, "radius": "30 mm", "height": "30 mm", "fixed": "bottom+sides"}


def skin(**keys):
    return {"body": {"capsule": SKIN | keys}}


def stored(case, displacement):
    """Return the energy (J) of a case's capsule at a displacement, a function of the undeformed place."""
    (term,) = terms_of(case)
    with Spaces(mesh_case(case, (), MPI.COMM_SELF)) as spaces:
        space = spaces.get(2, Conditions(terms=(term,)))
        u = space.forms.displacement
        u.interpolate(displacement)
        return space.terms[0].energy()


def test_a_ball_that_swells_has_the_energy_of_a_pressurised_sphere():
    """It is half the pressure 2 E t ε / (R (1 - ν)) times the change of volume."""
    ball = {"shape": "ellipsoid", "size": None, "axes": ["20 mm", "20 mm", "20 mm"], "fixed": {"below": "-19.9 mm"}}
    case = study(body=ball | {"capsule": SKIN}).case(())
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


@pytest.mark.parametrize(
    ("tool", "element"),
    [({}, "displacement"), (BALL, "displacement"), ({}, "mixed"), (BALL, "mixed")],
    ids=["bonded", "found", "bonded, mixed", "found, mixed"],
)
def test_a_quarter_is_the_whole(tool, element):
    quarter, whole = (
        solved(probe=tool, **skin(), mesh={"model": model, "element": element}) for model in ("auto", "3d")
    )
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
        )
    ]
    assert len({case_key(case) for case in cases}) == len(cases)
    assert len({mesh_key(case) for case in cases}) == 1


def test_its_values_are_swept_by_its_name():
    swept = study(body={"capsule": SKIN | {"young": ["1 MPa", "2 MPa"]}})
    assert [axis.name for axis in swept.axes] == ["capsule_young"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material": {"law": "neo-hookean"}}, "a compressed membrane wrinkles"),
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
def test_ranks_agree(tool):
    together, alone = (force(comm, **skin(), probe=tool) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together == pytest.approx(alone, rel=1e-6)
