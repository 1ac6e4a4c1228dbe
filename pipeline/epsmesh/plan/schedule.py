"""Ranks for each step: small steps run side by side, a large one on all ranks."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from epsmesh.plan.cost import CostModel, StepEstimate, speed_up
from epsmesh.plan.steps import MeshStep

# With fewer tetrahedra than this, a rank communicates more than it computes.
_FEWEST_CELLS = 1_000


@dataclass(frozen=True)
class Phase:
    """Steps for groups of ``size`` ranks each: a free group takes the next step, the most expensive first."""

    size: int
    steps: tuple[MeshStep, ...]


def schedule(
    steps: Sequence[MeshStep], ranks: int, cost: CostModel, memory: float = inf, *, apart: bool = False
) -> tuple[Phase, ...]:
    """Distribute ``steps`` over groups of ``ranks`` ranks, which have ``memory`` bytes together.

    One rank per step is most efficient. A step gets more if it would take longer than its share of the total time, or
    if as many steps at once would not fit in memory. ``apart`` runs each step alone, on all ranks, for timing.
    """
    if apart or ranks == 1:
        return (Phase(ranks, tuple(steps)),) if steps else ()
    estimates = [cost.step(step) for step in steps]
    fair = sum(estimate.seconds for estimate in estimates) / ranks
    sized = [(group_size(e, ranks, fair, memory), e.seconds, step) for e, step in zip(estimates, steps, strict=True)]
    return tuple(
        Phase(size, tuple(step for _, _, step in sorted((s for s in sized if s[0] == size), key=lambda s: -s[1])))
        for size in sorted({size for size, _, _ in sized}, reverse=True)
    )


def group_size(step: StepEstimate, ranks: int, fair: float, memory: float = inf) -> int:
    """Return the number of ranks of a step: the fewest that keep it within ``fair`` seconds and the memory."""
    size = 1
    while size < ranks:
        too_long = step.seconds / speed_up(size) > fair * 1.001 and step.cells / (2 * size) >= _FEWEST_CELLS
        if not too_long and step.memory * ranks / size <= memory:
            break
        size *= 2
    return min(size, ranks)
