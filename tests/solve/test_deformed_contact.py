"""Contact at large displacements: the limit of small depths, equilibrium at the deformed place, and the energy."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.tools import tool_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.contact import contact_steps, large_solution
from epsmesh.solve.contact.deformed import solve_contact
from epsmesh.solve.contact.large_solution import LargeContactSolution
from epsmesh.solve.contact.turned import turned_frames
from epsmesh.solve.newton import LargeError
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from tests.cases import force, solve, study

SPHERE = {"shape": "sphere", "radius": "4 mm", "depth": "2 mm"}
TISSUE = {"law": "neo-hookean", "poisson": 0.4}
COARSE = {"rim": "1 mm", "fine": "4 mm", "coarse": "6 mm", "growth": 1.5}


def touched(depth, model=("x", "y"), base=SPHERE, **changes):
    """Return a solution, and its contact."""
    (case,) = study(**{"material": TISSUE, "probe": base | {"depth": depth}, "mesh": COARSE} | changes).cases()
    with Spaces(mesh_case(case, model, MPI.COMM_SELF)) as spaces:
        problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, case.way.element, tool=tool_of(case))
        found = {}
        check = LargeContactSolution.check

        def look(contact):
            found["forces"], found["gap"] = contact.touched.forces, contact.touched.gap
            found["active"], found["edge"] = contact.touched.active, contact.body.candidates.is_corner
            found["points"] = contact.body.positions()
            check(contact)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(LargeContactSolution, "check", look)
            solution = problem.solve(law_of(case), movement_of(case))
    return solution, found


def test_small_depths_are_linear():
    probe, mesh = SPHERE | {"depth": "0.02 mm"}, COARSE | {"rim": "0.25 mm"}
    linear = force(material={"poisson": 0.4}, probe=probe, mesh=mesh)
    assert force(material=TISSUE, probe=probe, mesh=mesh) == pytest.approx(linear, rel=3e-3)


@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_nodes_touch_the_ball_at_their_deformed_place_and_nothing_pulls(element):
    solution, found = touched("2 mm", mesh=COARSE | {"element": element})
    from_centre = found["points"] - [0.0, 0.0, 2e-3]
    distance = np.linalg.norm(from_centre, axis=1)
    active, forces = found["active"], found["forces"]
    assert distance[active] == pytest.approx(4e-3, rel=1e-9)
    assert distance[~active & ~found["edge"]].min() > 4e-3 * (1 - 1e-6)
    along_normal = (forces * from_centre).sum(axis=1) / distance
    assert (along_normal[active & ~found["edge"]] > 0).all()
    assert forces == pytest.approx(along_normal[:, None] * from_centre / distance[:, None], abs=1e-7 * forces.max())
    assert solution.reaction[2] == pytest.approx(-4 * forces[:, 2].sum())
    assert solution.balance < 1e-6


def test_corners_that_push_their_neighbours_out_do_not_enter_again():
    """On this mesh, corners enter with all their neighbours, which then pull and leave, and so forth."""
    body = {"size": ["60 mm", "60 mm", "40 mm"]}
    mesh = {"epsilon": "10 mm", "rim": "0.8 mm", "fine": "4 mm", "coarse": "8 mm", "growth": 1.0}
    _, found = touched("0.4 mm", body=body, mesh=mesh)
    judged = ~found["edge"]
    assert found["gap"][judged].min() > -1e-5 * 0.4e-3
    assert (found["forces"][judged, 2] <= 0).all()


def test_force_is_the_derivative_of_the_energy():
    probe = SPHERE | {"mesh_depths": ["1.98 mm", "2.02 mm"]}
    deep, deeper = (touched(f"{depth} mm", base=probe)[0] for depth in (1.98, 2.02))
    mean = (deep.reaction[2] + deeper.reaction[2]) / 2
    assert (deeper.energy - deep.energy) / 0.04e-3 == pytest.approx(mean, rel=1e-3)


def test_the_whole_is_the_quarter():
    quarter, _ = touched("2 mm")
    half, _ = touched("2 mm", ("y",))
    assert half.reaction[2] == pytest.approx(quarter.reaction[2], rel=0.02)  # another mesh
    assert np.abs(half.reaction[:2]).max() < 0.01 * half.reaction[2]


def test_a_depth_that_is_not_reached_is_partial_and_says_where(monkeypatch):
    def fails_beyond(tissue, tool, *others, **how):
        if tool.depth > 1.5e-3:
            raise LargeError("it is told to")
        return solve_contact(tissue, tool, *others, **how)

    monkeypatch.setattr(contact_steps, "solve_contact", fails_beyond)
    probe = SPHERE | {"mesh_depths": ["1 mm", "2 mm"]}
    (record,) = solve(material=TISSUE, probe=probe | {"depth": "2 mm"}, mesh=COARSE).values()
    assert record.status == "partial"
    assert 1.4e-3 < record.depth_reached <= 1.5e-3
    assert record.force_reached > 0
    assert f"reached {record.depth_reached * 1e3:.3g} mm of 2 mm" in record.message
    there = probe | {"depth": f"{record.depth_reached * 1e3:.12g} mm"}
    assert record.force_reached == pytest.approx(force(material=TISSUE, probe=there, mesh=COARSE), rel=1e-6)


def test_a_ball_pressed_in_to_its_equator_leaves_no_tissue_inside():
    """Newton's method from the undeformed body once ended around the ball, at a hundredth of the force."""
    solution, found = touched("3.9 mm", base=SPHERE | {"mesh_depths": ["3.5 mm", "3.9 mm"]})
    before, _ = touched("3.5 mm", base=SPHERE | {"mesh_depths": ["3.5 mm", "3.9 mm"]})
    assert found["gap"].min() > -0.1 * 3.9e-3
    assert 1.0 < solution.reaction[2] / before.reaction[2] < (3.9 / 3.5) ** 3


