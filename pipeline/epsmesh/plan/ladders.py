"""Tables of mesh recipes for an accuracy, cheapest first, with measured error bars (benchmarks/results/coverage.md).

:mod:`epsmesh.plan.recipe` chooses from them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """Mesh settings: ``rim`` in units of :func:`epsmesh.plan.recipe.edge_width_of`; ``bar`` is the expected error bar.

    ``bar`` is relative, for a disc on a deep body at ν = 0.3; see :mod:`epsmesh.plan.recipe` for others.
    """

    degree: int
    rim: float
    growth: float
    bar: float


LADDER = (
    Recipe(2, 0.4, 0.7, 4.6e-3),
    Recipe(2, 0.3, 0.6, 3.2e-3),
    Recipe(2, 0.2, 0.5, 2.0e-3),
    Recipe(2, 0.15, 0.45, 1.4e-3),
    Recipe(3, 0.3, 0.6, 9.0e-4),
    Recipe(3, 0.2, 0.5, 5.3e-4),
    Recipe(3, 0.15, 0.45, 3.5e-4),
    Recipe(3, 0.1, 0.4, 2.0e-4),
    Recipe(3, 0.05, 0.35, 1.0e-4),
    Recipe(3, 0.025, 0.3, 5.0e-5),
)
# If the probe's edge dominates the error, error bars are predictable: rungs are closer. None has degree 3 and a larger
# rim: few quadratic arcs approximate a circle poorly, and the force is too low (benchmarks/results/coverage.md).
EVEN = (
    Recipe(2, 0.4, 0.7, 7.0e-3),
    Recipe(2, 0.3, 0.6, 4.1e-3),
    Recipe(2, 0.25, 0.55, 3.1e-3),
    Recipe(2, 0.2, 0.5, 2.3e-3),
    Recipe(3, 0.3, 0.6, 1.8e-3),
    Recipe(3, 0.25, 0.55, 1.25e-3),
    Recipe(3, 0.2, 0.5, 8.0e-4),
    Recipe(3, 0.15, 0.45, 7.0e-4),
    Recipe(3, 0.125, 0.425, 5.2e-4),
    Recipe(3, 0.1, 0.4, 3.8e-4),
    Recipe(3, 0.07, 0.37, 2.7e-4),
    Recipe(3, 0.05, 0.35, 1.9e-4),
    Recipe(3, 0.025, 0.3, 1.0e-4),
)
# On a curved surface, smaller elements of degree 2 have a smaller error bar than the first rung of degree 3, in the
# same time (benchmarks/results/decisions.md).
ROUND = (
    *LADDER[:4],
    Recipe(2, 0.15, 0.35, 1.15e-3),
    Recipe(2, 0.1, 0.3, 9.0e-4),
    Recipe(2, 0.07, 0.25, 6.0e-4),
    *LADDER[5:],
)
# Unilateral contact uses degree 2. Its bars below flat faces are 2.3 to 2.9 times those of LADDER.
FLAT = (
    Recipe(2, 0.4, 0.7, 1.3e-2),
    Recipe(2, 0.3, 0.6, 9.0e-3),
    Recipe(2, 0.2, 0.5, 5.6e-3),
    Recipe(2, 0.15, 0.45, 3.9e-3),
    Recipe(2, 0.1, 0.4, 2.5e-3),
    Recipe(2, 0.05, 0.35, 1.26e-3),
    Recipe(2, 0.025, 0.3, 6.4e-4),
)
# For tools whose contact width is found, the pressure below them needs small elements as much as the edge of contact.
# Mixed elements gain less from small ones. Limits of F are sure from the first rung on: see solve/estimate.py.
FOUND = {
    "displacement": (
        Recipe(2, 0.25, 0.35, 2.7e-3),
        Recipe(2, 0.22, 0.32, 2.0e-3),
        Recipe(2, 0.2, 0.3, 1.6e-3),
        Recipe(2, 0.17, 0.27, 1.1e-3),
        Recipe(2, 0.15, 0.25, 7.2e-4),
        Recipe(2, 0.135, 0.225, 5.2e-4),
        Recipe(2, 0.12, 0.2, 3.7e-4),
        Recipe(2, 0.1, 0.185, 2.3e-4),
        Recipe(2, 0.08, 0.17, 1.4e-4),
        Recipe(2, 0.06, 0.14, 9.0e-5),
    ),
    "mixed": (
        Recipe(2, 0.25, 0.35, 3.9e-3),
        Recipe(2, 0.22, 0.32, 3.0e-3),
        Recipe(2, 0.2, 0.3, 2.45e-3),
        Recipe(2, 0.17, 0.27, 1.8e-3),
        Recipe(2, 0.15, 0.25, 1.35e-3),
        Recipe(2, 0.12, 0.2, 8.5e-4),
        Recipe(2, 0.08, 0.17, 5.0e-4),
        Recipe(2, 0.06, 0.14, 3.4e-4),
    ),
}
# Larger elements for balls whose limit of F is sure on them: has_sure_contact.
BALL = (
    Recipe(2, 0.4, 0.6, 1.05e-2),
    Recipe(2, 0.35, 0.5, 7.5e-3),
    Recipe(2, 0.3, 0.42, 4.5e-3),
    *FOUND["displacement"],
)
# The same at large displacements, where F is extrapolated for balls on plain bodies only.
FOUND_LARGE = (
    Recipe(2, 0.4, 0.6, 3.0e-2),
    Recipe(2, 0.3, 0.45, 1.2e-2),
    Recipe(2, 0.25, 0.35, 6.5e-3),
    Recipe(2, 0.2, 0.3, 4.2e-3),
    Recipe(2, 0.15, 0.25, 2.8e-3),
    Recipe(2, 0.12, 0.2, 2.2e-3),
    Recipe(2, 0.08, 0.17, 1.5e-3),
    Recipe(2, 0.06, 0.14, 1.1e-3),
)
BALL_LARGE = (
    Recipe(2, 0.6, 0.8, 1.1e-2),
    Recipe(2, 0.5, 0.7, 7.5e-3),
    Recipe(2, 0.4, 0.6, 6.0e-3),
    Recipe(2, 0.3, 0.45, 4.8e-3),
    Recipe(2, 0.25, 0.35, 3.8e-3),
    Recipe(2, 0.2, 0.3, 3.0e-3),
    Recipe(2, 0.15, 0.25, 2.2e-3),
    Recipe(2, 0.12, 0.2, 1.7e-3),
    Recipe(2, 0.08, 0.17, 1.15e-3),
    Recipe(2, 0.06, 0.14, 8.6e-4),
)
# With a linear law, contact that is found again gains whole nodes: on larger elements its change says little.
BALL_AGAIN = (
    Recipe(2, 0.4, 0.6, 1.1e-2),
    Recipe(2, 0.3, 0.45, 6.0e-3),
    Recipe(2, 0.25, 0.35, 4.5e-3),
    Recipe(2, 0.2, 0.3, 3.6e-3),
    *BALL_LARGE[6:],
)
# At large displacements, elements of degree 3, and very small ones, fold at the probe's edge.
LARGE = (
    *LADDER[:4],
    Recipe(2, 0.15, 0.45, 1.5e-3),
    Recipe(2, 0.1, 0.4, 1.0e-3),
    Recipe(2, 0.07, 0.35, 6.5e-4),
    Recipe(2, 0.05, 0.3, 4.4e-4),
)
# Deep probes at large displacements: no quarter points, and rims that do not fold. Bars hardly depend on the depth.
DEEP = (
    Recipe(2, 0.4, 0.7, 9.5e-3),
    Recipe(2, 0.3, 0.6, 7.5e-3),
    Recipe(2, 0.2, 0.5, 5.5e-3),
    Recipe(2, 0.15, 0.45, 4.3e-3),
    Recipe(2, 0.1, 0.4, 3.1e-3),
    Recipe(2, 0.07, 0.35, 2.4e-3),
)
