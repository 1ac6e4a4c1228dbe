"""A flat punch deep in tissue that it cuts: a ring crack ahead of its edge, and the column within, which it compresses.

The crack has the radius b in the undeformed tissue, less than the punch's R. It cuts out a column, which is pushed
ahead and is as wide as the punch. So the hole is opened to R round the shaft and round the column, which is shortened
by the stretch λ (O. A. Shergold and N. A. Fleck, Proc. R. Soc. Lond. A 460, 3037, 2004). While the crack advances by a
length l, the punch advances by (1 − λ) l. With energies ψ of the column and w of the hole, both over πb², an advance
takes per depth

    e = (πb² (ψ(R/b, λ) + w(R/b)) + 2πb Γ) / (1 − λ),

and the least over b and λ is the force without friction. The least over λ is where the column carries this force:
e = −πb² ∂ψ/∂λ. Incompressible tissue has λ = (b/R)².
"""

from math import exp, isfinite, pi, sqrt

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from epsmesh.solve import SolveError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.column import Column
from epsmesh.solve.plane.cut import Cut
from epsmesh.solve.plane.hole import MESHES, Hole, HoleMesh, open_hole

# Least growth of the hole's area, and least stretch of the column.
_LEAST = 1e-6


class Ring:
    """Ring cracks in tissue of one ``law`` and of a ``toughness`` Γ/(μ R).

    ``hole`` has the energies of the hole over the growth of its area, (R/b)² − 1.
    """

    def __init__(self, column: Column, hole: Hole, toughness: float):
        self._column, self._hole, self._toughness = column, hole, toughness

    def energy(self, growth: float, stretch: float) -> float:
        """Return e/(μ R²) at a growth of the hole's area and a stretch of the column."""
        square = 1 / (1 + growth)  # of b/R
        stored = square * (self._column.energy(1 / sqrt(square), stretch)[0] + self._hole.energy(growth))
        return pi * (stored + 2 * sqrt(square) * self._toughness) / (1 - stretch)

    def stretch(self, growth: float) -> float:
        """Return the stretch of the column at which this is least."""
        if self._column.is_incompressible:
            return 1 / (1 + growth)
        across, fixed = sqrt(1 + growth), self._hole.energy(growth)
        fixed += 2 * self._toughness * across

        def slope(stretch: float) -> float:
            energy, force = self._column.energy(across, stretch)
            value = (1 - stretch) * force + energy + fixed
            # Beyond what a law allows, the column is compressed too much, or too little.
            return value if isfinite(value) else stretch * across**2 - 1

        return float(brentq(slope, _LEAST, 1.0))

    def least(self, growth: float) -> float:
        """Return e/(μ R²) at a growth, the least over the stretch."""
        return self.energy(growth, self.stretch(growth))

    @property
    def rises(self) -> bool:
        """Whether it rises towards the last growth of the hole's area that was solved: the least is before."""
        before, last = self._hole.ratios[-2:]
        return self.least(float(before)) < self.least(float(last))

    def solved(self) -> float:
        """Return the growth at which it is least.

        Raises:
            SolveError: if that is none: the crack is then as wide as the punch.
        """
        growths = np.array([_LEAST, *self._hole.ratios])
        energies = [self.least(growth) for growth in growths]
        at = int(np.nanargmin(energies))
        low, high = np.log(growths[[max(at - 1, 0), min(at + 1, len(growths) - 1)]])
        found = minimize_scalar(lambda at: self.least(exp(at)), bounds=(low, high), method="bounded")
        if not found.fun < energies[0]:
            raise SolveError("it is as wide as the punch, since wider holes take more: the shaft opens none")
        return exp(found.x)

    def cut(self) -> Cut:
        """Return the cut at which it is least."""
        growth = self.solved()
        stretch = self.stretch(growth)
        energy, radius = self.energy(growth, stretch), 1 / sqrt(1 + growth)
        torn = 2 * pi * radius * self._toughness / (1 - stretch)
        pressure = 2 * pi * self._hole.pressure(growth)
        return Cut(energy, energy - torn, pressure, 2 * pi / (1 - stretch), self._hole.balance, len(self._hole.ratios))


def ring_cuts(law: MaterialLaw, toughness: float) -> tuple[Cut, Cut]:
    """Return the cut of a flat punch in tissue of a toughness Γ/(μ R), on a coarse mesh and a fine one.

    Raises:
        SolveError: if the hole cannot be opened so far.
    """
    column, name = Column(law), f"the ring crack of a punch, with Γ/(μ R) = {toughness:.3g}"

    def on(mesh: HoleMesh) -> Cut:
        try:
            hole = open_hole(law, mesh, lambda hole: Ring(column, hole, toughness).rises)
        except SolveError as error:
            raise SolveError(f"{name}: {error}") from error
        try:
            return Ring(column, hole, toughness).cut()
        except SolveError as error:
            raise SolveError(f'{name}: {error}; use crack_shape = "plane", or a law that stiffens less') from error

    coarse, fine = map(on, MESHES)
    return coarse, fine
