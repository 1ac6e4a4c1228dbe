"""Unilateral contact with loads, with a far field, and under tilted tools."""

from math import pi

import numpy as np
import pytest
from mpi4py import MPI

from tests.cases import solve
from tests.verification.known import half_space_ball

BOX = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}
MESH = {"fine": "3 mm", "coarse": "6 mm", "rim": "0.4 mm", "growth": 0.6}
SPHERE = {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"}
DISC = {"shape": "disc", "radius": "1 mm", "depth": "0.1 mm"}
GRAVITY = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
TISSUE = {"poisson": 0.3, "density": "1060 kg/m^3"}
CAP = {"around": ["7 mm", "0 mm", "0 mm"], "radius": "3 mm"}
BALL = {"epsilon": "8 mm", "outside": "halfspace"}


def record(comm=MPI.COMM_SELF, mesh=None, **changes):
    (found,) = solve(comm, **({"body": BOX, "probe": SPHERE, "mesh": MESH | (mesh or {})} | changes)).values()
    assert found.status == "ok", found.message
    return found


def pulled(pressure):
    return {"traction": [{"on": CAP, "pressure": f"{pressure} kPa"}]}


# ---- loads ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("load", "poisson"), [(GRAVITY, 0.3), (pulled(0.5), 0.49)], ids=["gravity", "cap"])
def test_disc_that_does_not_lift_off_is_the_prescribed_one_moved_from_its_first_touch(load, poisson):
    """F = k (d + sag) + the force of the loads on a fixed disc: superposition."""
    scene = {"load": load, "material": TISSUE | {"poisson": poisson}, "mesh": {"rim": "0.5 mm"}}
    found = record(probe=DISC | {"contact": "unilateral"}, **scene)
    held = record(probe=DISC | {"contact": "frictionless"}, **scene)
    expected = held.force * (1 + found.sag / 0.1e-3) + held.load_force
    assert found.force == pytest.approx(expected, rel=2e-6)
    assert found.load_energy == pytest.approx(record(probe=SPHERE, **scene).load_energy, rel=0.02)


def test_depth_counts_from_the_first_touch_of_the_surface_as_loads_leave_it():
    """The body sinks by 0.2 μm; F changes only with the bending of the surface below the tool, which is small."""
    alone, loaded = record(material=TISSUE), record(material=TISSUE, load=GRAVITY)
    assert loaded.sag == pytest.approx(1060 * 9.81 * 0.02**2 / 2 / 13.46e3, rel=0.3)  # a column's: ρ g H² / 2 M
    assert loaded.force == pytest.approx(alone.force, rel=0.002)
    assert loaded.load_force == 0.0
    assert loaded.balance < 1e-6


def test_what_loads_add_is_proportional_to_them_while_they_are_small():
    mesh = {"degree": 3, "rim": "0.3 mm"}
    nothing, small, twice = (record(load=pulled(p) if p else {}, mesh=mesh).force for p in (0, 0.5, 1.0))
    assert abs(small - nothing) > 1e-3 * nothing
    assert twice - nothing == pytest.approx(2 * (small - nothing), rel=0.1)


def test_loads_on_a_quarter_a_half_and_the_whole_agree():
    scene = {"load": GRAVITY, "material": TISSUE, "mesh": {"rim": "0.6 mm"}}
    quarter = record(**scene)
    whole = record(**scene | {"mesh": scene["mesh"] | {"model": "3d"}})
    assert quarter.force == pytest.approx(whole.force, rel=3e-8)
    assert quarter.sag == pytest.approx(whole.sag, rel=1e-6)


def test_loads_that_move_the_tissue_below_the_probe_are_told():
    """The top of the box moves by ρ g H² / 2 G in shear, 1.8 mm, and bends; a linear law presses it where it was."""
    load = {"gravity": ["9.81 m/s^2", "0 m/s^2", "0 m/s^2"]}
    soft, stiff = (
        record(material=TISSUE | {"young": young}, load=load, mesh={"rim": "0.6 mm", "fine": "5 mm"}).message
        for young in ("3 kPa", "300 kPa")
    )
    words = soft.removeprefix("loads move the tissue below the probe by ").split()
    assert 1.8 < float(words[0]) < 2.7
    assert words[1:5:2] == ["mm,", "contact"]
    assert 2 < float(words[2]) < 2.7  # the radius is next to 1 mm, that of 10 mm pressed by 0.1 mm
    assert stiff == ""


def test_friction_begins_at_none_where_loads_move_a_sloping_surface_across_the_axis():
    """The gaps of a linear law are above undeformed places with and without friction, and so is the first touch."""
    ball = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "at": ["9 mm", "0 mm"]}
    scene = {"material": TISSUE | {"young": "3 kPa"}, "load": {"gravity": ["9.81 m/s^2", "0 m/s^2", "0 m/s^2"]}}
    mesh = {"fine": "5 mm", "coarse": "8 mm", "rim": "1 mm"}
    none, little = (record(probe=ball | {"friction": f}, mesh=mesh, **scene) for f in (0, 1e-6))
    assert little.force == pytest.approx(none.force, rel=1e-5)
    assert little.sag == pytest.approx(none.sag, rel=1e-6)


