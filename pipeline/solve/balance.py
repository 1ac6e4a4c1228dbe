"""How well forces balance: what must hold of every solution, and how well a solver must have solved for it.

F·d = 2U and F_probe + F_support = 0 hold for the exact solution of the discrete system. What misses them is the
solver's error, in which both are linear.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, isnan

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve import SolveError
from pipeline.solve.compiled import global_sum
from pipeline.solve.loads import Applied
from pipeline.solve.movement import Movement
from pipeline.solve.response import whole_force
from pipeline.solve.spaces import ElasticSpace

# A solution whose forces miss their balance by more than this share has not been solved.
BALANCE_LIMIT = 1e-6
# The energy norm of the solver's error, relative: F, which is quadratic in it, then has no error above 1e-9 up to
# ν = 0.49, and 1e-11 as a rule (docs/solvers.md).
TOLERANCE = 1e-6
# Rounds of further iterations where forces do not balance, what each aims at as a share of the limit, and the most by
# which it lowers the error.
MOST_ROUNDS = 3
_AIM, _MOST = 0.3, 1e-2
# Loads that do less work than this share of what they would on the probe alone do none.
_NO_WORK = 1e-6


def rest(balance: float, tolerance: float) -> float:
    """Return the share of the solver's error that may remain where forces do not balance, 1 if it is small enough.

    It is, too, at a ``tolerance`` that was chosen loosely: that the forces do not balance is then no wonder.
    """
    if balance <= BALANCE_LIMIT or tolerance > TOLERANCE or not isfinite(balance):
        return 1.0
    return max(_AIM * BALANCE_LIMIT / balance, _MOST)


def check_balance(balance: float, error: type[SolveError] = SolveError, why: str = "") -> None:
    """See that forces balance.

    Raises:
        SolveError: if they do not, or the kind of ``error`` that is given; its message ends with ``why``.
    """
    if isnan(balance) or balance > BALANCE_LIMIT:
        raise error(f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}{why}")


@dataclass(frozen=True)
class Sums:
    """Sums of residuals of n motions on the modelled part; global: ``on_probe`` and ``on_support`` (n, 3), N per unit.

    ``works`` (n) are held_j·r_j over all prescribed dofs. With one residual more, that of loads, the first two are
    (n + 1, 3), and ``crossed`` (n) are the products of the last residual with each held_j.
    """

    on_probe: FloatArray
    on_support: FloatArray
    works: FloatArray
    crossed: FloatArray

    def imbalance(self, twice_energies: FloatArray, movement: Movement, mirrored: Sequence[int]) -> float:
        """Return the largest relative error of F·d = 2U (``twice_energies``, n) and of F_probe + F_support = 0.

        A rotation, or a slit that is opened, may take no force at all: its forces are measured by what its energy is
        worth in a translation.
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
        """Return the largest relative error of what must hold of loads, all of the modelled part.

        That the work of the loads is twice their strain energy; that probe, support and loads are in balance; and that
        the force on the held probe is, by reciprocity, the work of the loads in its motion. ``energies`` (n + 1) are
        twice the strain energies of motions and loads, ``works`` (n + 1) are f·u_j.
        """
        _, stiffest = _stiffest(movement, energies[:-1])
        least = _NO_WORK * applied.size**2 / stiffest
        work = abs(energies[-1] - works[-1]) / max(abs(works[-1]), least)
        left = whole_force(self.on_probe[-1] + self.on_support[-1] + applied.resultant, mirrored)
        forces = float(np.linalg.norm(left)) / (2.0 ** len(mirrored) * applied.size)
        # A unit of a rotation, or of a slit's opening, does as much work as a translation of the same energy.
        worth = applied.size * np.maximum(1.0, np.sqrt(energies[:-1] / stiffest))
        mutual = np.abs(self.crossed + works[:-1]) / worth
        return float(max(work, forces, mutual.max()))


def sums(space: ElasticSpace, residuals: Sequence[FloatArray], held: Sequence[FloatArray]) -> Sums:
    """Return what residuals of n motions (owned dofs) sum up to; ``held`` are the prescribed values; collective.

    One residual more is that of loads.
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
        on_support=total[:, 3:6],
        works=np.diag(total[:count, 6:]).copy(),
        crossed=crossed,
    )


def _stiffest(movement: Movement, twice_energies: FloatArray) -> tuple[BoolArray, float]:
    """Tell which motions are translations, and the largest energy of these, or of all if none is."""
    straight = np.array([motion.is_translation for motion in movement.motions])
    return straight, float(twice_energies[straight].max() if straight.any() else twice_energies.max())
