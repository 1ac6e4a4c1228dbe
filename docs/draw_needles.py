"""The pressure on a needle that cuts, over the toughness: ``python docs/draw_needles.py``, ten minutes.

Cracks are solved as a run solves them, on the finer mesh, those of flat punches at a few places. They are drawn with
closed forms of ``tests/verification/known.py`` into ``docs/figures/needle_pressure.png``.
"""

from collections.abc import Iterator
from math import nan, pi
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from epsmesh.report.figures.style import COLOURS, GRID, LINE, STYLE
from epsmesh.solve import SolveError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.crack import LEVELS, open_crack
from epsmesh.solve.plane.opening import Opening
from epsmesh.solve.plane.ring import ring_cuts
from tests.verification.known import thin_needle, tough_needle
from tests.verification.needles import shaft_pressure

PICTURE = Path(__file__).parent / "figures" / "needle_pressure.png"
DPI = 130
# Γ/(μ R) that is drawn, and where the closed forms hold.
LEAST, MOST = 0.01, 100.0
OF_FLAT = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 9.0, 30.0, 100.0)
THIN, TOUGH = (LEAST, 0.4), (2.0, 30.0)
# Where linear elasticity opens the crack to the circle itself: Γ/(μ R), and F/(μ π R²) (A. Spagnoli et al. 2022).
LAST = (pi, 3.0)


def ogden(alpha: float) -> MaterialLaw:
    """Return incompressible tissue of Ogden's law with one term, μ = 1."""
    terms = {f"{name}{term}": value for term in (1, 2, 3) for name, value in (("share", 0.0), ("alpha", 2.0))}
    return MaterialLaw.of_moduli(3.0, 0.5, "ogden", **(terms | {"share1": 1.0, "alpha1": alpha}))


LAWS = {
    "neo-Hookean": (MaterialLaw.of_moduli(3.0, 0.5, "neo-hookean"), 2.0),
    "Ogden, α = 3": (ogden(3.0), 3.0),
    "Ogden, α = 9": (ogden(9.0), 9.0),
}


def main() -> None:
    """Draw the picture."""
    with mpl.rc_context(STYLE):
        drawn, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.8), layout="constrained")
        for (name, (law, alpha)), colour in zip(LAWS.items(), COLOURS[1::2], strict=False):
            opening = open_crack(law, MOST, LEVELS[-1])
            toughness = np.geomspace(max(opening.released[0], LEAST), 0.999 * min(opening.released[1], MOST), 40)
            curves(left, right, opening, toughness, name, colour)
            flat = dict(of_flat(law))
            left.plot(list(flat), list(flat.values()), "s", color=colour, markersize=3.5, linestyle="none")
            if alpha > 2:
                power(left, toughness[-1], shaft_pressure(opening, toughness[-1]), (alpha - 2) / (alpha - 1), colour)
                power(right, toughness[-1], 1 / opening.ratio(toughness[-1]), -1 / (alpha - 1), colour)
        for (low, high), known, line, name in (
            (THIN, thin_needle, "--", "small strain: Hertz' contact"),
            (TOUGH, tough_needle, "-.", "large stretch: cavity"),
        ):
            at = np.geomspace(low, high, 30)
            half, pressure = np.array([known(each) for each in at]).T
            left.plot(at, pressure, line, color=LINE, label=name)
            right.plot(at, half, line, color=LINE)
        left.plot(*LAST, "k*", markersize=9, label="small strain: crack opened to a circle")
        left.plot([nan], [nan], "s", color=LINE, markersize=3.5, label="flat punch, in the law's colour")
        left.plot([nan], [nan], ":", color=LINE, label="large stretch: slope for Ogden's law")
        for ax, what in ((left, "pressure on the shaft, p/μ"), (right, "half length of the crack, b/R")):
            ax.set(xscale="log", yscale="log", xlabel="toughness, Γ/(μR)", ylabel=what)
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_formatter("{x:g}")
            ax.grid(color=GRID)
        left.legend(fontsize=8)
        drawn.savefig(PICTURE, dpi=DPI)


def of_flat(law: MaterialLaw) -> Iterator[tuple[float, float]]:
    """Yield Γ/(μ R) and the pressure on a flat punch in units of μ, as far as it is solved."""
    for toughness in OF_FLAT:
        try:
            _, fine = ring_cuts(law, toughness)
        except SolveError:
            return
        yield toughness, fine.energy / pi


def curves(left: plt.Axes, right: plt.Axes, opening: Opening, toughness: np.ndarray, name: str, colour: str) -> None:
    """Draw pressure and length of the crack of one law."""
    left.plot(toughness, [shaft_pressure(opening, each) for each in toughness], color=colour, label=name)
    right.plot(toughness, [1 / opening.ratio(each) for each in toughness], color=colour)


def power(ax: plt.Axes, start: float, value: float, exponent: float, colour: str) -> None:
    """Draw a power law that ends at a point."""
    at = np.array([start / 8, start])
    ax.plot(at, 1.12 * value * (at / start) ** exponent, ":", color=colour)


if __name__ == "__main__":
    main()
