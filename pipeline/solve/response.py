"""The response of a body to a movement of the probe and to loads, as quadratic forms; for every kind of element.

With r_j = K u_j for a unit of motion j, the stiffness is K_ij = u_i·r_j: symmetric and stationary, its error the
product of two solver errors. Forces summed over the probe's dofs are linear in that error: along a motion that was
solved for, the stiffness gives the force.

Loads add a row. With w their solution while the probe is held, twice the potential energy is a'K a + 2 a'g - a(w, w),
g_i = -f·u_i (E. Betti) the force that holds the probe along motion i. Written as a(u_i, w) - f·u_i it is stationary,
too; one degree more changes the whole form by minus the products of its corrections.

By Cauchy and Schwarz the bar on g_i is the root of those on K_ii and a(w, w), if the errors of u_i and w are at the
same places. The cosine of their corrections in energy, |S_ij| / (S_ii S_jj)^½ with S what one degree more takes away,
says how far they are. It may vanish by chance: a share of the root remains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan, pi

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.estimate import extrapolate
from pipeline.solve.movement import Movement, Vector

# A bar on what loads do to the probe, in units of the root of both bars: so many cosines, and what remains without.
# Measured: docs/accuracy.md.
_SEEN, _UNSEEN = {"displacement": 1.15, "mixed": 1.25}, {"displacement": 0.12, "mixed": 0.2}
# Directions that differ by less than this are the same.
_SAME = 1e-9


@dataclass(frozen=True)
class Contact:
    """Contact that was found: its area (m²), with a relative 95 % bar where one was asked for.

    ``sag`` (m) is how far loads have moved the first touch, ``load_energy`` (J) their strain energy without the probe.
    """

    area: float
    bar: float = nan
    sag: float = nan
    load_energy: float = nan

    @property
    def radius(self) -> float:
        """Radius (m) of a disc of that area."""
        return float(self.area / pi) ** 0.5


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
        return _along_motions(self.movement, self.amounts @ self.forces, self.stiffness @ self.amounts)

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


@dataclass(frozen=True, eq=False)
class LoadResponse:
    """What loads do to a probe that makes a ``movement``; of the whole body, global.

    ``form`` (n + 1, n + 1), of twice the potential energy (J) for n motions and, last, the loads, holds K, g and
    -a(w, w). ``forces`` (3) is the force of the tissue on the probe (N) from residuals. ``decrements`` is what one
    degree more takes away from the form, ``bars`` the 95 % bars on its entries.
    """

    movement: Movement
    form: FloatArray
    forces: FloatArray
    decrements: FloatArray | None = None
    bars: FloatArray | None = None

    @property
    def energy(self) -> float:
        """Strain energy (J) of the loads while the probe is held."""
        return float(-self.form[-1, -1]) / 2

    @property
    def force(self) -> Vector:
        """The force of the tissue on the probe (N) that the loads add."""
        return _along_motions(self.movement, self.forces, self.form[:-1, -1])

    def bar_along(self, direction: Vector) -> float:
        """Return the 95 % bar (N) on the force along a direction, not a number if no motion was solved along it."""
        number = self._motion_along(direction)
        return nan if number is None or self.bars is None else float(self.bars[number, -1])

    def stiffness_along(self, direction: Vector) -> float:
        """Return the stiffness (N/m) of the motion that was solved along a direction, not a number without one."""
        number = self._motion_along(direction)
        return nan if number is None else float(self.form[number, number])

    def _motion_along(self, direction: Vector) -> int | None:
        cosines = [abs(np.dot(motion.direction, direction)) for motion in self.movement.motions]
        return next((number for number, cosine in enumerate(cosines) if abs(cosine - 1) < _SAME), None)

    def extrapolated(self, degree: int, element: str, *, plain: float, graded: bool) -> "LoadResponse":
        """Return what the sequence of degrees tends to, itself without bars."""
        if self.decrements is None or self.bars is None:
            return self
        form, bars = extrapolate(
            self.form, self.decrements, self.bars, degree, element, plain=plain, graded=graded, elsewhere=True
        )
        return replace(self, form=form, bars=bars)


def load_response_of(
    movement: Movement, energies: FloatArray, works: FloatArray, on_probe: FloatArray, mirrored: Sequence[int]
) -> LoadResponse:
    """Return what the loads do, from what belongs to the modelled part.

    ``energies`` (n + 1, n + 1) are the a(u_i, u_j) of all solutions, or what takes their place in a mixed method,
    ``works`` (n + 1) those of the loads, f·u_j, ``on_probe`` (3) the sum of the residual of w on the probe's dofs.

    Raises:
        SolveError: if one of them is not a number.
    """
    if not (np.all(np.isfinite(energies)) and np.all(np.isfinite(works)) and np.all(np.isfinite(on_probe))):
        raise SolveError("what the loads do is not a number")
    form = (energies + energies.T) / 2
    if movement.apart:
        form[:-1, :-1] = np.diag(np.diag(form[:-1, :-1]))
    form[:, -1] -= works
    form[-1, :] -= works
    return LoadResponse(movement, 2.0 ** len(mirrored) * form, -whole_force(on_probe, mirrored))


def shares(decrements: FloatArray, form: FloatArray) -> FloatArray:
    """Return the share of each energy on the diagonal that one degree more takes away, none of what is none."""
    energies = np.abs(np.diag(form))
    return np.asarray(np.diag(decrements) / np.where(energies > 0, energies, np.inf))


def load_bars(bars: FloatArray, decrements: FloatArray, element: str) -> FloatArray:
    """Return ``bars`` (n + 1, n + 1) on the form, narrower where motions and loads have their errors apart."""
    diagonal = np.abs(np.diag(decrements))
    root = np.sqrt(diagonal[:-1] * diagonal[-1])
    cosine = np.divide(np.abs(decrements[:-1, -1]), root, out=np.ones_like(root), where=root > 0)
    found = bars.copy()
    found[:-1, -1] *= np.minimum(1.0, _SEEN[element] * cosine + _UNSEEN[element])
    found[-1, :-1] = found[:-1, -1]
    return found


def whole_force(forces: FloatArray, mirrored: Sequence[int]) -> FloatArray:
    """Return forces on the whole body: images double what lies in a plane of symmetry and cancel what is across it."""
    whole = np.full(3, 2.0 ** len(mirrored))
    whole[list(mirrored)] = 0.0
    return np.asarray(whole * forces)


def _along_motions(movement: Movement, force: FloatArray, conjugate: FloatArray) -> Vector:
    """Return a ``force`` (3) on the probe (N) that along each motion is minus the ``conjugate`` one (n)."""
    for motion, needed in zip(movement.motions, conjugate, strict=True):
        direction = np.array(motion.direction)
        if motion.is_translation:
            force = force - (needed + force @ direction) * direction
    x, y, z = map(float, force)
    return x, y, z