def test_force_is_not_scaled_where_loads_bend_the_surface():
    """Not with the modulus: a softer body bends more. At twice the stiffness and load, F is twice as large."""
    load = pulled(1)
    soft = record(load=load, material={"young": "10 kPa"})
    stiff = record(load=pulled(2), material={"young": "20 kPa"})
    other = record(load=load, material={"young": "20 kPa"})
    assert stiff.force == pytest.approx(2 * soft.force, rel=1e-7)
    assert abs(other.force / (2 * soft.force) - 1) > 1e-3


DEPTHS = [f"{depth:.4g} mm" for depth in np.linspace(0.04, 0.12, 10)]
ON_ONE_MESH = SPHERE | {"depth": DEPTHS, "mesh_depths": [DEPTHS[0], DEPTHS[-1]]}


@pytest.mark.parametrize("scene", [{"load": pulled(1.0)}, {"mesh": MESH | BALL}], ids=["loads", "half ball"])
def test_depths_on_one_mesh_are_those_of_each_alone(scene):
    """Ten depths on the condensed surface, compared with three of them solved separately."""
    scene, chosen = {"body": BOX, "mesh": MESH} | scene, (0, 4, 9)
    together = solve(**scene, probe=ON_ONE_MESH)
    some = ON_ONE_MESH | {"depth": [DEPTHS[number] for number in chosen]}
    alone = solve(**scene, probe=some, plan={"without": ["axisymmetric", "condensed", "initial-guess"]})
    for number, single in zip(chosen, alone.values(), strict=True):
        assert together[number,].force == pytest.approx(single.force, rel=1e-7)
        assert together[number,].energy == pytest.approx(single.energy, rel=1e-6)


def test_depths_without_loads_have_their_own_bars_beside_loads():
    scene = {"body": BOX, "probe": ON_ONE_MESH, "mesh": MESH}
    loads = [{"name": "pulled", **pulled(20.0)}, {"name": "none"}]
    beside, alone = solve(**scene, load=loads), solve(**scene)
    for (number,), found in alone.items():
        other = next(beside[index] for index in ((number, 1), (1, number)) if index in beside)
        assert other.force_error == pytest.approx(found.force_error, rel=1e-4)


