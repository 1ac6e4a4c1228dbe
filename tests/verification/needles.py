"""Cracks deep in tissue that a shaft holds open: at small openings and at large ones, against closed forms."""

from collections.abc import Callable, Iterator
from math import pi

from mpi4py import MPI

from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.crack import LEVELS, open_crack
from epsmesh.solve.plane.opening import Opening
from epsmesh.solve.plane.ring import ring_cuts
from epsmesh.verify import Row
from tests.verification import known

_INCOMPRESSIBLE = MaterialLaw.of_moduli(3.0, 0.5, "neo-hookean")
# G/(μ R) up to which the crack is opened, and the number of the small opening that is compared.
_MOST, _SMALL = 7.0, 4
# Γ/(μ R) of the ring crack, and the relative error of its least energy, whose place is known to 1e-5.
_TOUGHNESS, _LEAST = 1.0, 1e-5


def needle_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of cracks that a cylinder opens, and of a ring crack, none if ``quick``; collective."""
    if quick:
        return
    yield from comm.bcast(list(_rows()) if comm.rank == 0 else [])


def shaft_pressure(opening: Opening, toughness: float) -> float:
    """Return the force without friction of a needle that cuts, per area of it, in units of μ; Γ is in units of μ R."""
    ratio = opening.ratio(toughness)
    return (opening.energy(ratio) / ratio**2 + 2 * toughness / ratio) / pi


def _rows() -> Iterator[Row]:
    coarse, fine = (open_crack(_INCOMPRESSIBLE, _MOST, level) for level in LEVELS)
    thin, short = float(fine.ratios[_SMALL]), float(min(coarse.ratios[-1], fine.ratios[-1]))
    gentle, tough = fine.release(thin), 0.99 * min(each.released[1] for each in (coarse, fine))

    # The closed forms leave out terms of the square of the thickness, or of one over the length.
    cavity = "cavity in an infinite body"
    table: tuple[tuple[str, Callable[[Opening], float], float, str, float], ...] = (
        (
            "crack that a thin cylinder opens, ν = 0.5: energy release",
            lambda opening: opening.release(thin),
            # K = P/√(πb) for two forces P at its middle (H. Tada), G = K² (1 − ν²)/E.
            float(fine.thrusts[_SMALL]) ** 2 / (4 * pi * thin),
            "concentrated forces on its faces",
            thin,
        ),
        (
            "thin needle that cuts, ν = 0.5: pressure on its shaft",
            lambda opening: shaft_pressure(opening, gentle),
            known.thin_needle(gentle)[1],
            "Hertz' contact in a crack, after A. Spagnoli et al. 2022",
            thin,
        ),
        (
            "short crack round a cylinder, neo-Hookean: energy release",
            lambda opening: opening.release(short),
            pi * short / 2,
            cavity,
            1 / short,
        ),
        (
            "needle that cuts tough neo-Hookean tissue: pressure on its shaft",
            lambda opening: shaft_pressure(opening, tough),
            known.tough_needle(tough)[1],
            cavity,
            1 / short,
        ),
    )
    for scene, of, reference, source, order in table:
        value = of(fine)
        yield Row(scene, "plane strain", reference, source, value, abs(of(coarse) / value - 1), order**2)
    low, high = ring_cuts(_INCOMPRESSIBLE, _TOUGHNESS)
    yield Row(
        "ring crack under a flat punch, neo-Hookean, ν = 0.5: pressure on it",
        "round slice",
        known.flat_punch(_TOUGHNESS)[1],
        "least energy of column and hole, after O. A. Shergold and N. A. Fleck 2004",
        high.energy / pi,
        abs(low.energy / high.energy - 1) + high.balance,
        _LEAST,
    )
