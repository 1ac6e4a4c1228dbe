"""A round tool deep in tissue that it cuts.

What an advance stores and tears, e per depth, is the force without friction. Of a sharp needle the crack is a plane
ahead of its tip, which its shaft wedges open: e = s + 2b Γ, the least over the length 2b of the crack, where G = Γ
(O. A. Shergold and N. A. Fleck, Proc. R. Soc. Lond. A 460, 3037, 2004). That of a flat punch is in :mod:`.ring`.
"""

from collections.abc import Sequence
from math import nan

from epsmesh import fitted
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.meridian.problem import Answer, MeridianSolver
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.crack import LEVELS, open_crack
from epsmesh.solve.plane.cut import Cut, Cuts
from epsmesh.solve.plane.opening import Opening


class NeedleSolver(MeridianSolver):
    """A tool of a ``radius`` (m) in tissue of a ``toughness`` (J/m²), at the middle of a depth far below the surface.

    ``cuts`` solves its crack. Over the depth of the request, the answer has the energy (J) that tissue stores; as
    friction the pressure, integrated over the shaft, which is Coulomb's friction for a coefficient of 1; and as force
    that of cutting, which is the same at any depth.
    """

    def __init__(self, radius: float, toughness: float, cuts: Cuts):
        """Prepare."""
        self._radius, self._toughness, self._cuts = radius, toughness, cuts

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        """Return the answer on the finer mesh; its error bars are differences to the coarser one, and round-off.

        That of the force is the largest of all energies and of the pressure.

        Raises:
            SolveError: if the crack cannot be opened so far, or forces are not balanced.
        """
        coarse, fine = self._cuts(law, self._toughness / (law.lame_mu[0] * self._radius))
        check_balance(max(coarse.balance, fine.balance))
        round_off = fitted.NEEDLE_ROUND_OFF * fine.balance
        error, touched = max(_differences(coarse[:3], fine[:3])) + round_off, fine.touched * self._radius * depth
        of_touched = _differences(coarse[3:4], fine[3:4])[0] + round_off
        # Per length, forces are in units of μ R, energies of μ R².
        share, along = depth / self._radius, law.lame_mu[0] * self._radius * depth * fine.pressure
        return Answer(
            stiffness=fine.energy / share,
            on_probe=-fine.energy / share,
            balance=fine.balance,
            error=error,
            unit=self._radius,
            max_strain=nan,
            dofs=0,
            cells=0,
            iterations=fine.steps,
            contact=ContactResult(
                touched,
                of_touched,
                slip_area=touched,
                slip_area_bar=of_touched * touched,
                friction_force=along,
                friction_force_bar=error * along,
                torque=0.0,
                torque_bar=0.0,
            ),
            energy=fine.stored * self._radius * depth,
        )


def _differences(coarse: Sequence[float], fine: Sequence[float]) -> list[float]:
    return [abs(a / b - 1) for a, b in zip(coarse, fine, strict=True)]


def plane_cuts(law: MaterialLaw, toughness: float) -> tuple[Cut, Cut]:
    """Return the cut of a sharp needle in tissue of a toughness Γ/(μ R), on a coarse mesh and a fine one.

    Raises:
        SolveError: if the crack cannot be opened so far.
    """
    coarse, fine = (_cut(open_crack(law, toughness, level), toughness) for level in LEVELS)
    return coarse, fine


def _cut(opening: Opening, toughness: float) -> Cut:
    """Return the cut where G is the toughness.

    Raises:
        SolveError: if it is nowhere.
    """
    try:
        ratio = opening.ratio(toughness)
    except ValueError as error:
        why = f"; {opening.message}" if opening.message else ""
        raise SolveError(f"the crack of a needle is not solved: {error}{why}") from error
    stored = opening.energy(ratio) / ratio**2
    pressure, touched = opening.pressure(ratio) / ratio, 4 * opening.angle(ratio)
    return Cut(stored + 2 * toughness / ratio, stored, pressure, touched, opening.balance, len(opening.ratios))
