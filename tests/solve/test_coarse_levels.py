"""Levels of multigrid on the meshes from which a mesh was cut: as good as algebraic ones, on any number of ranks."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.mesh.curve import EDGES
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import conditions_of, law_of, movement_of
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.kernels.cells import Ghosts
from epsmesh.solve.kernels.multigrid import interpolation
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import ElasticSpace, Spaces
from tests.cases import solve, study
from tests.mesh.test_refine import CYLINDER, OFF, SKIN, refining

WORLD = MPI.COMM_WORLD
MESH = {"fine": "4 mm", "rim": "0.5 mm", "growth": 0.6}
STIFF = SKIN | {"young": "2 MPa"}
SCENES = {
    "disc": {"probe": OFF},
    "nearly incompressible": {"probe": OFF, "material": {"poisson": 0.49}, "mesh": {"element": "displacement"}},
    "incompressible": {"probe": OFF, "material": {"poisson": 0.5}},
    "degree 3": {"probe": OFF, "mesh": {"degree": 3}},
    "curved sides": {"body": CYLINDER, "probe": OFF},
    "stiff layer": {"body": {"layer": [STIFF]}, "probe": OFF},
    "stiffness varies": {"material": {"young": {"formula": "10 kPa * (1 + 40 * exp(-(x/(5 mm))^2))"}}, "probe": OFF},
}
BY_DAY = [("disc", 2), ("curved sides", 1)]
OTHERS = [(name, times) for name in SCENES for times in (1, 2) if (name, times) not in BY_DAY]


def with_mesh(changes):
    return changes | {"mesh": MESH | changes.get("mesh", {})}


def levels_of(comm, times):
    """Return the spaces of a mesh refined so many times, coarsest first, those of degree 1 last."""
    with refining(times):
        mesh = mesh_case(study(**with_mesh({"body": CYLINDER, "probe": OFF})).case(()), (), comm)
    space = Spaces(mesh).get(1, Conditions())
    return [*space.coarser, space]


@pytest.mark.mpi
@pytest.mark.parametrize("times", [1, 2])
def test_linear_fields_are_carried_over_where_an_edge_is_halved(times):
    spaces = levels_of(WORLD, times)
    assert len(spaces) == 1 + times
    for coarse, fine in pairwise(spaces):
        places, finer = (np.asarray(each.space.tabulate_dof_coordinates()) for each in (coarse, fine))
        owned, own = (Ghosts(each.space).owned for each in (coarse, fine))
        corners = places[compat.cell_dofs(coarse.space)[: len(coarse.children)]]
        assert np.abs(finer[coarse.children[:, :4]] - corners).max(initial=0.0) < 1e-12
        ends = corners[:, EDGES]
        middle, length = ends.mean(axis=2), np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2)
        off = np.linalg.norm(finer[coarse.children[:, 4:]] - middle, axis=2) / length
        off = np.concatenate(WORLD.allgather(off))
        assert off.max() < 0.5 and off.mean() < 0.1  # sides are curved, sizes graded, points smoothed
        free = [Level(each.space, None, np.zeros(0, np.int32), children=each.children) for each in (coarse, fine)]
        found = np.zeros(3 * own, dtype=np.float32)
        interpolation(*free).prolong(1e3 * places[:owned].reshape(-1).astype(np.float32), found)
        wanted = np.full((len(finer), 3), np.nan)
        wanted[coarse.children[:, 4:]] = middle
        wanted[coarse.children[:, :4]] = corners
        assert np.abs(found.reshape(-1, 3) - 1e3 * wanted[:own]).max(initial=0.0) < 1e-3


@pytest.mark.mpi
@pytest.mark.parametrize("times", [1, 2])
def test_prescribed_displacements_are_those_of_the_finest_mesh(times):
    *coarser, finest = levels_of(WORLD, times)
    wanted = held_places(finest)
    for coarse in coarser:
        found = held_places(coarse)
        every = {tuple(place) for place in np.round(1e9 * gathered(coarse, slice(None))).astype(int).tolist()}
        assert found and found == wanted & every


def gathered(side, dofs):
    """Return the places (n, 3) of dofs (unrolled) of a space, on every rank."""
    places = np.repeat(np.asarray(side.space.tabulate_dof_coordinates()), 3, axis=0)[dofs]
    return np.concatenate(WORLD.allgather(places))


def held_places(side):
    """Return the places, in nm, where a displacement is prescribed."""
    return {tuple(place) for place in np.round(1e9 * gathered(side, side.prescribed)).astype(int).tolist()}


@pytest.mark.parametrize(
    ("name", "times"), BY_DAY + [pytest.param(*each, marks=pytest.mark.nightly) for each in OTHERS]
)
def test_the_force_is_that_of_algebraic_levels_in_as_many_iterations(name, times, monkeypatch):
    with refining(times):
        found = solve(**with_mesh(SCENES[name]))[()]
        monkeypatch.setattr(ElasticSpace, "coarser", [])
        known = solve(**with_mesh(SCENES[name]))[()]
    assert found.force == pytest.approx(known.force, rel=1e-9)
    assert found.force_error == pytest.approx(known.force_error, rel=0.02)
    assert found.iterations <= 1.25 * known.iterations + 1


def test_iterations_do_not_grow_from_one_refinement_to_the_next():
    counts = []
    for times in (1, 2):
        with refining(times):
            counts.append(solve(probe=OFF, mesh=MESH | {"fine": f"{7 / 2**times} mm"})[()].iterations)
    assert counts[1] <= counts[0] + 2


@pytest.mark.mpi
@pytest.mark.parametrize("times", [1, 2])
def test_ranks_have_the_same_levels(times):
    found = []
    case = study(**with_mesh(SCENES["stiff layer" if times == 1 else "disc"])).case(())
    for comm in (MPI.COMM_SELF, WORLD):
        with refining(times):
            mesh = mesh_case(case, (), comm)
        with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, 2, conditions_of(case)) as problem:
            run = partial(problem.solve, law_of(case), movement_of(case), method="iterative")
            solution, levels = run(), spaces.get(1, conditions_of(case)).coarser
        sizes = [each.space.dofmap.index_map.size_global for each in levels]
        found.append((solution.reaction[2], solution.iterations, sizes))
    (force, iterations, sizes), (on_ranks, counted, same) = found
    assert len(sizes) == times and sizes == same
    assert on_ranks == pytest.approx(force, rel=1e-9)
    assert counted == pytest.approx(iterations, rel=0.1)  # algebraic levels coarsen each rank's part by itself
