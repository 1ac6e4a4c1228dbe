"""Load steps of contact at large displacements: the whole depth at once, or as many steps as the loop needs.

The initial guess of a step continues the last one linearly, and is dropped where it turns tissue inside out.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.contact.deformed import PlacedTool, Tissue, Touched, first_set, settle
from pipeline.solve.newton import LargeError

# Smallest step, as a share of the depth, and a step that leaves less than this share goes to the end.
_SMALLEST, _SLIVER = 1 / 64, 1e-6
# The next step is longer by this factor if this one took at most so many iterations.
_LONGER, _EASY = 1.5, 8


@dataclass(frozen=True, eq=False)
class Stage:
    """Equilibrium at a ``depth`` (m): the tissue's ``state`` and the contact, None without any."""

    depth: float
    state: FloatArray
    touched: Touched | None = None


@dataclass(eq=False)
class ContactPath:
    """The last two equilibria of a load path, and the ``step`` (m) that the next one may have."""

    last: Stage
    before: Stage | None = None
    step: float = inf
    count: int = field(default=0)

    def add(self, stage: Stage) -> None:
        """Go on to a stage."""
        self.before, self.last, self.count = self.last, stage, self.count + 1

    def guess(self, depth: float) -> FloatArray | None:
        """Return the state continued to a ``depth`` (m), None from a single equilibrium."""
        if self.before is None or self.before.touched is None:
            return None
        share = (depth - self.last.depth) / (self.last.depth - self.before.depth)
        return self.last.state + share * (self.last.state - self.before.state)


def press(tissue: Tissue, tool_at: Callable[[float], PlacedTool], path: ContactPath, depth: float) -> int:
    """Continue a load ``path`` to a ``depth`` (m); return Newton's iterations; collective.

    Raises:
        LargeError: if a step becomes too small; the path keeps the steps that converged.
    """
    iterations = 0
    while path.last.depth < depth:
        left = depth - path.last.depth
        step = min(path.step, left)
        there = depth if step > (1 - _SLIVER) * left else path.last.depth + step
        try:
            touched = _step(tissue, tool_at(there), path, there)
        except SolveError as error:
            path.step = (there - path.last.depth) / 2
            if path.step < _SMALLEST * depth:
                tissue.state = path.last.state
                raise LargeError(str(error)) from error
            continue
        iterations += touched.iterations
        step = there - path.last.depth
        path.add(Stage(there, tissue.state, touched))
        path.step = step * (_LONGER if touched.iterations <= _EASY else 1.0)
    return iterations


def _step(tissue: Tissue, tool: PlacedTool, path: ContactPath, depth: float) -> Touched:
    active = np.zeros(len(tissue.fixed), dtype=bool) if path.last.touched is None else path.last.touched.active
    guess = path.guess(depth)
    if guess is not None:
        tissue.state = guess
        if not tissue.is_sound:
            guess = None
    if guess is None:
        tissue.state = path.last.state
    return settle(tissue, tool, first_set(tissue, tool, active))
