"""Operators made of tensors of the reference cell are those that dolfinx makes of forms, entry by entry."""

from functools import partial

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.mesh.distribute import distribute
from pipeline.mesh.generate import MeshArrays
from pipeline.solve.compiled import vector_space
from pipeline.solve.conditions import Conditions
from pipeline.solve.displacement import DisplacementProblem
from pipeline.solve.forms import curved_cells
from pipeline.solve.mixed import MixedProblem
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.spaces import ElasticSpace, Spaces
from pipeline.solve.straight import DEGREES, suits
from pipeline.solve.straight.pattern import pattern
from tests.solve.test_mixed import PRESS, law, make_mesh

EVERY = pytest.mark.parametrize("degree", DEGREES)


def assert_equal(found: PETSc.Mat, wanted: PETSc.Mat) -> None:
    size = wanted.norm(PETSc.NormType.INFINITY)
    difference = wanted.copy()
    difference.axpy(-1.0, found)
    assert difference.norm(PETSc.NormType.INFINITY) <= 1e-12 * size
    assert found.getInfo()["nz_used"] == wanted.getInfo()["nz_used"]


@EVERY
@pytest.mark.parametrize("mirrors", [(), ("x", "y")])
@pytest.mark.parametrize(("bonded", "mat_type"), [(True, "baij"), (False, "baij"), (True, "aij")])
def test_stiffness_is_that_of_the_form(degree, mirrors, bonded, mat_type):
    mesh = make_mesh(mirrors=mirrors)
    curved = curved_cells(mesh.mesh)
    assert curved.any()
    assert not curved.all()
    space = ElasticSpace(mesh, degree, Conditions(bonded))
    assert suits(space.dofs.space)
    for pair in ((1.7, 0.9), (0.3, 2.0)):  # the second takes the first one's place
        with space.operators.lend(pair, blocked=mat_type == "baij") as (matrix, _):
            space.forms.set_lame(*pair)
            wanted = compat.assemble_matrix(space.forms.stiffness, space.dofs.dirichlet, pair[1], mat_type)
            assert_equal(matrix, wanted)
            diagonal = matrix.getDiagonal().array[space.dofs.prescribed]
            assert np.all(diagonal == pair[1])
    space.operators.close()


@EVERY
def test_stiffness_without_curved_cells(degree):
    mesh = make_mesh(mesh={"degree": 1})
    assert curved_cells(mesh.mesh) is None
    space = ElasticSpace(mesh, degree, Conditions())
    with space.operators.lend((2.0, 1.0), blocked=True) as (matrix, _):
        space.forms.set_lame(2.0, 1.0)
        assert_equal(matrix, compat.assemble_matrix(space.forms.stiffness, space.dofs.dirichlet, 1.0, "baij"))


@pytest.mark.mpi
@pytest.mark.parametrize("shared", [False, True])
def test_what_is_lent_stays_as_it_is(shared):
    """An operator is its borrower's: those made after it are others, until it is given back."""
    space = ElasticSpace(make_mesh(MPI.COMM_WORLD), 2, Conditions())
    lend = partial(space.operators.lend, blocked=True, shared=shared)
    with lend((2.0, 1.0)) as (first, _):
        before = first.norm()
        with lend((5.0, 1.0)) as (second, _):
            assert second.handle != first.handle
            assert second.norm() != before
        assert first.norm() == before
        space.operators.close()
        assert first.norm() == before


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_what_pressures_take_part_in_is_that_of_the_forms(degree):
    mesh = make_mesh()
    space = MixedSpace(mesh, ElasticSpace(mesh, degree, Conditions()))
    for found, form in zip(space._matrices(mesh), (space.forms.mass, space.forms.coupling), strict=True):
        assert_equal(found, compat.assemble_matrix(form, [], 1.0, "aij"))


def test_a_point_of_very_many_cells():
    """The number of cells that a pair of points shares is counted in no small integer."""
    count = 512  # a fan around the edge from (0, 0, 0) to (0, 0, 1)
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    points = np.vstack([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], ring])
    around = np.arange(count)
    cells = np.stack([np.zeros(count), np.ones(count), 2 + around, 2 + (around + 1) % count], axis=1).astype(np.int64)
    body = distribute(MPI.COMM_SELF, MeshArrays(points, cells, {"fixed": cells[:1, 1:]}, np.array([0]), 0.0))
    space = vector_space(body.mesh, 2)
    found = pattern(space, space)
    dofs = compat.cell_dofs(space)
    assert np.array_equal(found.columns[found.places], np.broadcast_to(dofs[:, None, :], found.places.shape))
    rows = np.searchsorted(found.offsets, found.places, side="right") - 1
    assert np.array_equal(rows, np.broadcast_to(dofs[:, :, None], found.places.shape))


@pytest.mark.mpi
@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="several processes leave the assembly to dolfinx")
@pytest.mark.parametrize(("kind", "poisson"), [(DisplacementProblem, 0.3), (MixedProblem, 0.49)])
def test_force_is_that_of_several_processes(kind, poisson):
    forces = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        with Spaces(make_mesh(comm)) as spaces, kind(spaces, 2, Conditions()) as problem:
            assert suits(spaces.get(2, Conditions()).dofs.space) == (comm.size == 1)
            forces.append(problem.solve(law(poisson), PRESS, method="iterative", estimate=True))
    alone, together = forces
    assert together.reaction[2] == pytest.approx(alone.reaction[2], rel=1e-9)
    assert together.bar == pytest.approx(alone.bar, rel=0.05)
