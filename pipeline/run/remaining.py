"""How long a run will still take: the plan's estimates, corrected by what has been measured in the run so far."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.plan.plan import Plan

# The estimates count for as much as this share of the whole, measured.
_TRUST = 0.005
# Neighbours in a study are alike: with each solve that is measured, those before it count this much less.
_MEMORY = 0.95
# What is overdue is not finished: this share of what was expected is still to come.
_LEAST = 0.05


@dataclass(frozen=True)
class Expected:
    """What a solve is expected to take: seconds, the kind of work it is, and the number of its step."""

    seconds: float
    kind: str
    step: int


def expectations(plan: "Plan") -> dict[str, Expected]:
    """Return what every solve of ``plan`` should take, by label; the time of a mesh is shared by its solves."""
    found = {}
    for number, step in enumerate(plan.meshes):
        estimate = plan.cost.step(step)
        for solve in step.solves:
            work = "exact" if solve.is_reference else "reduced" if solve.reduced else "solve"
            found[solve.label] = Expected(estimate.seconds / len(step.solves), f"{estimate.kind} {work}", number)
    return found


class Remaining:
    """Time left of a run whose solves end one after the other, on however many ranks.

    Each kind of work has a factor on its estimates: what was measured over what was expected, drawn towards the
    factor of the whole run, and that towards 1, while little has been measured. ``clock`` returns seconds.
    """

    def __init__(self, expected: Mapping[str, Expected], clock: Callable[[], float] = time.monotonic):
        self._expected, self._pending, self._clock = dict(expected), set(expected), clock
        self._trust = max(_TRUST * sum(e.seconds for e in expected.values()), 1e-6)
        self._measured: dict[str, float] = {}
        self._estimated: dict[str, float] = {}
        # Estimated seconds that are still to come by kind, of the whole (None) and of each step.
        self._to_come: dict[int | None, dict[str, float]] = {None: defaultdict(float)}
        for e in expected.values():
            for step in (None, e.step):
                self._to_come.setdefault(step, defaultdict(float))[e.kind] += e.seconds
        self.steps = len(self._to_come) - 1
        self._last = clock()

    def done(self, label: str, *, counts: bool = True) -> None:
        """Take note that a solve is finished; one that failed ``counts`` for nothing in the factors."""
        now = self._clock()
        if label in self._pending:
            self._pending.remove(label)
            expected = self._expected[label]
            for step in (None, expected.step):
                self._to_come[step][expected.kind] -= expected.seconds
            for sums, seconds in ((self._measured, now - self._last), (self._estimated, expected.seconds)):
                if counts:
                    sums[expected.kind] = _MEMORY * sums.get(expected.kind, 0.0) + seconds
        self._last = now

    def step_of(self, label: str) -> int | None:
        """Return the number of the step of a solve, from 0."""
        return self._expected[label].step if label in self._expected else None

    def seconds(self, step: int | None = None) -> float:
        """Return the seconds that are left of the whole run, or of a step."""
        if not self._pending:
            return 0.0
        total = sum(self._factor(kind) * max(seconds, 0.0) for kind, seconds in self._to_come[step].items())
        return max(total - (self._clock() - self._last), _LEAST * total)

    def _factor(self, kind: str) -> float:
        whole = (sum(self._measured.values()) + self._trust) / (sum(self._estimated.values()) + self._trust)
        measured, estimated = self._measured.get(kind, 0.0), self._estimated.get(kind, 0.0)
        return (measured + self._trust * whole) / (estimated + self._trust)


def format_seconds(value: float) -> str:
    """Write a time as people say it."""
    if value < 9.95:
        return f"{value:.1f} s"
    if value < 119.5:
        return f"{value:.0f} s"
    minutes = round(value / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60:,} h {minutes % 60:02d} min"
