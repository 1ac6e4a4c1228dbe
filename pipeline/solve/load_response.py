"""What loads do to a probe that is held: by the same quadratic form that tells how it answers motions.

With u = Σ a_i u_i + w, u_i the solutions for units of the motions and w that of the loads f while the probe is held,
twice the potential energy is a'K a + 2 a'g - a(w, w), where K_ij = a(u_i, u_j) and g_i = -f·u_i (E. Betti): the force
that the probe needs along motion i to stand still. Written as a(u_i, w) - f·u_i, g is stationary in both solutions; one
degree more changes the whole form by minus the products of its corrections, as it does K: the errors and their bars are
those of :mod:`pipeline.solve.estimate`, for a matrix of one row more.

By Cauchy and Schwarz the bar on g_i is the root of those on K_ii and a(w, w), as if the errors of u_i and w were at the
same places. How far they are is told by their corrections: |S_ij| / (S_ii S_jj)^½, the cosine of the angle between them
in energy, where S is what one degree more takes away. It may be none by chance, so that a share of the root remains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.estimate import extrapolate
from pipeline.solve.loads import Applied
from pipeline.solve.movement import Movement, Vector
from pipeline.solve.response import Sums, whole_force

# A bar on what loads do to the probe, in units of the root of both bars: so many cosines, and what remains without.
# Measured: docs/accuracy.md.
_SEEN, _UNSEEN = {"displacement": 1.15, "mixed": 1.25}, {"displacement": 0.12, "mixed": 0.2}
# Loads that do less work than this share of what they would on the probe alone do none.
_NO_WORK = 1e-6


@dataclass(frozen=True, eq=False)
class LoadResponse:
    """The form of twice the potential energy (J) for n motions and, last, the loads; of the whole body, global.

    ``form`` (n + 1, n + 1) holds K, g and -a(w, w). ``forces`` (3) is the force of the tissue on the probe (N) from
    residuals. ``decrements`` is what one degree more takes away from the form, ``bars`` the 95 % bars on its entries.
    """

    form: FloatArray
    forces: FloatArray
    decrements: FloatArray | None = None
    bars: FloatArray | None = None

    @property
    def energy(self) -> float:
        """Strain energy (J) of the loads while the probe is held."""
        return float(-self.form[-1, -1]) / 2

    def force(self, movement: Movement) -> Vector:
        """Return the force of the tissue on the probe (N) that the loads add."""
        force = self.forces
        for motion, needed in zip(movement.motions, self.form[:-1, -1], strict=True):
            direction = np.array(motion.direction)
            if motion.is_translation:
                force = force - (needed + force @ direction) * direction
        x, y, z = map(float, force)
        return x, y, z

    def bar_along(self, movement: Movement, direction: Vector) -> float:
        """Return the 95 % bar (N) on the force along a direction, not a number if no motion was solved along it."""
        for number, motion in enumerate(movement.motions):
            if self.bars is not None and abs(abs(np.dot(motion.direction, direction)) - 1) < 1e-9:
                return float(self.bars[number, -1])
        return float("nan")

    def stiffness_along(self, movement: Movement, direction: Vector) -> float:
        """Return the stiffness (N/m) of the motion that was solved along a direction, not a number without one."""
        for number, motion in enumerate(movement.motions):
            if abs(abs(np.dot(motion.direction, direction)) - 1) < 1e-9:
                return float(self.form[number, number])
        return float("nan")

    def times(self, unit: float) -> "LoadResponse":
        """Return it in newtons, given that for moduli in a ``unit`` (Pa)."""
        return replace(self, form=unit * self.form, forces=unit * self.forces)

    def extrapolated(self, degree: int, element: str, *, plain: float, graded: bool) -> "LoadResponse":
        """Return what the sequence of degrees tends to, itself without bars."""
        if self.decrements is None or self.bars is None:
            return self
        form, bars = extrapolate(
            self.form, self.decrements, self.bars, degree, element, plain=plain, graded=graded, elsewhere=True
        )
        return replace(self, form=form, bars=bars)


def load_response_of(
    energies: FloatArray, works: FloatArray, on_probe: FloatArray, mirrored: Sequence[int], *, apart: bool
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
    if apart:
        form[:-1, :-1] = np.diag(np.diag(form[:-1, :-1]))
    form[:, -1] -= works
    form[-1, :] -= works
    return LoadResponse(2.0 ** len(mirrored) * form, -whole_force(on_probe, mirrored))


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


def imbalance(
    found: Sums, energies: FloatArray, works: FloatArray, applied: Applied, movement: Movement, mirrored: Sequence[int]
) -> float:
    """Return the largest relative error of what must hold of loads, all of the modelled part.

    That the work of the loads is twice their strain energy; that probe, support and loads are in balance; and that the
    force on the held probe is, by reciprocity, the work of the loads in its motion. ``found`` are sums of the residuals
    of all motions and of the loads, ``energies`` (n + 1) twice the strain energies, ``works`` (n + 1) f·u_j.
    """
    straight = np.array([motion.is_translation for motion in movement.motions])
    stiffest = energies[:-1][straight].max() if straight.any() else energies[:-1].max()
    least = _NO_WORK * applied.size**2 / stiffest
    work = abs(energies[-1] - works[-1]) / max(abs(works[-1]), least)
    rest = whole_force(found.on_probe[-1] + found.on_support[-1] + applied.resultant, mirrored)
    forces = float(np.linalg.norm(rest)) / (2.0 ** len(mirrored) * applied.size)
    # A unit of a rotation, or of a slit's opening, does as much work as a translation of the same energy.
    worth = applied.size * np.maximum(1.0, np.sqrt(energies[:-1] / stiffest))
    mutual = np.abs(found.crossed + works[:-1]) / worth
    return float(max(work, forces, mutual.max()))
