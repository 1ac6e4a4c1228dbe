"""A crack in plane strain that a cylinder holds open: at small openings and at large ones, against closed forms."""

from collections.abc import Iterator
from math import pi

from mpi4py import MPI

from pipeline.solve.physics import MaterialLaw
from pipeline.solve.plane.crack import LEVELS, open_crack
from pipeline.verify.row import Row

_INCOMPRESSIBLE = MaterialLaw.of_moduli(3.0, 0.5, "neo-hookean")
# G/(μ R) up to which the crack is opened, and the number of the small opening that is compared.
_MOST, _SMALL = 7.0, 4


def needle_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of cracks that a cylinder opens, none if ``quick``; collective."""
    if quick:
        return
    found: list[Row] = []
    if comm.rank == 0:
        coarse, fine = (open_crack(_INCOMPRESSIBLE, _MOST, level) for level in LEVELS)
        ratio = float(fine.ratios[_SMALL])
        release = fine.release(ratio)
        found.append(
            Row(
                "crack that a thin cylinder opens, ν = 0.5: energy release",
                "plane strain",
                # K = P/√(πb) for two forces P at its middle (H. Tada), G = K² (1 − ν²)/E.
                float(fine.thrusts[_SMALL]) ** 2 / (4 * pi * ratio),
                "concentrated forces on its faces",
                release,
                abs(coarse.release(ratio) / release - 1),
                ratio**2,
            )
        )
        ratio = float(min(coarse.ratios[-1], fine.ratios[-1]))
        release = fine.release(ratio)
        found.append(
            Row(
                "short crack round a cylinder, neo-Hookean: energy release",
                "plane strain",
                pi * ratio / 2,
                "cavity in an infinite body",
                release,
                abs(coarse.release(ratio) / release - 1),
                ratio**-2,
            )
        )
    yield from comm.bcast(found)
