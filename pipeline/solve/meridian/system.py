"""What problems on the meridian share: the operator of all materials, and its factor."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray, Int32Array
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import Meridian, MeridianArrays
from pipeline.quantities import CLEAR
from pipeline.solve.krylov import SolveError
from pipeline.solve.meridian.forms import JoinedForms, MeridianForms
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# Later than in three dimensions (Mesh.MIXED_FROM, 0.45), since elements of degree 5 lock later than those of degree 2:
# on three scenes displacement elements differ from mixed ones by 5e-9 to 1e-8 at ν = 0.45 and by 2e-8 at 0.49, take
# half the time (0.3 s, not 0.65), and have bars of 3e-6 at most, where 1e-5 is asked for.
MIXED_FROM = 0.49
# Per cent of memory beyond MUMPS's estimate, which pivoting exceeds.
_SPARE_MEMORY = 100

# The half planes that are solved on.
HalfPlane = Meridian | EllipticMeridian
# Of each region of a body, by its number: its mesh and the facets of each group.
Meshes = dict[int, tuple[Any, dict[str, Int32Array]]]


class Unbalanced(SolveError):
    """Round-off has spoilt the solution."""


def forms_of(meshes: Meshes, degree: int, law: MaterialLaw) -> tuple[MeridianForms | JoinedForms, bool]:
    """Return the forms of all materials, in units of the μ of region 0, and whether their operator is definite."""
    parts, weights, definite = [], [], True
    for region, (mesh, facets) in meshes.items():
        tissue = law.parameters[region]
        mixed = tissue.poisson >= MIXED_FROM
        part = MeridianForms(mesh, facets, degree, mixed)
        part.set_ratio(tissue.ratio)
        parts.append(part)
        weights.append(tissue.lame_mu / law.parameters[0].lame_mu)
        definite = definite and not mixed
    return parts[0] if len(parts) == 1 and weights == [1.0] else JoinedForms(parts, weights), definite


@contextmanager
def factorised(matrix: sp.csr_matrix, *, definite: bool) -> Iterator[Callable[[FloatArray], FloatArray]]:
    """Factorise by MUMPS, Cholesky if ``definite``, else LDLᵀ with pivoting; lend the function that solves."""
    matrix.sort_indices()
    csr = matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data
    operator = PETSc.Mat().createAIJ(matrix.shape, csr=csr, comm=MPI.COMM_SELF)
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    right, left = operator.createVecs()

    def solve(load: FloatArray) -> FloatArray:
        left.array[:] = load
        ksp.solve(left, right)
        if ksp.getConvergedReason() <= 0:
            raise SolveError("the factorisation failed (out of memory, or the operator is singular)")
        return np.array(right.array)

    try:
        with stage("set-up"):
            operator.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            if definite:
                operator.setOption(PETSc.Mat.Option.SPD, True)
            ksp.setOperators(operator)
            ksp.setType("preonly")
            ksp.pc.setType("cholesky")
            ksp.pc.setFactorSolverType("mumps")
            ksp.pc.setFactorSetUpSolverType()
            ksp.pc.getFactorMatrix().setMumpsIcntl(14, _SPARE_MEMORY)
            ksp.setUp()
        yield solve
    except PETSc.Error as error:
        raise SolveError(f"the factorisation failed (PETSc error {error.ierr})") from error
    finally:
        for item in (left, right, ksp, operator):
            item.destroy()


def max_strain(forms: MeridianForms | JoinedForms, arrays: MeridianArrays) -> float:
    """Return the largest principal strain of a cell's mean strain, away from every singular point.

    It is that of the solution whose residual was last asked for.
    """
    strain, corners = forms.mean_strains()
    distance = np.linalg.norm(corners[:, :, None] - arrays.singular, axis=-1).min(axis=(1, 2))
    return float(strain[distance >= CLEAR].max(initial=0.0))
