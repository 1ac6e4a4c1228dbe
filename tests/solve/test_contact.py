"""Unilateral contact: known forces, no tension, no penetration, independent of the solver."""

from contextlib import contextmanager
from math import cos, hypot, radians, sqrt, tan

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.tools import tool_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.contact.active_set import ContactError
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.problems import StudyError
from tests.cases import solve, solved, study
from tests.verification import known

SMALL = {"shape": "cylinder", "radius": "6 mm", "height": "5 mm"}
LARGE = {"shape": "cylinder", "radius": "60 mm", "height": "60 mm"}
SPHERE = {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"}
CONE = {"shape": "cone", "angle": "86 deg", "radius": "4 mm", "depth": "0.1 mm"}
DISC = {"shape": "disc", "radius": "1 mm", "depth": "0.1 mm", "contact": "unilateral"}
COARSE = {"fine": "2 mm", "coarse": "2 mm", "rim": "0.3 mm", "growth": 0.5}

LAWS = ("linear", "neo-hookean")


def record(comm=MPI.COMM_SELF, mesh=None, **changes):
    return solved(comm, **{"body": SMALL, "probe": SPHERE, "mesh": COARSE | (mesh or {})} | changes)


@contextmanager
def pressed(tool=None, **changes):
    """Lend the problem of a scene, its material and its movement; optionally with another tool on its candidates."""
    (case,) = study(**{"body": SMALL, "probe": SPHERE, "mesh": COARSE} | changes).cases()
    body = mesh_case(case, ("y",) if tool else ("x", "y"), MPI.COMM_SELF)
    with Spaces(body) as spaces:
        problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, case.way.element, tool=tool or tool_of(case))
        yield problem, law_of(case), movement_of(case)


@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_nothing_pulls_and_nothing_comes_through(element):
    with pressed(material={"poisson": 0.45}, mesh=COARSE | {"element": element}) as (problem, law, movement):
        solution = problem.solve(law, movement)
    state, active, obstacle = (
        problem.constraint.contact.smooth.state,
        problem.constraint.contact.smooth.active,
        problem.constraint.contact.obstacle,
    )
    apart = obstacle.bounds - state.moved
    assert (state.reactions[active & ~obstacle.candidates.is_corner] < 0).all()
    assert np.abs(state.reactions[~active]).max() < 1e-6 * solution.reaction[2]
    assert apart.min() > -1e-9 * obstacle.depth
    assert np.abs(apart[active]).max() < 1e-9 * obstacle.depth
    assert solution.balance < 1e-6


def swept(mesh, depths, probe=SPHERE, body=LARGE, **changes):
    """Return the records of depths (mm) of a tool on one mesh."""
    ends = {"mesh_depths": [f"{d:.6g} mm" for d in (depths[0], depths[-1])]} | probe
    ends["depth"] = [f"{d:.6g} mm" for d in depths]
    found = solve(body=body, probe=ends, mesh=COARSE | {"fine": "20 mm", "coarse": "20 mm"} | mesh, **changes)
    return list(found.values())


def test_contact_radius_grows_smoothly_with_depth():
    """Hertz: a² = R d, within 3 % on meshes of one and a half to five elements a radius, also between nodes."""
    depths = np.geomspace(0.02e-3, 0.2e-3, 25)
    found = swept({"rim": "0.3 mm"}, 1e3 * depths)
    radii = np.array([record.contact_radius for record in found])
    ratio = radii / np.sqrt(10e-3 * depths)
    assert np.abs(ratio - 1).max() < 0.03
    assert np.abs(ratio[radii > 4 * 0.3e-3] - 1).max() < 0.01  # four elements
    assert (np.diff(radii) > 0).all()
    assert np.abs(np.diff(ratio)).max() < 0.025
    bars = np.array([record.contact_area_error for record in found])
    assert (np.abs(ratio**2 - 1) < bars).all()
    assert bars.max() < 0.25


@pytest.mark.parametrize("degree", [2, 3])
def test_contact_on_few_nodes_has_an_error_bar_that_tells_how_coarse_its_elements_are(degree):
    """A cone that touches four nodes: Sneddon's force, corrected for the finite body."""
    (found,) = swept({"rim": "0.3 mm", "degree": degree}, [0.02], CONE | {"mesh_depths": ["0.02 mm", "0.2 mm"]})
    exact = known.half_space_cone(10e3, 0.3, radians(86), 0.02e-3)
    assert abs(found.force / exact - 1) < found.force_error < 0.2