@pytest.mark.mpi
@pytest.mark.parametrize(
    "changes",
    [{"load": GRAVITY, "material": TISSUE}, {"mesh": BALL}, {"mesh": BALL, "probe": SPHERE | {"friction": 0.3}}],
    ids=["loads", "far field", "far field and friction"],
)
def test_ranks_agree(changes):
    together, alone = (record(comm, **changes) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    together = MPI.COMM_WORLD.bcast(together)
    assert together.force == pytest.approx(alone.force, rel=1e-7)
    assert together.force_error == pytest.approx(alone.force_error, rel=0.05)


# ---- a far field ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [2, pytest.param(3, marks=pytest.mark.nightly)])
def test_half_ball_that_a_half_space_closes_is_hertz(degree):
    found = record(mesh=BALL | {"degree": degree})
    assert found.force == pytest.approx(half_space_ball(10e3, 0.3, 10e-3, 0.1e-3), rel=found.force_error)
    assert found.contact_area == pytest.approx(pi * 1e-6, rel=found.contact_area_error)
    assert found.energy == pytest.approx(2 / 5 * found.force * 0.1e-3, rel=0.01)


def test_half_ball_of_a_much_larger_body_is_that_body():
    """Up to the difference of the two meshes, which depends on the version of gmsh (.1 and .46 %)."""
    large = {"shape": "box", "size": ["200 mm", "200 mm", "100 mm"], "fixed": "bottom"}
    whole = record(body=large, mesh={"epsilon": "8 mm", "coarse": "20 mm"})
    part = record(body=large, mesh={"epsilon": "8 mm", "coarse": "20 mm", "outside": "green"})
    assert part.force == pytest.approx(whole.force, rel=0.006)


def test_half_ball_that_a_half_space_closes_is_the_same_at_every_place():
    """All places share one mesh, made for the tool at its centre."""
    centre, beside = (record(probe=SPHERE | {"at": [at, "0 mm"]}, mesh=BALL) for at in ("0 mm", "3 mm"))
    assert beside.force == pytest.approx(centre.force, rel=1e-8)
    timed = record(probe=SPHERE | {"at": ["3 mm", "0 mm"]}, mesh=BALL, solve={"timing": True})
    assert timed.force == pytest.approx(centre.force, rel=1e-8)
    assert timed.contact_radius_error == pytest.approx(centre.contact_radius_error, rel=1e-3)


def test_places_on_a_half_ball_have_the_forces_and_bars_of_each_alone():
    ball = BALL | {"outside": "green"}
    together = solve(body=BOX, mesh=MESH | ball, probe=SPHERE | {"at": [["2 mm", "0 mm"], ["9 mm", "0 mm"]]})
    first, second = (found.force for found in together.values())
    assert abs(second / first - 1) > 1e-3
    for found, at in zip(together.values(), ("2 mm", "9 mm"), strict=True):
        alone = record(probe=SPHERE | {"at": [at, "0 mm"]}, mesh=ball)
        assert found.force == pytest.approx(alone.force, rel=2e-3)  # far fields of several places share a mesh
        assert found.force_error == pytest.approx(alone.force_error, rel=0.02)


@pytest.mark.parametrize("poisson", [0.3, 0.48])
def test_half_ball_with_the_body_s_own_far_field_is_the_body(poisson):
    material = {"poisson": poisson}
    meshes = ({"degree": 3}, BALL | {"outside": "green", "degree": 3})
    whole, part = (record(mesh=mesh, material=material) for mesh in meshes)
    assert part.force == pytest.approx(whole.force, rel=0.003)
    assert part.force_error < 0.05


def test_flat_tool_over_a_half_ball_is_the_prescribed_one():
    found, held = (record(probe=DISC | {"contact": contact}, mesh=BALL) for contact in ("unilateral", "frictionless"))
    assert found.force == pytest.approx(held.force, rel=1e-7)
    assert found.energy == pytest.approx(held.energy, rel=1e-6)


@pytest.mark.parametrize("outside", ["halfspace", "green"])
def test_friction_over_a_half_ball_begins_at_none(outside):
    slippery, smooth = (record(probe=SPHERE | {"friction": mu}, mesh=BALL | {"outside": outside}) for mu in (1e-9, 0))
    assert slippery.force == pytest.approx(smooth.force, rel=1e-7)
    assert slippery.energy == pytest.approx(smooth.energy, rel=1e-7)
    assert slippery.force_error == pytest.approx(smooth.force_error, rel=1e-4)


@pytest.mark.parametrize("poisson", [0.2, 0.47])
@pytest.mark.parametrize("friction", [0.3, "stick"])
def test_friction_over_a_half_ball_is_that_of_the_body(friction, poisson):
    material, probe = {"poisson": poisson}, SPHERE | {"friction": friction}
    whole, part = (record(mesh=mesh, probe=probe, material=material) for mesh in ({}, BALL | {"outside": "green"}))
    assert part.force == pytest.approx(whole.force, rel=0.006)
    for name in ("slip_area", "friction_force"):
        (value, bar), (other, its_bar) = ((getattr(r, name), getattr(r, f"{name}_error")) for r in (whole, part))
        assert abs(value - other) <= bar + its_bar


def test_far_field_of_friction_that_is_left_out_decays_as_that_of_a_bonded_footprint():
    """By (a/ε)³, with a = 2 mm: 2.1, 3 and 6 a. The ratio to the force without friction leaves the mesh's error out."""
    body = {"shape": "cylinder", "radius": "60 mm", "height": "60 mm"}
    mesh = {"fine": "6 mm", "coarse": "20 mm", "growth": 0.35, "outside": "green"}
    probe = SPHERE | {"depth": "0.4 mm"}
    ratios = []
    for epsilon in ("4.3 mm", "6 mm", "12 mm"):
        scene = {"body": body, "mesh": mesh | {"epsilon": epsilon}}
        sticks, smooth = (record(**scene, probe=probe | {"friction": mu}).force for mu in ("stick", 0))
        ratios.append(sticks / smooth)
    near, middle, far = ratios
    assert 0.002 < near - far < 0.005
    assert middle - far == pytest.approx((near - far) / 3, rel=0.4)


def test_friction_over_half_balls_of_a_quarter_and_the_whole_agree():
    """Off the middle no half ball knows the resultant of friction: the far field is that of an axial force."""
    scene = {"probe": SPHERE | {"friction": 0.3}, "mesh": BALL | {"outside": "green", "rim": "0.6 mm"}}
    quarter, whole = record(**scene), record(**scene | {"mesh": scene["mesh"] | {"model": "3d"}})
    assert quarter.force == pytest.approx(whole.force, rel=1e-4)
    assert quarter.force_vector[:2] == (0.0, 0.0)
    beside = record(**scene | {"probe": scene["probe"] | {"at": ["9 mm", "0 mm"]}})
    assert np.isnan(beside.force_vector[0])
    assert beside.force_vector[1:] == (0.0, beside.force)


@pytest.mark.parametrize("poisson", [pytest.param(0.49, marks=pytest.mark.nightly), 0.5])
def test_mixed_elements_take_a_far_field(poisson):
    found = record(mesh=BALL, material={"poisson": poisson})
    hertz = half_space_ball(10e3, poisson, 10e-3, 0.1e-3)
    assert found.force == pytest.approx(hertz, rel=found.force_error)
    assert found.force_error < 0.05


# ---- tilted tools -----------------------------------------------------------------------------------------


def test_tilted_disc_touches_first_at_its_edge_and_its_depth_counts_from_there():
    """Tilted by 6°, its edge is 0.1 mm ahead of its centre; upright, the whole face touches at once."""
    disc = DISC | {"contact": "unilateral"}
    tilted, upright = record(probe=disc | {"axis": [0.1, 0, -1]}), record(probe=disc)
    assert 0.1 * upright.force < tilted.force < 0.6 * upright.force
    shallower = record(probe=disc | {"axis": [0.1, 0, -1], "depth": "0.01 mm"})
    assert 0 < shallower.force < 0.1 * tilted.force


def test_tilted_ball_is_pressed_by_what_its_depth_is_across_the_surface():
    """A ball moves along an axis at 6° to the normal: the indentation is d cos 6°."""
    ball = {"shape": "sphere", "radius": "5 mm", "depth": "0.2 mm"}
    tilted, upright = record(probe=ball | {"axis": [0.1, 0, -1]}), record(probe=ball)
    assert tilted.force == pytest.approx(upright.force, rel=0.02 + tilted.force_error)
    assert tilted.contact_radius == pytest.approx(upright.contact_radius, rel=0.05)


def test_tool_that_would_touch_outside_the_searched_region_is_refused():
    found = solve(body=BOX, mesh=MESH, probe={"shape": "sphere", "radius": "3 mm", "depth": "0.1 mm"})
    assert all(one.status == "ok" for one in found.values())
    with pytest.raises(Exception, match="from its axis"):
        solve(
            body=BOX, mesh=MESH, probe={"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm", "axis": [0.4, 0, -1]}
        )
