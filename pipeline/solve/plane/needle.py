"""A round needle deep in tissue that it cuts: a plane crack ahead of its tip, which its shaft wedges open.

The energy that an advance stores and the work of fracture are s + 2b Γ per length, the least over the length 2b of the
crack: G = Γ (O. A. Shergold and N. A. Fleck, Proc. R. Soc. Lond. A 460, 3037, 2004). It is the force without friction.
"""

from math import nan

from pipeline.solve import SolveError
from pipeline.solve.balance import check_balance
from pipeline.solve.meridian.problem import Answer, MeridianSolver
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.plane.crack import LEVELS, open_crack
from pipeline.solve.plane.opening import Opening


class NeedleSolver(MeridianSolver):
    """A needle of a ``radius`` (m) in tissue of a ``toughness`` (J/m²), at the middle of a depth far below the surface.

    Over the depth of the request, the answer has the energy (J) that tissue stores; as friction the pressure,
    integrated over the shaft, which is Coulomb's friction for a coefficient of 1; and as force that of cutting, which
    is the same at any depth.
    """

    def __init__(self, radius: float, toughness: float):
        """Prepare."""
        self._radius, self._toughness = radius, toughness

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        """Return the answer on the finer mesh; its error bar is the largest difference to the coarser one.

        Raises:
            SolveError: if the crack cannot be opened so far, or the thrust on its faces is not balanced.
        """
        toughness = self._toughness / (law.lame_mu[0] * self._radius)
        coarse, fine = (open_crack(law, toughness, level) for level in LEVELS)
        check_balance(max(coarse.balance, fine.balance))
        found = [_per_length(each, toughness) for each in (coarse, fine)]
        cut, stored, pressed, angle = found[1]
        # Per length, forces are in units of μ R, energies of μ R².
        share = depth / self._radius
        return Answer(
            stiffness=cut / share,
            on_probe=-cut / share,
            balance=fine.balance,
            error=max(abs(a / b - 1) for a, b in zip(*(each[:3] for each in found), strict=True)),
            unit=self._radius,
            max_strain=nan,
            dofs=0,
            cells=0,
            iterations=len(fine.ratios),
            area=4 * angle * self._radius * depth,
            slip_area=4 * angle * self._radius * depth,
            friction=pressed,
            energy=stored * self._radius * depth,
        )


def _per_length(opening: Opening, toughness: float) -> tuple[float, float, float, float]:
    """Return s + 2b Γ and s in units of μ R², N in units of μ R, and the angle of contact, where G is the toughness.

    Raises:
        SolveError: if it is nowhere.
    """
    try:
        ratio = opening.ratio(toughness)
    except ValueError as error:
        why = f"; {opening.message}" if opening.message else ""
        raise SolveError(f"the crack of a needle is not solved: {error}{why}") from error
    stored = opening.energy(ratio) / ratio**2
    return stored + 2 * toughness / ratio, stored, opening.pressure(ratio) / ratio, opening.angle(ratio)