def test_small_depths_on_the_mesh_of_a_range_have_bars_and_areas_that_are_worth_something():
    """A ball on a column little wider than the ball, on elements as large as its contact."""
    depths = [0.05e-3, 0.1e-3, 0.2e-3, 0.4e-3]
    ball = {"shape": "sphere", "radius": "4 mm", "mesh_depths": ["0.02 mm", "0.4 mm"]}
    body = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"}
    column = {"epsilon": "4.5 mm", "outside": "free", "fine": "1 mm", "coarse": "6 mm", "rim": "0.6 mm", "growth": 0.8}
    found = swept(column, [1e3 * depth for depth in depths], ball, body)
    assert all(record.status == "ok" for record in found)
    assert max(record.force_error for record in found) < 0.15
    for depth, record in zip(depths, found, strict=True):  # a column is softer than a body: contact is smaller
        assert 0.8 < record.contact_radius / sqrt(4e-3 * depth) < 1.0


def test_flat_probe_that_does_not_lift_off_is_the_frictionless_one():
    assert record(probe=DISC).force == pytest.approx(record(probe=DISC | {"contact": "frictionless"}).force, rel=1e-8)


def test_face_that_is_inclined_lifts_off_on_one_side():
    """If it stuck to the surface, tilting would add no force: tension on one side, pressure on the other."""
    inclined = Tool(lambda points: 0.15 * points[:, 0], lambda points: np.ones(len(points), dtype=bool))
    with pressed(inclined, probe=DISC) as (problem, law, movement):
        force = problem.solve(law, movement).reaction[2]
    touching = problem.constraint.contact.obstacle.candidates.points[problem.constraint.contact.smooth.active, 0]
    assert touching.min() < -0.95e-3
    assert 0.0 < touching.max() < 0.9e-3
    assert force > record(probe=DISC).force


def test_direct_and_iterative_agree():
    direct, iterative = (record(solve={"method": method}).force for method in ("direct", "iterative"))
    assert iterative == pytest.approx(direct, rel=3e-8)


def test_force_is_proportional_to_the_modulus_and_not_to_the_depth():
    softer, stiffer = (record(material={"young": young}).force for young in ("10 kPa", "23 kPa"))
    assert stiffer == pytest.approx(2.3 * softer, rel=1e-9)
    deeper = record(probe=SPHERE | {"depth": "0.2 mm"})
    assert deeper.force > 2.5 * softer


def test_mixed_elements_agree_and_take_incompressible_tissue():
    mixed, plain = (
        record(material={"poisson": 0.45}, mesh={"element": element}) for element in ("mixed", "displacement")
    )
    assert mixed.force == pytest.approx(plain.force, rel=mixed.force_error + plain.force_error)
    assert mixed.force < record(material={"poisson": 0.5}).force < 1.5 * mixed.force


@pytest.mark.parametrize(
    "scene",
    {
        "tilted on an ellipsoid": {
            "body": {"shape": "ellipsoid", "axes": ["8 mm", "7 mm", "6 mm"], "fixed": {"below": "-2 mm"}},
            "probe": {"shape": "sphere", "radius": "3 mm", "depth": "0.1 mm", "axis": [0.08, 0.0, -1.0]},
        },
        "layers": {"body": SMALL | {"layer": [
            {"name": "skin", "thickness": "0.6 mm", "young": "40 kPa", "poisson": 0.3},
        ]}},
    }.values(),
)  # fmt: skip
def test_error_bar_holds_a_finer_mesh(scene):
    coarse, fine = (record(mesh={"rim": rim}, **scene) for rim in ("0.3 mm", "0.15 mm"))
    assert coarse.force == pytest.approx(fine.force, rel=coarse.force_error + fine.force_error)
    assert fine.force_error < coarse.force_error < 0.1


def test_contact_that_is_cut_off_is_refused():
    ball = Tool(lambda x: (x[:, :2] ** 2).sum(axis=1) / 40e-3, lambda x: np.zeros(len(x), dtype=bool))
    with pressed(ball, probe=DISC) as (problem, law, movement), pytest.raises(ContactError, match="reaches the edge"):
        problem.solve(law, movement)


def test_candidates_may_be_on_the_support_unless_they_become_active():
    """In a fixed column narrower than the candidates F is the axisymmetric one; a tool that reaches its side fails."""
    column = {"epsilon": "1.6 mm", "outside": "fixed"}
    known = solve(body=SMALL, probe=SPHERE, mesh=COARSE | column, plan={"without": []})[()]
    found = record(mesh=column)
    assert known.origin == "axisymmetric"
    assert found.force == pytest.approx(known.force, rel=found.force_error)
    flat = Tool(lambda x: np.zeros(len(x)), lambda x: np.ones(len(x), dtype=bool))
    with (
        pressed(flat, mesh=COARSE | column) as (problem, law, movement),
        pytest.raises(ContactError, match="reaches the fixed part"),
    ):
        problem.solve(law, movement)


