"""Force and energy balance: the checks of every solution, and the solver tolerance that satisfies them.

F·d = 2U and F_probe + F_support = 0 hold exactly for the solution of the discrete system. The imbalance is linear in
the error of the linear solver.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, isnan

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Movement
from epsmesh.solve.response import whole_force
from epsmesh.solve.spaces import ElasticSpace

# Largest relative imbalance of forces of a solution that counts as solved.
BALANCE_LIMIT = 1e-6
# The same of the work of forces in a small change of the displacement, and the change of the energy.
_WORK_LIMIT = 1e-5
# Relative energy norm of the solver's error. F is quadratic in this error: it errs by at most 1e-9 up to ν = 0.49, and
# by 1e-11 as a rule (benchmarks/results/solvers.md).
TOLERANCE = 1e-6
# Where forces do not balance: rounds of further iterations, the imbalance that each round aims at (share of the limit),
# and the largest reduction of the error in one round.
MOST_ROUNDS = 3
_AIM, _MOST = 0.3, 1e-2
# Loads count as doing no work below this share of the work that they would do acting on the probe alone.
_NO_WORK = 1e-6


def rest(balance: float, tolerance: float) -> float:
    """Return the factor by which the solver's error must still fall for forces to balance; 1 if they balance.

    Return 1, too, if ``tolerance`` is looser than the default: an imbalance is then expected.
    """
    if balance <= BALANCE_LIMIT or tolerance > TOLERANCE or not isfinite(balance):
        return 1.0
    return max(_AIM * BALANCE_LIMIT / balance, _MOST)


def check_balance(balance: float, error: type[SolveError] = SolveError, why: str = "") -> None:
    """Check that forces balance.

    Raises:
        SolveError: if they do not; raised as ``error``, with ``why`` at the end of the message.
    """
    if isnan(balance) or balance > BALANCE_LIMIT:
        raise error(f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}{why}")


def check_work(
    work: float,
    energies: tuple[float, float],
    change: float,
    error: type[SolveError] = SolveError,
    rounding: float = 0.0,
) -> None:
    """Check that forces are the derivative of the energy along the displacement, in which they do a ``work`` (J).

    ``energies`` (J) are those of the displacement times 1 + ``change`` and 1 - ``change``, ``rounding`` (J) is the
    error of their difference.

    Raises:
        SolveError: if they are not; raised as ``error``.
    """
    expected = 2 * change * work
    wrong = abs((energies[0] - energies[1]) / expected - 1)
    if not wrong <= _WORK_LIMIT + rounding / expected:
        raise error(f"the force is not the derivative of the energy: they differ by {wrong:.1e}")


@dataclass(frozen=True)
class Sums:
    """Sums of the residuals of n rigid motions on the modelled part, global, in N per unit of motion.

    ``on_probe`` and ``on_support`` (n, 3) are resultants. ``works`` (n) are held_j·r_j over all prescribed dofs. With
    loads there is one more residual: the resultants are then (n + 1, 3), and ``crossed`` (n) are the products of this
    last residual with each held_j.
    """

    on_probe: FloatArray
    on_support: FloatArray
    works: FloatArray
    crossed: FloatArray

    def imbalance(self, twice_energies: FloatArray, movement: Movement, mirrored: Sequence[int]) -> float:
        """Return the largest relative error of F·d = 2U (``twice_energies``, n) and of F_probe + F_support = 0.

        The forces of a rotation, or of the opening of a slit, may vanish. Their scale is the force of a translation
        with the same energy.
        """
        count, (straight, stiffest) = len(movement.motions), _stiffest(movement, twice_energies)
        on_probe, on_support = (whole_force(part[:count], mirrored) for part in (self.on_probe, self.on_support))
        size = np.linalg.norm(on_probe, axis=1)
        worth = 2.0 ** len(mirrored) * np.sqrt(np.abs(twice_energies * stiffest))
        size = np.where(straight, size, np.maximum(size, worth))
        forces = np.linalg.norm(on_probe + on_support, axis=1) / np.where(size > 0, size, np.inf)
        return float(max((np.abs(self.works - twice_energies) / twice_energies).max(), forces.max()))

    def imbalance_of_loads(
        self,
        energies: FloatArray,
        works: FloatArray,
        applied: Applied,
        movement: Movement,
        mirrored: Sequence[int],
    ) -> float:
        """Return the largest relative error of the three balances of dead loads, on the modelled part.

        The work of the loads is twice their strain energy. Forces on probe, support and body sum to zero. By
        reciprocity, the force on the fixed probe is the work of the loads in the probe's motion. ``energies`` (n + 1)
        are twice the strain energies of motions and loads, ``works`` (n + 1) are f·u_j.
        """
        _, stiffest = _stiffest(movement, energies[:-1])
        least = _NO_WORK * applied.size**2 / stiffest
        work = abs(energies[-1] - works[-1]) / max(abs(works[-1]), least)
        left = whole_force(self.on_probe[-1] + self.on_support[-1] + applied.resultant, mirrored)
        forces = float(np.linalg.norm(left)) / (2.0 ** len(mirrored) * applied.size)
        # Scale of the work: a translation with the same energy as the rotation or the opening of the slit.
        worth = applied.size * np.maximum(1.0, np.sqrt(energies[:-1] / stiffest))
        mutual = np.abs(self.crossed + works[:-1]) / worth
        return float(max(work, forces, mutual.max()))


def sums(
    space: ElasticSpace,
    residuals: Sequence[FloatArray],
    held: Sequence[FloatArray],
    on_terms: FloatArray | float = 0.0,
) -> Sums:
    """Return the sums of the residuals of n motions (owned dofs); ``held`` are the prescribed values; collective.

    With loads, ``residuals`` has one entry more than ``held``: that of the loads. What terms of the body bear
    (``on_terms``, N) is no part of the support's.
    """
    prescribed, rows = space.prescribed_owned, []
    for residual in residuals:
        points = residual.reshape(-1, 3)
        on_probe, on_support = (points[dofs].sum(axis=0) for dofs in (space.probe_owned, space.fixed_owned))
        rows.append([*on_probe, *on_support, *(residual[prescribed] @ values[prescribed] for values in held)])
    total, count = global_sum(space.comm, np.array(rows)), len(held)
    crossed = total[-1, 6:] if len(residuals) > count else np.zeros(count)
    return Sums(
        on_probe=total[:, :3],
        on_support=total[:, 3:6] - on_terms,
        works=np.diag(total[:count, 6:]).copy(),
        crossed=crossed,
    )


def _stiffest(movement: Movement, twice_energies: FloatArray) -> tuple[BoolArray, float]:
    """Return which motions are translations, and the largest energy among them (of all motions if there is none)."""
    straight = np.array([motion.is_translation for motion in movement.motions])
    return straight, float(twice_energies[straight].max() if straight.any() else twice_energies.max())
