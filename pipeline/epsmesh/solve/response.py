"""Response of a body to a movement of the probe and to loads, as quadratic forms, for every kind of element.

With r_j = K u_j for a unit of motion j, the stiffness is K_ij = u_i·r_j: symmetric and stationary, its error is the
product of two solver errors. Forces summed over the probe's dofs are linear in that error. Along each motion solved
for, the force is therefore taken from the stiffness.

Loads add a row. With w their solution for a fixed probe, twice the potential energy is a'K a + 2 a'g - a(w, w), where
g_i = -f·u_i (E. Betti) is the force that holds the probe along motion i. Written as a(u_i, w) - f·u_i it is stationary,
too. One degree more changes the whole form by minus the products of its corrections.

By Cauchy and Schwarz the bar on g_i is the geometric mean of those on K_ii and a(w, w), if u_i and w have their errors
at the same places. The cosine of their corrections in energy, |S_ij| / (S_ii S_jj)^½ with S the decrements of one
degree more, measures how far this is so. It may vanish by chance: a fraction of the geometric mean remains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.estimate import extrapolate
from epsmesh.solve.movement import Movement, Vector

# Directions are equal within this distance.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Response:
    """Response of the whole body to n motions; global, equal on every rank.

    ``stiffness`` (n, n) is the work-conjugate force of each motion (row) for a unit of each (column): N/m between
    translations, N (per rad, or N·m per m) between a translation and a rotation, N·m between rotations. ``forces``
    (n, 3) are the forces of the tissue on the probe (N) per unit of each, from the residuals. ``balance`` is the
    largest relative error of F·d = 2U and of F_probe + F_support = 0.
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
    """Return the response of the whole body from that of the modelled part.

    ``stationary`` (n, n) are the energies u_i·r_j, or the stationary form of a mixed method; ``on_probe`` (n, 3) the
    sums of r_j over the probe's dofs; ``mirrored`` the axes normal to planes of symmetry that bound the part.

    Raises:
        SolveError: if one of them is not finite, or a motion has no energy.
    """
    work = np.diag(stationary)
    if not (np.all(np.isfinite(stationary)) and np.all(np.isfinite(on_probe)) and work.min() > 0):
        raise SolveError(f"the solution is not finite or has no energy (2U = {work.min():g} J for a unit of travel)")
    stiffness = 2.0 ** len(mirrored) * (stationary + stationary.T) / 2
    if movement.decoupled:
        stiffness = np.diag(np.diag(stiffness))
    return Response(movement, stiffness, -whole_force(on_probe, mirrored), balance)


@dataclass(frozen=True, eq=False)
class LoadResponse:
    """Effect of loads on a probe in a ``movement``; of the whole body, global.

    ``form`` (n + 1, n + 1) of twice the potential energy (J), for n motions and the loads last, contains K, g and
    -a(w, w). ``forces`` (3) is the force of the tissue on the probe (N) from residuals. ``decrements`` is what one
    degree more removes from the form, ``bars`` the 95 % bars on its entries. ``stored`` (J) and ``sag`` (m) are
    strain energy and sag of a nonlinear law; for a linear one they follow from the form.
    """

    movement: Movement
    form: FloatArray
    forces: FloatArray
    decrements: FloatArray | None = None
    bars: FloatArray | None = None
    stored: float | None = None
    sag: float | None = None

    @property
    def energy(self) -> float:
        """Strain energy (J) of the loads with the probe fixed."""
        return float(-self.form[-1, -1]) / 2 if self.stored is None else self.stored

    @property
    def force(self) -> Vector:
        """The force of the tissue on the probe (N) that the loads add."""
        return _along_motions(self.movement, self.forces, self.form[:-1, -1])

    def bar_along(self, direction: Vector) -> float:
        """Return the 95 % bar (N) on the force along a direction; NaN if no motion was solved along it."""
        number = self._motion_along(direction)
        return nan if number is None or self.bars is None else float(self.bars[number, -1])

    def stiffness_along(self, direction: Vector) -> float:
        """Return the stiffness (N/m) of the motion solved along a direction; NaN without one."""
        number = self._motion_along(direction)
        return nan if number is None else float(self.form[number, number])

    def _motion_along(self, direction: Vector) -> int | None:
        cosines = [abs(np.dot(motion.direction, direction)) for motion in self.movement.motions]
        return next((number for number, cosine in enumerate(cosines) if abs(cosine - 1) < _SAME), None)

    def extrapolated(self, known: Convergence) -> "LoadResponse":
        """Return the limit of the sequence of degrees; unchanged without bars.

        Loads act on the whole body: their effect has errors from everywhere.
        """
        if self.decrements is None or self.bars is None:
            return self
        everywhere = Convergence(
            degree=known.degree, element=known.element, is_graded=known.is_graded, has_others=True, plain=known.plain
        )
        form, bars = extrapolate(self.form, self.decrements, self.bars, everywhere)
        return replace(self, form=form, bars=bars)