def test_a_fixed_column_must_be_wider_than_the_tool_at_the_surface():
    """The study is refused exactly where a run would fail: 10 mm - (10² - r²)^½ = 0.1 mm at r = 1.411 mm."""
    for model in ("auto", "3d"):
        mesh = COARSE | {"outside": "fixed", "rim": "0.2 mm", "model": model}
        (found,) = solve(body=SMALL, probe=SPHERE, mesh=mesh | {"epsilon": "1.413 mm"}, plan={"without": []}).values()
        assert found.status == "ok", found.message
        with pytest.raises(StudyError, match=r'epsilon = "1.41 mm": .* the sphere reaches it; must be above 1.411 mm'):
            study(body=SMALL, probe=SPHERE, mesh=mesh | {"epsilon": "1.41 mm"})


@pytest.mark.parametrize(
    ("probe", "poisson"),
    [
        (SPHERE, 0.3),
        pytest.param(CONE | {"depth": "0.07 mm"}, 0.49, marks=pytest.mark.nightly),
        pytest.param(DISC, 0.3, marks=pytest.mark.nightly),
    ],
    ids=["sphere", "cone", "disc"],
)
def test_degree_3_holds_the_force_of_the_meridian_and_is_nearer_to_it(probe, poisson):
    scene = {"probe": probe, "material": {"poisson": poisson}}
    (truth,) = solve(body=SMALL, mesh=COARSE, plan={"without": []}, **scene).values()
    assert truth.origin == "axisymmetric"
    lower, higher = (record(mesh={"degree": degree}, **scene) for degree in (2, 3))
    errors = [abs(found.force / truth.force - 1) for found in (lower, higher)]
    assert errors[1] < min(0.3 * errors[0], higher.force_error)
    assert higher.force_error < lower.force_error
    assert abs(higher.contact_area / truth.contact_area - 1) < higher.contact_area_error


