"""How long a run will still take: the plan's estimates, corrected by what has been measured in the run so far."""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from pipeline.plan.plan import Plan

# The estimates count for as much as this share of the whole, measured.
_TRUST = 0.005
# What is overdue is not finished: this share of what was expected is still to come.
_LEAST = 0.05


@dataclass(frozen=True)
class Expected:
    """What a solve is expected to take: seconds, the kind of work it is, and the number of its step."""

    seconds: float
    kind: str
    step: int


def expectations(plan: Plan) -> dict[str, Expected]:
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
        self._expected, self._pending, self._clock = dict(expected), dict(expected), clock
        self._trust = max(_TRUST * sum(e.seconds for e in expected.values()), 1e-6)
        self._measured: dict[str, float] = {}
        self._estimated: dict[str, float] = {}
        self._last = clock()

    @property
    def steps(self) -> int:
        """How many steps there are."""
        return len({expected.step for expected in self._expected.values()})

    def done(self, label: str, *, counts: bool = True) -> None:
        """Take note that a solve is finished; one that failed ``counts`` for nothing in the factors."""
        now, expected = self._clock(), self._pending.pop(label, None)
        if expected and counts:
            self._measured[expected.kind] = self._measured.get(expected.kind, 0.0) + now - self._last
            self._estimated[expected.kind] = self._estimated.get(expected.kind, 0.0) + expected.seconds
        self._last = now

    def seconds(self) -> float:
        """Return the seconds that are left of the whole run."""
        return self._left(self._pending.values())

    def step_of(self, label: str) -> int | None:
        """Return the number of the step of a solve, from 0."""
        return self._expected[label].step if label in self._expected else None

    def step_seconds(self, step: int) -> float:
        """Return the seconds that are left of a step."""
        return self._left([e for e in self._pending.values() if e.step == step])

    def _left(self, pending: Collection[Expected]) -> float:
        total = sum(self._factor(expected.kind) * expected.seconds for expected in pending)
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
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"
