"""The linear problem in a half plane: what is held, and solutions by a factorisation, refined until round-off."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import inf, pi

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import AXIS, Meridian, MeridianArrays, meridian_mesh, split_regions
from pipeline.quantities import CLEAR
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve import SolveError
from pipeline.solve.balance import check_balance
from pipeline.solve.krylov import check_converged, explained, keep, solver_of
from pipeline.solve.meridian.forms import MeridianForms, Meshes
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# Each refinement gains the digits that the factors hold; a balance below the second number has nothing to gain.
_MOST_REFINEMENTS, _BALANCED = 20, 1e-9

# The half planes that are solved on.
HalfPlane = Meridian | EllipticMeridian


class Unbalanced(SolveError):
    """Round-off has spoilt the solution."""


@dataclass(frozen=True, eq=False)
class Pressed:
    """A solution with its residual, the balance's relative error, and the steps of refinement."""

    solution: FloatArray
    residual: FloatArray
    balance: float
    steps: int

    @property
    def twice_energy(self) -> float:
        """Twice the strain energy, in units of μ a times those of the solution squared."""
        return 2 * pi * float(self.solution @ self.residual)


class System:
    """Elements of a half plane whose support, axis and tool are held; ``radii`` (n) are those of the tool's nodes.

    ``probe`` and ``slide`` (n) are the dofs there of u_z and u_r, from the axis outwards.
    """

    def __init__(self, meshes: Meshes, degree: int, law: MaterialLaw, *, bonded: bool = False):
        """Assemble; tissue that is not ``bonded`` slides along the tool."""
        self.forms = MeridianForms(meshes, degree, law)
        self._stiffness = self.forms.stiffness()
        dofs, places = self.forms.on(PROBE)
        order = np.argsort(places[:, 0], kind="stable")
        self.radii = places[order, 0]
        slide, self.probe = dofs[order].T
        fixed, axis = self.forms.on(FIXED)[0], self.forms.on(AXIS)[0]
        self._support = fixed[:, 1]
        zero = np.concatenate([fixed.ravel(), axis[:, 0], slide if bonded else slide[:0]])
        self._free = np.setdiff1d(np.arange(self.forms.dofs), zero)

    @contextmanager
    def factors(self, held: IntArray) -> Iterator[Callable[[FloatArray], Pressed]]:
        """Factorise with the dofs ``held`` of u_z below the tool; lend the function that solves for their values."""
        free = np.setdiff1d(self._free, held)
        unknown = self._stiffness[free][:, free]
        unknown.sort_indices()
        csr = unknown.indptr.astype(PETSc.IntType), unknown.indices.astype(PETSc.IntType), unknown.data
        with ExitStack() as stack, explained():
            with stage("set-up"):
                operator = keep(stack, PETSc.Mat().createAIJ(unknown.shape, csr=csr, comm=MPI.COMM_SELF))
                operator.setOption(PETSc.Mat.Option.SYMMETRIC, True)
                if self.forms.is_definite:
                    operator.setOption(PETSc.Mat.Option.SPD, True)
                ksp = solver_of("factors, indefinite", operator, stack)
                right, left = (keep(stack, vector) for vector in operator.createVecs())
                ksp.setUp()

            def solve(load: FloatArray) -> FloatArray:
                left.array[:] = load
                ksp.solve(left, right)
                check_converged(ksp)
                return np.array(right.array)

            with stage("solve"):
                yield lambda values: self._refined(solve, free, held, values)

    def _refined(
        self, solve: Callable[[FloatArray], FloatArray], free: IntArray, held: IntArray, values: FloatArray
    ) -> Pressed:
        """Return the solution with ``values`` on the dofs ``held``; ``solve`` knows the operator on the ``free`` ones.

        What the mixed form's second row, p = λ div u, leaves out of the work is nought once it holds, so that the work
        on the solution is twice its energy for that form, too.

        Raises:
            Unbalanced: if round-off keeps the forces from balance.
            SolveError: if the solution is not a number or has no energy.
        """
        solution: FloatArray = np.zeros(self.forms.dofs)
        solution[held] = values
        residual, balance = self.forms.residual(solution), inf
        if not values.any():
            return Pressed(solution, residual, 0.0, 0)
        for step in range(1, _MOST_REFINEMENTS + 1):  # noqa: B007
            solution[free] -= solve(residual[free])
            residual, before = self.forms.residual(solution), balance
            on_probe, on_support = (float(residual[dofs].sum()) for dofs in (held, self._support))
            twice_energy, work = float(solution @ residual), float(values @ residual[held])
            if not 0 < twice_energy < inf:
                raise SolveError(f"the solution is not a number or has no energy (2U = {2 * pi * twice_energy:g})")
            balance = max(abs(on_probe + on_support) / abs(on_probe), abs(work / twice_energy - 1))
            if balance < _BALANCED or balance > before / 2:
                break
        check_balance(balance, Unbalanced, "; the body is so slender that its stiffness drowns in round-off")
        return Pressed(solution, residual, balance, step)


def meshes_of(arrays: MeridianArrays) -> Meshes:
    """Return the mesh of each region.

    Raises:
        SolveError: if nothing is held, or all that lies between the probe and what is.
    """
    if FIXED not in arrays.facets:
        raise SolveError("nothing that is kept of the body is held: the tissue would float")
    if len(np.intersect1d(arrays.facets[PROBE], arrays.facets[FIXED])):
        raise SolveError("the probe covers the top right to the held side: no displacement satisfies both conditions")
    return {region: meridian_mesh(part) for region, part in split_regions(arrays).items()}


def max_strain(forms: MeridianForms, arrays: MeridianArrays) -> float:
    """Return the largest principal strain of a cell's mean strain, away from every singular point.

    It is that of the solution whose residual was last asked for.
    """
    strain, corners = forms.mean_strains()
    distance = np.linalg.norm(corners[:, :, None] - arrays.singular, axis=-1).min(axis=(1, 2))
    return float(strain[distance >= CLEAR].max(initial=0.0))