@pytest.mark.mpi
@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_ranks_agree(poisson):
    material = {"poisson": poisson}
    together, alone = (record(comm, material=material) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    together = MPI.COMM_WORLD.bcast(together)
    assert together.force == pytest.approx(alone.force, rel=3e-8)
    assert together.contact_area == pytest.approx(alone.contact_area, rel=1e-6)
    assert together.force_error == pytest.approx(alone.force_error, rel=0.05)


def test_the_required_accuracy_is_reached():
    """Off the axis of its body, on a three-dimensional mesh; the truth is approximately that on the axis."""
    (found,) = solve(
        body=LARGE, probe=SPHERE | {"at": ["1 mm", "0 mm"]},
        mesh={"accuracy": "2 %"} | dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree")),
    ).values()  # fmt: skip
    assert found.status == "ok", found.message
    assert found.force_error < 0.02
    hertz = known.half_space_ball(10e3, 0.3, 10e-3, 0.1e-3)
    assert found.force == pytest.approx(1.013 * hertz, rel=found.force_error)


def tilted(degrees, depth=0.3, law="linear", rim=0.3, comm=MPI.COMM_SELF, material=None, **probe):
    """Return the record of a ball of 5 mm, pressed into a flat face along an axis at an angle to its normal."""
    tool = SPHERE | {"radius": "5 mm", "depth": f"{depth} mm", "axis": [-tan(radians(degrees)), 0, -1]} | probe
    body = {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"]}
    mesh = {"fine": "6 mm", "coarse": "6 mm", "rim": f"{rim} mm"}
    return record(comm, mesh, body=body, probe=tool, material={"law": law} | (material or {}))


# The touch must be well within the region that is searched: the more a tool is tilted, the deeper, and 45° are refused.
DEPTHS = {5: (0.2, 0.3), 17: (0.6, 0.6), 30: (1.5, 1.0), 44: (2.5, 1.2)}


@pytest.mark.parametrize("degrees", DEPTHS)
def test_tilted_ball_presses_across_the_surface_as_deep_as_it_is_below_it(degrees):
    """A ball has no axis: its force is that of the upright one at its depth below the face, and across the face."""
    (depth, rim), cosine = DEPTHS[degrees], cos(radians(degrees))
    found, upright = tilted(degrees, depth, rim=rim), tilted(0, depth * cosine, rim=rim)
    aside, along, normal = found.force_vector
    assert normal == pytest.approx(upright.force, rel=found.force_error + upright.force_error)
    assert normal == pytest.approx(upright.force, rel=0.02)
    assert hypot(aside, along) < 1e-5 * normal
    assert found.force == pytest.approx(normal * cosine, rel=1e-5)
    assert found.contact_area / cosine == pytest.approx(upright.contact_area, rel=0.06)
    assert found.balance < 1e-6
    assert abs(aside) <= found.force_vector_error[0] < 0.1 * normal
    assert found.force_vector_error[2] == pytest.approx(found.force_error * normal, rel=1e-6)


@pytest.mark.parametrize("degrees", [pytest.param(5, marks=pytest.mark.nightly), 17])
def test_tilted_ball_with_little_friction_is_the_one_without(degrees):
    depth, rim = DEPTHS[degrees]
    rubbing, smooth = tilted(degrees, depth, rim=rim, friction=1e-6), tilted(degrees, depth, rim=rim)
    assert rubbing.force == pytest.approx(smooth.force, rel=1e-4)


def test_tilt_within_the_threshold_has_a_force_along_the_axis_whose_bars_cover_the_direction():
    below, above = tilted(1.9, 0.2), tilted(2.1, 0.2)
    assert below.force_vector[0] > 0.03 * below.force
    assert below.force_vector[0] < below.force_vector_error[0] < 0.04 * below.force
    assert below.force == pytest.approx(above.force, rel=0.01)


@pytest.mark.parametrize(
    "friction", [pytest.param(0.0, marks=pytest.mark.nightly), 0.3, pytest.param("stick", marks=pytest.mark.nightly)]
)
def test_tilted_ball_of_a_linear_law_is_that_of_small_strains(friction):
    """A law of large displacements has the normal of the deformed surface, and the tool that drags it aside."""
    linear, large = (tilted(8, 0.1, law, friction=friction) for law in ("linear", "neo-hookean"))
    assert linear.force == pytest.approx(large.force, rel=0.01)
    assert linear.force_vector == pytest.approx(large.force_vector, abs=0.01 * large.force)
    assert (linear.force_vector[0] > 0.05 * linear.force) == bool(friction)


def test_tilted_ball_on_a_surface_that_loads_move():
    load = {"gravity": ["2 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
    tool = SPHERE | {"radius": "5 mm", "depth": "0.1 mm", "axis": [-0.14, 0, -1]}
    scene = {"body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"]}, "probe": tool, "load": load}
    linear, large = (
        record(mesh={"fine": "6 mm", "coarse": "6 mm"}, material={"law": law, "density": "1060 kg/m^3"}, **scene)
        for law in ("linear", "neo-hookean")
    )
    assert linear.sag == pytest.approx(large.sag, rel=0.02)
    assert linear.force == pytest.approx(large.force, rel=0.02)


def test_fixed_axis_on_a_curved_body():
    """A ball that comes down beside the top of an ellipsoid presses along the surface's normal there."""
    body = {"shape": "ellipsoid", "axes": ["24 mm", "24 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
    tool = SPHERE | {"radius": "5 mm", "depth": "0.3 mm", "at": ["4 mm", "2 mm"], "axis": [0, 0, -1]}
    linear, large = (
        record(mesh={"fine": "6 mm", "coarse": "6 mm"}, body=body, probe=tool, material={"law": w}) for w in LAWS
    )
    x, y, z = linear.force_vector
    assert y / x == pytest.approx(0.5, rel=0.01)
    assert 0.1 < x / z < 0.2
    assert linear.force == pytest.approx(large.force, rel=linear.force_error + large.force_error)
    assert linear.force_vector[0] == pytest.approx(large.force_vector[0], abs=0.02 * large.force)


@pytest.mark.parametrize("material", [pytest.param({"young": "30 kPa"}, marks=pytest.mark.nightly), {"poisson": 0.49}])
def test_force_of_a_tilted_ball_of_other_tissue(material):
    """Without the reduction it is proportional to the modulus; incompressible tissue has mixed elements."""
    found, upright = tilted(8, 0.2, material=material), tilted(0, 0.2 * cos(radians(8)), material=material)
    assert found.force_vector[2] == pytest.approx(upright.force, rel=0.02)
    assert abs(found.force_vector[0]) < 1e-5 * found.force


@pytest.mark.mpi
def test_tilted_ball_is_the_same_on_any_number_of_ranks():
    alone, shared = tilted(8, 0.2), tilted(8, 0.2, comm=MPI.COMM_WORLD)
    assert shared.force == pytest.approx(alone.force, rel=1e-3)
    assert shared.force_vector[0] == pytest.approx(0.0, abs=1e-5 * alone.force)
