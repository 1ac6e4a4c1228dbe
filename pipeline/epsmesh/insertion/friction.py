"""Friction on the flanks of a blade: Coulomb's law on a pressure that friction itself changes.

Tissue slides along the blade, and its drag T = 2 μ N moves the slit's faces by s = T/C along the advance. By the
coupling B of that motion with the opening, they press with N + B s: N' = N / (1 − κ μ), with κ = 2 B/C, and N' =
N / (1 + κ μ) as the blade is pulled out. B and C are stiffnesses of a slit whose faces stick to the blade. Their ratio
depends on the shape of the flank alone, depth over length: within 1 % on Poisson's ratio from 0.3 to 0.5
(benchmarks/results/insertion.md).
"""

from typing import TYPE_CHECKING

from epsmesh import fitted

if TYPE_CHECKING:
    from epsmesh.shapes.probes.blade import Blade

# κ of a flank, fitted to solved slits: a strip at first, less as it gets deeper.
_SHALLOW, _DEEPER = 0.57, 0.85


def reaction(depth: float, length: float) -> float:
    """Return κ, by how much of μ the drag on flanks of a ``depth`` and a ``length`` (m) changes their pressure."""
    return _SHALLOW / (1 + _DEEPER * depth / length)


def rub(blade: "Blade", depth: float, squeeze: float, error: float, *, inwards: bool) -> tuple[float, float]:
    """Return the friction (N) on both flanks of a blade at a depth (m), against its motion, and its error bar.

    ``squeeze`` (N) is the normal force on each flank without friction, with its ``error``; ``inwards``: it advances.
    """
    coefficient = blade.friction
    drag = reaction(depth, blade.length) * coefficient
    factor = 1 / (1 - drag) if inwards else 1 / (1 + drag)
    uncertain = factor * error + fitted.FLANKS * abs(factor - 1) * squeeze
    return 2 * coefficient * factor * squeeze, 2 * coefficient * uncertain
