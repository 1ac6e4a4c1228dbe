"""Mechanics of mixed elements up to and including ν = ½, and coverage of their bars."""

from dataclasses import replace
from typing import Any

import pytest
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.meshing import mesh_case
from epsmesh.solve import SolveError
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.estimate import error_bar
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from tests.cases import study
from tests.sampling import sampled
from tests.verification import known

DEPTH = 0.2e-3
YOUNG = 10e3
QUARTER = ("x", "y")
# The range of Poisson's ratio for mixed elements.
EXACT = {(name, nu): value for (name, nu), value in known.CYLINDER.items() if nu >= 0.45}


PRESS = Movement.along((0.0, 0.0, -DEPTH))


def law(poisson: float, young: float = YOUNG) -> MaterialLaw:
    return MaterialLaw.of_moduli(young, poisson)


def make_mesh(comm: MPI.Comm = MPI.COMM_SELF, mirrors: tuple[str, ...] = QUARTER, **changes: Any) -> BodyMesh:
    body = mesh_case(study(**changes).case(()), mirrors, comm)
    return body


def solve(body: BodyMesh, poisson: float, degree: int = 2, *, bonded: bool = True, **options: Any) -> Solution:
    with QuasiStaticProblem(Spaces(body), degree, Conditions(bonded), "mixed") as mixed:
        return mixed.solve(law(poisson), PRESS, **options)


@sampled("name, poisson", EXACT, by_day=2)
def test_cylinder_is_within_the_bar(name, poisson):
    """The truth is within the bar, and the bar is narrow enough to be useful."""
    body = make_mesh(
        body=known.CYLINDER_BODY, mesh={"fine": "15 mm", "coarse": "15 mm", "rim": "0.5 mm", "growth": 0.5}
    )
    solution = solve(body, poisson, bonded=name == "bonded", estimate=True)
    error = solution.reaction[2] / (YOUNG * DEPTH * 1e-3) / EXACT[name, poisson] - 1
    assert abs(error) <= solution.bar <= 0.04


@pytest.mark.parametrize("degree", [2, 3])
def test_agrees_with_displacement_elements(degree):
    body = make_mesh(mesh={"rim": "0.5 mm"})
    mixed = solve(body, 0.4, degree, estimate=True)
    with QuasiStaticProblem(Spaces(body), degree, Conditions()) as elastic:
        other = elastic.solve(law(0.4), PRESS, estimate=True)
    bars = mixed.bar * mixed.reaction[2] + error_bar(other.decrement, degree) * other.reaction[2]
    assert mixed.reaction[2] == pytest.approx(other.reaction[2], abs=bars)
    assert mixed.reaction[2] != pytest.approx(other.reaction[2], rel=1e-6)
    assert mixed.max_strain == pytest.approx(other.max_strain, rel=0.1)


@pytest.mark.parametrize(("degree", "poisson", "bonded"), [(2, 0.4, False), (2, 0.5, True), (3, 0.5, False)])
def test_direct_and_iterative_agree(degree, poisson, bonded):
    body = make_mesh()
    direct, iterative = (
        solve(body, poisson, degree, bonded=bonded, method=method) for method in ("direct", "iterative")
    )
    assert iterative.reaction == pytest.approx(direct.reaction, rel=1e-9, abs=1e-9 * direct.reaction[2])
    assert iterative.energy == pytest.approx(direct.energy, rel=1e-9)
    assert direct.energy == pytest.approx(direct.reaction[2] * DEPTH / 2, rel=1e-9)
    assert direct.iterations == 1 < iterative.iterations


def test_degree_four():
    """On a mesh of its own size: the next degree is within the bar of this one."""
    body = make_mesh(mesh={"rim": "2 mm", "fine": "8 mm"})
    cubic = solve(body, 0.5, 3, estimate=True)
    direct, iterative = (solve(body, 0.5, 4, method=method).reaction[2] for method in ("direct", "iterative"))
    assert iterative == pytest.approx(direct, rel=1e-9)
    assert direct == pytest.approx(cubic.reaction[2], rel=cubic.bar)


def test_force_is_quadratic_in_the_tolerance():
    body = make_mesh()
    exact, loose = (solve(body, 0.499, method="iterative", tolerance=t) for t in (1e-10, 1e-7))
    assert loose.iterations < exact.iterations
    assert loose.reaction[2] == pytest.approx(exact.reaction[2], rel=1e-11)


def test_incompressible_is_the_limit():
    """F is linear in 1 - 2ν towards ½, on one mesh and with one assembly."""
    with QuasiStaticProblem(Spaces(make_mesh()), 2, Conditions(), "mixed") as body:
        near, nearer, limit = (body.solve(law(0.5 - x), PRESS).reaction[2] for x in (2e-5, 1e-5, 0.0))
    assert limit == pytest.approx(2 * nearer - near, rel=1e-8)
    assert limit == pytest.approx(near, rel=1e-4)


@pytest.mark.parametrize("bonded", [True, False])
def test_iterations_are_bounded(bonded):
    """With ν, and under refinement of the mesh."""
    counts, dofs = [], []
    for rim, fine in (("1 mm", "5 mm"), ("0.25 mm", "3 mm")):
        body = make_mesh(mesh={"rim": rim, "fine": fine, "growth": 0.5})
        with QuasiStaticProblem(Spaces(body), 2, Conditions(bonded), "mixed") as mixed:
            counts.append(
                [mixed.solve(law(nu), PRESS, method="iterative").iterations for nu in (0.4, 0.45, 0.4999, 0.5)]
            )
            dofs.append(mixed.dofs)
    assert dofs[1] > 3 * dofs[0]
    assert max(map(max, counts)) <= 30
    assert max(counts[1]) <= 1.3 * max(counts[0])


@pytest.mark.parametrize("method", ["direct", "iterative"])
def test_units_do_not_matter(method):
    """Neither units of E nor of length: every relative number is unchanged."""
    arrays = mesh_arrays(study().case(()), QUARTER)
    numbers = []
    for young, size in ((1e-3, 1.0), (YOUNG, 1.0), (1e12, 1.0), (YOUNG, 0.025), (YOUNG, 250.0)):
        body = distribute(MPI.COMM_SELF, replace(arrays, points=size * arrays.points))
        with QuasiStaticProblem(Spaces(body), 2, Conditions(), "mixed") as mixed:
            s = mixed.solve(law(0.4999, young), Movement.along((0.0, 0.0, -DEPTH * size)), method=method, estimate=True)
        unit = young * (DEPTH * size) * size
        numbers.append((s.reaction[2] / unit, s.energy / unit / (DEPTH * size), s.max_strain, s.decrement, s.bar))
    for other in numbers[1:]:
        assert other[:2] == pytest.approx(numbers[0][:2], rel=1e-8)
        assert other[2] == pytest.approx(numbers[0][2], rel=1e-6)  # linear in the solver's error
        assert other[3:] == pytest.approx(numbers[0][3:], rel=1e-3)


def test_small_ratios_are_refused():
    with pytest.raises(SolveError, match=r"above 0\.25"):
        solve(make_mesh(), 0.25)


def test_no_options_are_left_behind():
    before = PETSc.Options().getAll()
    solve(make_mesh(), 0.5, method="iterative", estimate=True)
    assert PETSc.Options().getAll() == before
