"""The force that a movement of the probe takes, from residuals of the unmodified operator; for every kind of element.

With r_j = K u_j for the solution of a unit of motion j, the probe's stiffness is K_ij = u_i·r_j, an energy: it is
symmetric and stationary, its error the product of the solver's errors of both solutions. Forces summed over the
probe's dofs are linear in that error, so that along a motion that was solved for the stiffness tells the force. The
work on the prescribed displacements, held_j·r_j, and F_probe + F_support = 0 then tell how well it was solved.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.movement import Movement, Vector
from pipeline.solve.spaces import ElasticSpace
from pipeline.solve.vectors import global_sum


@dataclass(frozen=True, eq=False)
class Response:
    """How the whole body answers n motions; global, equal on every rank.

    ``stiffness`` (n, n) is the work-conjugate force of each motion (row) for a unit of each (column): N/m between
    translations, N (per rad, or N·m per m) between one and a rotation, N·m between rotations. ``forces`` (n, 3) are
    the forces of the tissue on the probe (N) for a unit of each, from the residuals. ``balance`` is the largest of the
    relative errors of F·d = 2U and of F_probe + F_support = 0.
    """

    movement: Movement
    stiffness: FloatArray
    forces: FloatArray
    balance: float = nan

    @property
    def amounts(self) -> FloatArray:
        """Amounts of the motions (m, or rad)."""
        return np.array(self.movement.amounts)

    @property
    def force(self) -> Vector:
        """Force of the tissue on the probe (N) in the movement of all motions together."""
        force, along = self.amounts @ self.forces, self.stiffness @ self.amounts
        for motion, conjugate in zip(self.movement.motions, along, strict=True):
            direction = np.array(motion.direction)
            if motion.is_translation:
                force = force - (conjugate + force @ direction) * direction
        x, y, z = map(float, force)
        return x, y, z

    @property
    def energy(self) -> float:
        """Strain energy (J) in the movement of all motions together."""
        return float(self.amounts @ self.stiffness @ self.amounts) / 2


def reaction(
    movement: Movement, stationary: FloatArray, on_probe: FloatArray, mirrored: Sequence[int] = (), balance: float = nan
) -> Response:
    """Return the response of the whole body, from what belongs to the modelled part of it.

    ``stationary`` (n, n) are the energies u_i·r_j, or what takes their place in a mixed method; ``on_probe`` (n, 3) the
    sums of r_j over the probe's dofs; ``mirrored`` the axes normal to planes of symmetry that bound the part.

    Raises:
        SolveError: if one of them is not a number, or a motion takes no energy.
    """
    taken = np.diag(stationary)
    if not (np.all(np.isfinite(stationary)) and np.all(np.isfinite(on_probe)) and taken.min() > 0):
        raise SolveError(f"the solution is not a number or has no energy (2U = {taken.min():g} J for a unit of travel)")
    stiffness = 2.0 ** len(mirrored) * (stationary + stationary.T) / 2
    if movement.apart:
        stiffness = np.diag(np.diag(stiffness))
    return Response(movement, stiffness, -whole_force(on_probe, mirrored), balance)


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
        count = len(movement.motions)
        on_probe, on_support = (whole_force(part[:count], mirrored) for part in (self.on_probe, self.on_support))
        size = np.linalg.norm(on_probe, axis=1)
        straight = np.array([motion.is_translation for motion in movement.motions])
        stiffest = twice_energies[straight].max() if straight.any() else twice_energies.max()
        worth = 2.0 ** len(mirrored) * np.sqrt(np.abs(twice_energies * stiffest))
        size = np.where(straight, size, np.maximum(size, worth))
        forces = np.linalg.norm(on_probe + on_support, axis=1) / np.where(size > 0, size, np.inf)
        return float(max((np.abs(self.works - twice_energies) / twice_energies).max(), forces.max()))


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
    return Sums(total[:, :3], total[:, 3:6], np.diag(total[:count, 6:]).copy(), crossed)


def whole_force(forces: FloatArray, mirrored: Sequence[int]) -> FloatArray:
    """Return forces on the whole body: images double what lies in a plane of symmetry and cancel what is across it."""
    whole = np.full(3, 2.0 ** len(mirrored))
    whole[list(mirrored)] = 0.0
    return np.asarray(whole * forces)
