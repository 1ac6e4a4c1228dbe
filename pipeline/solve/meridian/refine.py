"""How a problem on the meridian is made exact: meshes until the bar is small, a solution refined until round-off."""

from collections.abc import Callable
from math import inf, isnan, pi
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.mesh.meridian import Grading, MeridianArrays, meridian_mesh, split_regions
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.krylov import SolveError
from pipeline.solve.meridian.forms import JoinedForms, MeridianForms
from pipeline.solve.meridian.system import Meshes, Unbalanced
from pipeline.solve.movement import Movement
from pipeline.solve.solution import BALANCE_LIMIT

# Meshes in the order in which they are tried, until the error bar is below the accuracy asked for.
GRADINGS = (Grading(1e-6, 1.0, 4.0), Grading(1e-7, 0.7, 2.0), Grading(1e-8, 0.5, 1.0))
# An error bar above this is no answer.
_WORST_ERROR = 1e-3
# Each refinement gains the digits that the factors hold; a balance below the second number has nothing to gain.
_MOST_REFINEMENTS, _BALANCED = 20, 1e-9


class DirectProblem:
    """A problem on this process alone, which holds nothing between solves: each makes meshes of its own."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def dofs(self) -> int:
        """None: unknowns are counted in each solve, which is direct."""
        return 0


class Answer(Protocol):
    """What one mesh gives."""

    @property
    def error(self) -> float:
        """The relative error bar of the force."""


A = TypeVar("A", bound=Answer)


def only_along_axis(movement: Movement) -> None:
    """Refuse what a half plane cannot show.

    Raises:
        SolveError: if the probe does anything but press along its axis.
    """
    if len(movement.motions) > 1 or movement.motions[0].is_rotation or any(movement.motions[0].direction[:2]):
        raise SolveError("the meridian serves movements along its axis only")


def best_answer(solve_on: Callable[[Grading], A], accuracy: float) -> A:
    """Return the best of what meshes give, the next one taken until the error bar is at most ``accuracy``.

    Raises:
        SolveError: if a solve fails a check, or the error bar stays above 1e-3.
    """
    best: A | None = None
    for grading in GRADINGS:
        try:
            found = solve_on(grading)
        except Unbalanced:
            # Round-off grows with refinement: a finer mesh would do no better.
            if best is None:
                raise
            break
        if best is None or found.error < best.error:
            best = found
        if best.error <= accuracy:
            break
    assert best is not None
    if best.error > _WORST_ERROR:
        raise SolveError(f"the force is known to {best.error:.0e} only, allowed {_WORST_ERROR:.0e}")
    return best


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


def refined(
    forms: MeridianForms | JoinedForms, solve: Callable[[FloatArray], FloatArray], free: Int32Array | IntArray,
    probe: Int32Array | IntArray, support: Int32Array | IntArray, held: FloatArray,
) -> tuple[FloatArray, FloatArray, float, int]:  # fmt: skip
    """Return the solution with u_z ``held`` on the probe's dofs, its residual, the balance's relative error, steps.

    ``solve`` knows the operator on the ``free`` dofs. What the mixed form's second row, p = λ div u, leaves out of the
    work is nought once it holds, so that the work on the solution is twice its energy for that form, too.

    Raises:
        Unbalanced: if round-off keeps the forces from balance.
        SolveError: if the solution is not a number or has no energy.
    """
    solution: Any = np.zeros(forms.dofs)
    solution[probe] = held
    residual, balance = forms.residual(solution), inf
    if not held.any():
        return solution, residual, 0.0, 0
    for step in range(1, _MOST_REFINEMENTS + 1):  # noqa: B007
        solution[free] -= solve(residual[free])
        residual, before = forms.residual(solution), balance
        on_probe, on_support = (float(residual[dofs].sum()) for dofs in (probe, support))
        twice_energy, work = float(solution @ residual), float(held @ residual[probe])
        if not 0 < twice_energy < inf:
            raise SolveError(f"the solution is not a number or has no energy (2U = {2 * pi * twice_energy:g})")
        balance = max(abs(on_probe + on_support) / abs(on_probe), abs(work / twice_energy - 1))
        if balance < _BALANCED or balance > before / 2:
            break
    if isnan(balance) or balance > BALANCE_LIMIT:
        raise Unbalanced(
            f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}; "
            "the body is so slender that its stiffness drowns in round-off"
        )
    return solution, residual, balance, step


def error_bar(coarse: float, fine: float, degree: int, balance: float) -> float:
    """Return the relative error bar of ``fine``, of a degree p, from what degree p - 1 gives on the same mesh.

    At an edge where the displacement goes like r^½, the error falls like p⁻² if nothing else is left (the mesh's
    smallest cell), faster elsewhere: what is left is at most θ = p²/(2p + 1) times the last step, p counted before
    it. The safety of 1.25 on it is measured, and so is that round-off errs by less than 3 times the ``balance``.
    """
    theta = (degree - 1) ** 2 / (2 * degree - 1)
    return 1.25 * theta * abs(coarse / fine - 1) + 3 * balance
