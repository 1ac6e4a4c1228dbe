"""The linear problem in a half plane: conditions, factorisation, and iterative refinement to round-off."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import AXIS, Meridian, MeridianArrays, meridian_mesh, split_regions
from epsmesh.quantities import CLEAR
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.krylov import check_converged, explained, factorised, keep
from epsmesh.solve.meridian.forms import MeridianForms, Meshes
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Most steps of iterative refinement; a balance below the second number needs none.
_MOST_REFINEMENTS, _BALANCED = 20, 1e-9

# Meshes of half planes.
HalfPlane = Meridian | EllipticMeridian


class Unbalanced(SolveError):
    """Round-off dominates the solution."""


@dataclass(frozen=True, eq=False)
class RefinedSolution:
    """A solution with its residual, relative imbalance, and number of refinement steps."""

    solution: FloatArray
    residual: FloatArray
    balance: float
    steps: int

    @property
    def twice_energy(self) -> float:
        """Twice the strain energy, in units of μ a times those of the solution squared."""
        return 2 * pi * float(self.solution @ self.residual)


class FreeSystem:
    """Elements of a plane, ``forms``, and the dofs ``free`` that are not zero."""

    def __init__(self, forms: MeridianForms, free: IntArray):
        self.forms, self.free = forms, free

    @contextmanager
    def inverse(self, unknown: sp.csr_matrix, *, is_definite: bool) -> Iterator[Callable[[FloatArray], FloatArray]]:
        """Factorise a symmetric matrix; lend the solver for a right-hand side."""
        unknown.sort_indices()
        csr = unknown.indptr.astype(PETSc.IntType), unknown.indices.astype(PETSc.IntType), unknown.data
        with ExitStack() as stack, explained():
            with stage("set-up"):
                operator = keep(stack, PETSc.Mat().createAIJ(unknown.shape, csr=csr, comm=MPI.COMM_SELF))
                operator.setOption(PETSc.Mat.Option.SYMMETRIC, True)
                if is_definite:
                    operator.setOption(PETSc.Mat.Option.SPD, True)
                ksp = factorised(operator, stack)
                right, left = (keep(stack, vector) for vector in operator.createVecs())

            def solve(load: FloatArray) -> FloatArray:
                left.array[:] = load
                ksp.solve(left, right)
                check_converged(ksp)
                return np.array(right.array)

            yield solve


class System(FreeSystem):
    """Elements of a half plane with conditions on support, axis and tool; ``radii`` (n) are those of the tool's nodes.

    ``probe`` and ``slide`` (n) are the dofs there of u_z and u_r, from the axis outwards; ``support`` those of u_z on
    the support; ``free`` are all dofs but those that are zero.
    """

    def __init__(self, meshes: Meshes, degree: int, law: MaterialLaw, *, bonded: bool = False):
        """Assemble; tissue that is not ``bonded`` slides along the tool."""
        forms = MeridianForms(meshes, degree, law)
        dofs, places = forms.on(PROBE)
        order = np.argsort(places[:, 0], kind="stable")
        self.radii = places[order, 0]
        self.slide, self.probe = dofs[order].T
        fixed, axis = forms.on(FIXED)[0], forms.on(AXIS)[0]
        self.support = fixed[:, 1]
        zero = np.concatenate([fixed.ravel(), axis[:, 0], self.slide if bonded else self.slide[:0]])
        super().__init__(forms, np.setdiff1d(np.arange(forms.dofs), zero))

    @cached_property
    def _stiffness(self) -> sp.csr_matrix:
        return self.forms.stiffness()

    @contextmanager
    def factors(self, held: IntArray) -> Iterator[Callable[[FloatArray], RefinedSolution]]:
        """Factorise with the dofs ``held`` of u_z below the tool fixed; lend the solver for their values."""
        free = np.setdiff1d(self.free, held)
        unknown = self._stiffness[free][:, free]
        with self.inverse(unknown, is_definite=self.forms.is_definite) as solve, stage("solve"):
            yield lambda values: self._refined(solve, free, held, values)

    def _refined(
        self, solve: Callable[[FloatArray], FloatArray], free: IntArray, held: IntArray, values: FloatArray
    ) -> RefinedSolution:
        """Return the solution with ``values`` at the dofs ``held``; ``solve`` inverts the operator on ``free`` dofs.

        The mixed form's second row, p = λ div u, vanishes at the solution. The work on the solution is then twice its
        energy in the mixed form, too.

        Raises:
            Unbalanced: if round-off prevents the balance of forces.
            SolveError: if the solution is not finite or has no energy.
        """
        solution: FloatArray = np.zeros(self.forms.dofs)
        solution[held] = values
        residual, balance = self.forms.residual(solution), inf
        if not values.any():
            return RefinedSolution(solution, residual, 0.0, 0)
        for step in range(1, _MOST_REFINEMENTS + 1):  # noqa: B007
            solution[free] -= solve(residual[free])
            residual, before = self.forms.residual(solution), balance
            on_probe, on_support = (float(residual[dofs].sum()) for dofs in (held, self.support))
            twice_energy, work = float(solution @ residual), float(values @ residual[held])
            if not 0 < twice_energy < inf:
                raise SolveError(f"the solution is not finite or has no energy (2U = {2 * pi * twice_energy:g})")
            balance = max(abs(on_probe + on_support) / abs(on_probe), abs(work / twice_energy - 1))
            if balance < _BALANCED or balance > before / 2:
                break
        check_balance(balance, Unbalanced, "; the body is so slender that round-off exceeds its stiffness")
        return RefinedSolution(solution, residual, balance, step)


def meshes_of(arrays: MeridianArrays) -> Meshes:
    """Return the mesh of each region.

    Raises:
        SolveError: if nothing is fixed, or no free surface separates probe and support.
    """
    if FIXED not in arrays.facets:
        raise SolveError("no fixed face is in the modelled part of the body: the tissue would float")
    if len(np.intersect1d(arrays.facets[PROBE], arrays.facets[FIXED])):
        raise SolveError("the probe covers the top up to the fixed side: no displacement satisfies both conditions")
    return {region: meridian_mesh(part) for region, part in split_regions(arrays).items()}


def max_strain(forms: MeridianForms, arrays: MeridianArrays) -> float:
    """Return the largest principal strain of a cell's mean strain, away from every singular point.

    It belongs to the solution of the last residual.
    """
    strain, corners = forms.mean_strains()
    distance = np.linalg.norm(corners[:, :, None] - arrays.singular, axis=-1).min(axis=(1, 2))
    return float(strain[distance >= CLEAR].max(initial=0.0))