def test_the_bar_has_a_load_path_of_its_own_where_the_next_degree_does_not_settle_at_once(monkeypatch):
    def fails(*_, **__):
        raise LargeError("it is told to")

    scene = {"material": TISSUE, "probe": SPHERE, "mesh": COARSE}
    (expected,) = solve(**scene).values()
    monkeypatch.setattr(large_solution, "solve_contact", fails)
    (record,) = solve(**scene).values()
    assert record.status == "ok"
    assert record.force_error == pytest.approx(expected.force_error, rel=0.05)


def test_depths_on_a_path_have_the_forces_and_bars_of_each_alone():
    """The load path goes on from one depth to the next: from rest, a large one takes more steps."""
    depths = [f"{depth} mm" for depth in (0.5, 1.0, 1.5)]
    probe = SPHERE | {"depth": depths, "mesh_depths": ["0.5 mm", "1.5 mm"]}
    together = solve(material=TISSUE, probe=probe, mesh=COARSE).values()
    iterations = []
    for depth, one in zip(depths, together, strict=True):
        (alone,) = solve(material=TISSUE, probe=probe | {"depth": depth}, mesh=COARSE).values()
        assert one.force == pytest.approx(alone.force, rel=1e-7)
        assert one.force_error == pytest.approx(alone.force_error, rel=1e-2)
        iterations.append((one.iterations, alone.iterations))
    assert iterations[0][0] == iterations[0][1]
    assert iterations[-1][0] < iterations[-1][1]


def test_frames_keep_planes_of_symmetry():
    """A normal in the plane x = 0 leaves the x axis a tangent, and so for y; all frames are orthonormal."""
    generator = np.random.default_rng(5)
    normal = generator.normal(size=(50, 3))
    normal[:10, 0] = normal[10:20, 1] = 0.0
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    frames = turned_frames(normal, np.ones(50, dtype=bool))
    assert frames.swapaxes(1, 2) @ frames == pytest.approx(np.broadcast_to(np.eye(3), frames.shape), abs=1e-14)
    assert frames[:, :, 2] == pytest.approx(normal)
    assert frames[:10, :, 0] == pytest.approx(np.tile([1.0, 0.0, 0.0], (10, 1)))
    assert np.abs(frames[10:20, :, 1]) == pytest.approx(np.tile([0.0, 1.0, 0.0], (10, 1)))


@pytest.mark.mpi
@pytest.mark.parametrize("element", ["displacement", "mixed"])
def test_ranks_and_solvers_agree(element):
    forces = []
    for comm, method in ((MPI.COMM_WORLD, "auto"), (MPI.COMM_SELF, "auto"), (MPI.COMM_SELF, "direct")):
        (case,) = study(material=TISSUE, probe=SPHERE, mesh=COARSE | {"element": element}).cases()
        with Spaces(mesh_case(case, ("x", "y"), comm)) as spaces:
            problem = QuasiStaticProblem(spaces, 2, WITHOUT_FOOTPRINT, element, tool=tool_of(case))
            forces.append(problem.solve(law_of(case), movement_of(case), method=method).reaction[2])
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)
    assert forces[2] == pytest.approx(forces[1], rel=1e-7)


@pytest.mark.parametrize(
    "body",
    [
        {"shape": "ellipsoid", "axes": ["24 mm", "24 mm", "20 mm"], "fixed": {"below": "-8 mm"}},
        {"layer": [{"name": "skin", "thickness": "2 mm", "young": "30 kPa", "poisson": 0.4}]},
    ],
    ids=["curved", "skin"],
)
def test_bodies_are_linear_at_small_depths(body):
    probe, mesh = SPHERE | {"depth": "0.04 mm"}, COARSE | {"rim": "0.5 mm"}
    found = force(body=body, material=TISSUE, probe=probe, mesh=mesh)
    assert found == pytest.approx(force(body=body, material={"poisson": 0.4}, probe=probe, mesh=mesh), rel=0.01)


def test_a_contact_that_ends_with_the_wedge_is_found_at_large_displacements_too():
    """F is nearly that of linear elasticity. How much of the area lies beyond the ends is unknown."""
    wedge = {"shape": "wedge", "angle": "60 deg", "length": "6 mm", "tip": "0.5 mm", "edge": "0.3 mm"}
    wedge |= {"depth": "1 mm", "contact": "unilateral"}
    changes, laws = {"probe": wedge, "mesh": COARSE | {"rim": "0.3 mm"}}, ("linear", "neo-hookean")
    (linear,), (large,) = (solve(material=TISSUE | {"law": law}, **changes).values() for law in laws)
    assert large.status == "ok", large.message
    assert large.force == pytest.approx(linear.force, rel=0.1)
    assert np.isnan(large.contact_area_error)


def test_a_wedge_with_sharp_ends_has_a_bar_that_covers_what_slides_off_them():
    """On elements of a quarter of the size F is 3.8 % larger, and of one degree more only an eighth of that is seen."""
    wedge = {"shape": "wedge", "angle": "55.3 deg", "length": "4.76 mm", "tip": "0.96 mm", "depth": "0.792 mm"}
    body = {"shape": "cylinder", "radius": "16.448 mm", "height": "7.38 mm"}
    mesh = {"fine": "8 mm", "coarse": "10 mm", "rim": "0.4458 mm", "growth": 0.9, "degree": 2}
    tissue = {"poisson": 0.48, "law": "neo-hookean"}
    (found,) = solve(body=body, probe=wedge | {"contact": "unilateral"}, mesh=mesh, material=tissue).values()
    assert abs(found.force / 33.91e-3 - 1) < found.force_error < 0.1
