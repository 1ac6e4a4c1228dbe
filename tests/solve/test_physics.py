"""Mechanics of the force: closed forms, invariances, bounds."""

from math import pi

import pytest

from tests.cases import BLADE, force, solve
from tests.sampling import sampled
from tests.verification import known

CAP = {"around": ["9 mm", "0 mm", "0 mm"], "radius": "3 mm"}
BALL = {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"}
# The range of Poisson's ratio for displacement elements of degree 2.
EXACT = {(contact, nu): value for (contact, nu), value in known.CYLINDER.items() if nu <= 0.45}
UNIT = 10e3 * 0.2e-3 * 1e-3


@pytest.mark.parametrize(("degree", "tolerance"), [(1, 0.04), (2, 3e-4), (3, 3e-4)])
def test_uniaxial_strain(degree, tolerance):
    """Without lateral contraction a column under a probe that covers it is in uniform strain: F = E A d / H.

    The remaining error is the shape of the column's side, by straight facets or quadratic ones.
    """
    value = force(
        material={"poisson": 0},
        mesh={"epsilon": "3 mm", "outside": "free", "fine": "1 mm", "rim": "1 mm", "degree": degree},
    )
    assert value == pytest.approx(10e3 * pi * 3e-3**2 * 0.2e-3 / 20e-3, rel=tolerance)


def test_force_is_linear_in_young_and_depth():
    records = solve(material={"young": ["1 kPa", "10 kPa"]}, probe={"depth": ["0.1 mm", "0.3 mm"]})
    reference = records[0, 0].force
    for (i, j), record in records.items():
        assert record.force == pytest.approx(reference * (1, 10)[i] * (1, 3)[j], rel=1e-9)


def test_scaling_all_lengths_scales_stiffness():
    single = force()
    double = force(
        body={"size": ["80 mm", "80 mm", "40 mm"]},
        probe={"radius": "6 mm"},
        mesh={"fine": "10 mm", "coarse": "16 mm", "rim": "2 mm"},
    )
    assert double == pytest.approx(2 * single, rel=1e-9)


def test_force_falls_with_refinement_and_degree():
    coarse, fine = (force(mesh={"rim": rim, "fine": f}) for rim, f in (("2 mm", "8 mm"), ("0.5 mm", "4 mm")))
    linear, cubic = (force(mesh={"rim": "2 mm", "fine": "8 mm", "degree": degree}) for degree in (1, 3))
    assert linear > coarse > fine
    assert coarse > cubic


def test_conforming_mesh_is_never_softer_than_full_order():
    """The finer mesh gives the smaller F. Two different meshes may differ by 0.5 % in their common error."""
    records = solve(mesh={"epsilon": ["4 mm", "8 mm", "full"], "fine": "2 mm", "growth": 0.5, "rim": "0.4 mm"})
    near, far, full = (record.force for record in records.values())
    assert near > far * 0.995
    assert far > full * 0.995


def test_column_in_free_space_gives_the_paper_s_curve():
    """Converged values for a disc of 2 mm bonded to tissue of 20 mm; only r < ε is kept."""
    poisson = [0.30, 0.45]
    records = solve(
        body={"shape": "cylinder", "radius": "34 mm", "height": "20 mm"},
        material={"poisson": poisson},
        probe={"radius": "2 mm", "depth": "0.1 mm"},
        mesh={"epsilon": ["10 mm", "full"], "outside": "free", "fine": "2 mm", "rim": "0.2 mm", "growth": 0.5},
    )
    for i, nu in enumerate(poisson):
        assert records[i, 0].force / records[i, 1].force == pytest.approx(known.FREE_COLUMN[nu], abs=0.003)


def test_held_column_is_stiffer_and_free_column_softer_than_the_body():
    records = solve(mesh={"epsilon": ["8 mm", "full"], "outside": ["coarse", "free", "fixed"]})
    coarse, free, fixed = (records[0, k].force for k in range(3))
    assert free < coarse < fixed
    assert len({records[1, k].force for k in range(3)}) == 1


def test_blade_direction_and_slice():
    """A blade turned by 90° in a square body has the same force; slicing adds a force along the blade only."""
    mesh = {"rim": "0.5 mm", "fine": "4 mm"}
    records = solve(probe=BLADE | {"slice": ["0 mm", "0.1 mm"]}, mesh=mesh)
    (turned,) = solve(probe=BLADE | {"direction": [0.0, 1.0, 0.0]}, mesh=mesh).values()
    still, slicing = records[0,], records[1,]
    assert turned.force == pytest.approx(still.force, rel=still.force_error)
    assert slicing.force == pytest.approx(still.force, rel=1e-8)
    assert still.force_vector[:2] == (0.0, 0.0)
    assert -slicing.force_vector[0] > 0.3 * slicing.force
    assert slicing.force_vector[1] == 0.0


@pytest.mark.parametrize(
    ("planes", "changes"),
    {
        "quarter": (2, {}),
        "straight": (2, {"mesh": {"degree": 1}}),
        "cubic blade": (2, {"probe": BLADE, "mesh": {"degree": 3, "rim": "1.5 mm"}}),
        "off centre": (1, {"probe": {"at": ["4 mm", "0 mm"]}}),
        "slice": (1, {"probe": BLADE | {"slice": "0.1 mm"}}),
        "column": (2, {"mesh": {"epsilon": "8 mm", "outside": "free"}}),
        "below": (2, {"body": {"fixed": {"below": "-15 mm"}}, "probe": {"contact": "frictionless"}}),
        "oblique": (0, {"probe": BLADE | {"direction": [1.0, 2.0, 0.0]}}),
        "mixed": (2, {"material": {"poisson": 0.5}}),
        "slit": (2, {"probe": BLADE | {"width": "1 mm", "incision": "4 mm"}, "mesh": {"fine": "4 mm"}}),
        "loads": (1, {"load": {"traction": [{"on": CAP, "traction": ["1 kPa", "0 Pa", "200 Pa"]}]}}),
        "found contact": (2, {"probe": BALL, "mesh": {"rim": "0.5 mm"}}),
        "found contact off centre": (1, {"probe": BALL | {"at": ["1 mm", "0 mm"]}, "mesh": {"rim": "0.5 mm"}}),
    }.values(),
)
def test_symmetric_part_gives_the_force_of_the_whole(planes, changes):
    """Half or quarter of the body, and the whole made by reflection, have the same discrete solution."""
    mesh = changes.pop("mesh", {})
    # Force across the probe's axis is linear in the solver's error.
    precise = {"solve": {"energy_tolerance": 1e-10}}
    part, whole = (next(iter(solve(mesh=mesh | m, **precise, **changes).values())) for m in ({}, {"model": "3d"}))
    assert part.origin == ("symmetric" if planes else "solved")
    assert whole.origin == "solved"
    assert (part.cells, part.dofs) == (whole.cells, whole.dofs)
    assert part.force == pytest.approx(whole.force, rel=3e-8)
    assert part.energy == pytest.approx(whole.energy, rel=3e-8)
    linear = ("max_strain", "energy_release", "load_force", "load_energy", "contact_area")
    for name in linear:  # in the solver's error
        assert getattr(part, name) == pytest.approx(getattr(whole, name), rel=1e-5, nan_ok=True)
    assert part.force_vector == pytest.approx(whole.force_vector, rel=1e-6, abs=1e-8 * whole.force)
    assert part.force_error == pytest.approx(whole.force_error, rel=0.05)


@sampled("contact, poisson, degree", [(*scene, degree) for scene in EXACT for degree in (1, 2, 3)], by_day=2)
def test_error_bar_holds_the_truth(contact, poisson, degree):
    """F is an upper bound, the error is within the bar, and the bar is not much larger than the error."""
    (record,) = solve(
        body=known.CYLINDER_BODY,
        material={"poisson": poisson},
        probe={"contact": contact},
        mesh={"fine": "30 mm", "coarse": "30 mm", "rim": "0.6 mm", "growth": 0.5, "degree": degree},
    ).values()
    error = 1 - EXACT[contact, poisson] * UNIT / record.force
    assert 0 < error < record.force_error < 2.5 * error


def test_support_stiffens():
    weak = force(body={"fixed": "bottom"})
    stronger = force(body={"fixed": "bottom+sides"})
    below = force(body={"fixed": {"below": "-15 mm"}})
    assert weak < below
    assert weak < stronger