def load_response_of(
    movement: Movement, energies: FloatArray, works: FloatArray, on_probe: FloatArray, mirrored: Sequence[int]
) -> LoadResponse:
    """Return the effect of the loads on the whole body from that on the modelled part.

    ``energies`` (n + 1, n + 1) are the a(u_i, u_j) of all solutions, or the stationary form of a mixed method,
    ``works`` (n + 1) those of the loads, f·u_j, ``on_probe`` (3) the sum of the residual of w on the probe's dofs.

    Raises:
        SolveError: if one of them is not finite.
    """
    if not (np.all(np.isfinite(energies)) and np.all(np.isfinite(works)) and np.all(np.isfinite(on_probe))):
        raise SolveError("the response to the loads is not finite")
    form = (energies + energies.T) / 2
    if movement.decoupled:
        form[:-1, :-1] = np.diag(np.diag(form[:-1, :-1]))
    form[:, -1] -= works
    form[-1, :] -= works
    return LoadResponse(movement, 2.0 ** len(mirrored) * form, -whole_force(on_probe, mirrored))


def shares(decrements: FloatArray, form: FloatArray) -> FloatArray:
    """Return the share of each diagonal energy that one degree more removes; zero for a zero energy."""
    energies = np.abs(np.diag(form))
    return np.asarray(np.diag(decrements) / np.where(energies > 0, energies, np.inf))


def load_bars(bars: FloatArray, decrements: FloatArray, element: str) -> FloatArray:
    """Return ``bars`` (n + 1, n + 1) on the form, narrower if motions and loads have their errors at other places."""
    diagonal = np.abs(np.diag(decrements))
    root = np.sqrt(diagonal[:-1] * diagonal[-1])
    cosine = np.divide(np.abs(decrements[:-1, -1]), root, out=np.ones_like(root), where=root > 0)
    found = bars.copy()
    found[:-1, -1] *= np.minimum(1.0, fitted.LOADS_SEEN[element] * cosine + fitted.LOADS_UNSEEN[element])
    found[-1, :-1] = found[:-1, -1]
    return found


def whole_force(forces: FloatArray, mirrored: Sequence[int]) -> FloatArray:
    """Return forces on the whole body: mirror images double the components in a plane of symmetry and cancel others."""
    whole = np.full(3, 2.0 ** len(mirrored))
    whole[list(mirrored)] = 0.0
    return np.asarray(whole * forces)


def _along_motions(movement: Movement, force: FloatArray, conjugate: FloatArray) -> Vector:
    """Return ``force`` (3) on the probe (N), replaced along each motion by minus its ``conjugate`` force (n)."""
    for motion, needed in zip(movement.motions, conjugate, strict=True):
        direction = np.array(motion.direction)
        if motion.is_translation:
            force = force - (needed + force @ direction) * direction
    x, y, z = map(float, force)
    return x, y, z
