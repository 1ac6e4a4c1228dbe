"""Operators from tensors of the reference cell agree with dolfinx's forms."""

from contextlib import ExitStack

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.generate import MeshArrays
from epsmesh.solve.compiled import vector, vector_space
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.forms import ElasticForms
from epsmesh.solve.kernels.assembly import StraightStiffness
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import ElasticSpace, Spaces
from tests.sampling import sampled
from tests.solve.test_mixed import PRESS, law, make_mesh
from tests.solve.test_regions import SKIN


@pytest.mark.mpi
def test_what_is_lent_stays_as_it_is():
    """A borrower may change an operator: those lent later are unaffected."""
    space = ElasticSpace(make_mesh(MPI.COMM_WORLD), 2, Conditions())
    with space.lend(MaterialLaw.of(2.0, 1.0)) as first:
        before = first.norm()
        with space.lend(MaterialLaw.of(5.0, 1.0)) as second:
            assert second.norm() != before
            second.scale(2.0)
        assert first.norm() == before


def test_a_point_of_very_many_cells():
    """The number of cells that share a pair of points must not overflow a small integer."""
    count = 512  # a fan around the edge from (0, 0, 0) to (0, 0, 1)
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    points = np.vstack([[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], ring])
    around = np.arange(count)
    cells = np.stack([np.zeros(count), np.ones(count), 2 + around, 2 + (around + 1) % count], axis=1).astype(np.int64)
    body = distribute(MPI.COMM_SELF, MeshArrays(points, cells, {"fixed": cells[:1, 1:]}, np.array([0]), 0.0))
    space = vector_space(body.mesh, 2)
    material, made = MaterialLaw.of(2.0, 1.0), ElasticForms(space)
    made.set_law(material)
    ours = StraightStiffness(space, None).matrix(material, np.empty(0, dtype=np.int32), 1.0)
    theirs = compat.assemble_matrix(made.stiffness, [], 1.0)
    size = theirs.norm()
    theirs.axpy(-1.0, ours)
    assert theirs.norm() < 1e-13 * size


@pytest.mark.mpi
@pytest.mark.parametrize("kernel", [True, False])
@pytest.mark.parametrize(
    ("degree", "mirrors", "changes"),
    [
        (1, ("x", "y"), {}),
        (2, (), {}),
        (3, ("x", "y"), {}),
        (2, ("x", "y"), {"mesh": {"degree": 1}}),  # without curved cells
        (2, ("x", "y"), {"body": {"layer": [SKIN]}}),
    ],
)
def test_operators_are_those_that_dolfinx_assembles(degree, mirrors, changes, kernel, monkeypatch):
    """On one rank and on several, whose cells add to rows of others; with the same kernel, and with forms alone."""
    mesh = make_mesh(MPI.COMM_WORLD, mirrors, **changes)
    space, other = (ElasticSpace(mesh, degree, Conditions(bonded=False)) for _ in range(2))
    material = MaterialLaw.of((2.0, 5.0), (1.0, 0.7)) if mesh.regions is not None else MaterialLaw.of(2.0, 1.0)
    if not kernel:
        monkeypatch.setattr(ElasticForms, "_kernels", lambda forms: {})
    other.forms.set_law(material)
    with ExitStack() as stack:
        theirs = compat.assemble_matrix(other.forms.stiffness, other.dirichlet, material.lame_mu[0])
        monkeypatch.undo()
        stack.callback(theirs.destroy)
        ours = stack.enter_context(space.lend(material))
        x, y, z = (stack.enter_context(vector(space.space)) for _ in range(3))
        x.array[:] = np.sin(np.arange(*x.getOwnershipRange()))
        ours.mult(x, y)
        theirs.mult(x, z)
        assert (y - z).norm() < 1e-12 * z.norm()
        assert ours.getType() == theirs.getType() and ours.getBlockSize() == theirs.getBlockSize() == 3
        if degree > 1:  # the matrix-free product agrees, too
            product = stack.enter_context(space.lend(material, entries=False))
            x.array[space.prescribed_owned] = 0.0
            product.mult(x, y)
            theirs.mult(x, z)
            y.array[space.prescribed_owned] = z.array[space.prescribed_owned]
            assert (y - z).norm() < 1e-12 * z.norm()
        assert ours.getInfo()["nz_used"] == theirs.getInfo()["nz_used"]
        size = theirs.norm()
        theirs.axpy(-1.0, ours)
        assert theirs.norm() < (1e-14 if kernel else 1e-13) * size


@pytest.mark.mpi
@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="for several processes")
@sampled(
    "kind, degree, poisson, bonded, mirrors, changes, method",
    [
        (*scene, method)
        for method in ("direct", "iterative")
        for scene in (
            ("displacement", 1, 0.3, True, ("x", "y"), {}),
            ("displacement", 2, 0.3, True, ("x", "y"), {}),
            ("displacement", 2, 0.49, False, ("x", "y"), {}),
            ("displacement", 2, 0.3, False, (), {}),
            ("displacement", 3, 0.45, True, ("x", "y"), {}),
            ("displacement", 2, 0.3, True, ("x", "y"), {"mesh": {"degree": 1}}),  # without curved cells
            ("mixed", 2, 0.49, True, ("x", "y"), {}),
            ("mixed", 2, 0.5, False, ("x", "y"), {}),
            ("mixed", 3, 0.5, True, ("x", "y"), {}),
        )
    ],
    by_day=7,
)
def test_solutions_of_several_ranks_are_those_of_one(kind, degree, poisson, bonded, mirrors, changes, method):
    """Compared with one process: force, energy and the error bar, on curved and on straight cells."""
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        mesh = make_mesh(comm, mirrors, **changes)
        with Spaces(mesh) as spaces, QuasiStaticProblem(spaces, degree, Conditions(bonded), kind) as problem:
            found.append(problem.solve(law(poisson), PRESS, method=method, tolerance=1e-8, estimate=True))
    alone, together = found
    assert together.reaction[2] == pytest.approx(alone.reaction[2], rel=1e-9)
    assert together.energy == pytest.approx(alone.energy, rel=1e-9)
    assert together.max_strain == pytest.approx(alone.max_strain, rel=1e-4)
    assert together.bar == pytest.approx(alone.bar, rel=0.05)
