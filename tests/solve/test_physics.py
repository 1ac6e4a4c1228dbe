"""The force obeys mechanics: closed forms, invariances, bounds."""

from math import pi

import pytest
from scipy.special import ellipk

from pipeline.verify import known
from tests.cases import BLADE, force, solve

# What displacement elements of degree 2 are for.
EXACT = {(contact, nu): value for (contact, nu), value in known.CYLINDER.items() if nu <= 0.45}
UNIT = 10e3 * 0.2e-3 * 1e-3


@pytest.mark.parametrize(("degree", "tolerance"), [(1, 0.04), (2, 3e-4), (3, 3e-4)])
def test_uniaxial_strain(degree, tolerance):
    """Without lateral contraction a column under a probe that covers it is in uniform strain: F = E A d / H.

    What is left is the shape of the column's side: straight facets, or quadratic ones.
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


@pytest.mark.parametrize(("contact", "poisson"), EXACT)
def test_cylinder_from_above(contact, poisson):
    """Conforming displacement elements bound F from above; the default rim is within 3 % of it."""
    value = force(
        body=known.CYLINDER_BODY,
        material={"poisson": poisson},
        probe={"contact": contact},
        mesh={"epsilon": "10 mm", "fine": "2 mm", "coarse": "10 mm", "rim": None, "growth": 0.5},
    )
    assert 1 <= value / UNIT / EXACT[contact, poisson] <= 1.03


def test_rim_graded_cubic_is_within_half_a_percent():
    value = force(
        body=known.CYLINDER_BODY,
        material={"poisson": 0.45},
        mesh={"epsilon": "10 mm", "fine": "3 mm", "coarse": "10 mm", "rim": "0.3 mm", "growth": 0.5, "degree": 3},
    )
    assert 1 <= value / UNIT / EXACT["bonded", 0.45] <= 1.005


def test_force_falls_with_refinement_and_degree():
    coarse, fine = (force(mesh={"rim": rim, "fine": f}) for rim, f in (("2 mm", "8 mm"), ("0.5 mm", "4 mm")))
    linear, cubic = (force(mesh={"rim": "2 mm", "fine": "8 mm", "degree": degree}) for degree in (1, 3))
    assert linear > coarse > fine
    assert coarse > cubic


ELLIPSE = {"action": "pierce", "shape": "ellipse", "axes": ["3 mm", "1 mm"], "depth": "0.1 mm"}


@pytest.mark.parametrize("axes", [(3, 1), (1, 3)])
def test_ellipse_on_half_space(axes):
    """Galin: π E* a d / K(e) with the longer semi-axis a. A body of 60 a is 1.5 % stiffer than a half-space."""
    value = force(
        body={"shape": "cylinder", "radius": "180 mm", "height": "180 mm"},
        probe=ELLIPSE | {"axes": [f"{axis} mm" for axis in axes], "contact": "frictionless"},
        mesh={"fine": "60 mm", "coarse": "60 mm", "rim": "0.1 mm", "growth": 0.5},
    )
    exact = pi * 10e3 / (1 - 0.3**2) * 3e-3 * 0.1e-3 / ellipk(1 - 1 / 9)
    assert 1 <= value / exact <= 1.02


def test_ellipse_of_equal_axes_is_a_disc():
    round_one, mesh = ELLIPSE | {"axes": ["3 mm", "3 mm"], "depth": "0.2 mm"}, {"rim": "0.3 mm", "growth": 0.5}
    assert force(probe=round_one, mesh=mesh) == pytest.approx(force(mesh=mesh), rel=2e-3)


def test_ellipse_gives_the_same_force_wherever_it_points():
    """On a round body; across the axes nothing is symmetric, and all of the body is solved."""
    body = {"shape": "cylinder", "radius": "15 mm", "height": "10 mm"}
    mesh = {"fine": "4 mm", "coarse": "4 mm", "rim": "0.3 mm", "growth": 0.6, "degree": 3}
    forces = []
    for direction in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0]):
        (record,) = solve(body=body, probe=ELLIPSE | {"direction": direction}, mesh=mesh).values()
        assert record.origin == ("solved" if all(direction[:2]) else "symmetric")
        forces.append(record.force)
    assert forces[1:] == pytest.approx([forces[0]] * 2, rel=3e-3)


@pytest.mark.parametrize("contact", ["bonded", "frictionless"])
def test_disc_on_half_space(contact):
    """Sneddon: 2 E a d / (1 - ν²); bonded: 4 μ a d ln(3 - 4ν) / (1 - 2ν). A body of 60 radii is near a half-space."""
    young, nu, a, d = 10e3, 0.3, 1e-3, 0.05e-3
    exact, _ = known.half_space_disc(young, nu, a, d, contact)
    value = force(
        body={"shape": "cylinder", "radius": "60 mm", "height": "60 mm"},
        probe={"radius": "1 mm", "depth": "0.05 mm", "contact": contact},
        mesh={"epsilon": "2 mm", "fine": "0.8 mm", "coarse": "20 mm", "rim": "0.1 mm", "growth": 0.5},
    )
    # The held base stiffens by about a / H, and the elements by their error: both from above.
    assert exact < value < 1.03 * exact


@pytest.mark.parametrize("ratio", [1, 4])
def test_rectangle_on_half_space(ratio):
    """A frictionless rectangle of length L and width W takes c E* W d."""
    young, nu, width, depth = 10e3, 0.3, 1e-3, 0.02e-3
    value = force(
        body={"shape": "cylinder", "radius": "80 mm", "height": "80 mm"},
        probe={**BLADE, "length": f"{ratio} mm", "width": "1 mm", "depth": "0.02 mm", "contact": "frictionless"},
        mesh={"epsilon": "3 mm", "fine": "0.8 mm", "coarse": "20 mm", "rim": "0.05 mm", "growth": 0.6},
    )
    exact = known.rectangle(known.RECTANGLE[ratio], young, nu, width, depth)
    assert exact < value < 1.04 * exact


def test_conforming_mesh_is_never_softer_than_full_order():
    """The finer mesh gives the smaller F. Two different meshes may differ by 0.5 % in what both leave out."""
    records = solve(mesh={"epsilon": ["4 mm", "8 mm", "full"], "fine": "2 mm", "growth": 0.5, "rim": "0.4 mm"})
    near, far, full = (record.force for record in records.values())
    assert near > far * 0.995
    assert far > full * 0.995


def test_column_in_free_space_gives_the_paper_s_curve():
    """Converged values for a disc of 2 mm bonded to tissue of 20 mm, of which only r < ε is kept."""
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
    """A blade turned by 90° in a square body takes the same force; slicing pulls along the blade only."""
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
    }.values(),
)
def test_symmetric_part_gives_the_force_of_the_whole(planes, changes):
    """Half or quarter of the body, and the whole that it is reflected to: the same discrete solution."""
    mesh = changes.pop("mesh", {})
    # Force across the probe's axis is linear in the solver's error.
    precise = {"solve": {"tolerance": 1e-10}}
    part, whole = (next(iter(solve(mesh=mesh | m, **precise, **changes).values())) for m in ({}, {"model": "3d"}))
    assert part.origin == ("symmetric" if planes else "solved")
    assert whole.origin == "solved"
    assert (part.cells, part.dofs) == (whole.cells, whole.dofs)
    assert part.force == pytest.approx(whole.force, rel=1e-8)
    assert part.energy == pytest.approx(whole.energy, rel=1e-8)
    assert part.force_vector == pytest.approx(whole.force_vector, rel=1e-6, abs=1e-8 * whole.force)
    assert part.force_error == pytest.approx(whole.force_error, rel=0.05)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize(("contact", "poisson"), EXACT)
def test_error_bar_holds_the_truth(contact, poisson, degree):
    """The error is from above, within the bar, and the bar is not much larger than the error."""
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


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_direct_and_iterative_agree(degree):
    mesh = {"degree": degree, "rim": "0.8 mm"}
    direct, iterative = (force(mesh=mesh, solve={"method": method}) for method in ("direct", "iterative"))
    assert iterative == pytest.approx(direct, rel=1e-8)


def test_iterations_do_not_grow_with_the_mesh():
    records = [
        next(iter(solve(mesh={"rim": rim, "fine": fine, "growth": 0.5}, solve={"method": "iterative"}).values()))
        for rim, fine in (("1 mm", "4 mm"), ("0.2 mm", "2 mm"))
    ]
    assert records[1].dofs > 4 * records[0].dofs
    assert records[1].iterations <= 1.3 * records[0].iterations
