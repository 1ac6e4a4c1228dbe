"""Time left of a run: the plan's estimates, corrected by the times measured so far."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from epsmesh.plan.plan import Plan

# Weight of the estimates, as a share of the whole run's time.
_TRUST = 0.005
# Neighbouring solves are similar: each new one reduces the weight of earlier ones by this factor.
_MEMORY = 0.95
# The time left is shown once so many solves, and this share of the estimated time, have been measured: the first solve
# also compiles.
_ENOUGH, _KNOWN = 3, 0.03
# An overdue solve still has this share of its expected time left.
_LEAST = 0.05


@dataclass(frozen=True)
class Expected:
    """The expected seconds of a solve, its kind of work, and the number of its step."""

    seconds: float
    kind: str
    step: int


def expectations(plan: "Plan") -> dict[str, Expected]:
    """Return the expected times of all solves of ``plan``, by label; solves on a mesh share its time."""
    found = {}
    for number, step in enumerate(plan.meshes):
        estimate = plan.cost.step(step)
        for solve in step.solves:
            work = "exact" if solve.is_reference else "reduced" if solve.reduced else "solve"
            found[solve.label] = Expected(estimate.seconds / len(step.solves), f"{estimate.kind} {work}", number)
    return found


class Remaining:
    """Time left of a run, from the times at which its solves finish, on any number of ranks.

    The estimates of each kind of work are multiplied by the ratio of measured to expected time. While few times are
    measured, this ratio is drawn towards that of the whole run, and that one towards 1. The first solve of a kind does
    not count: it loads and compiles what it needs, and makes a mesh for others. ``clock`` returns seconds.
    """

    def __init__(self, expected: Mapping[str, Expected], clock: Callable[[], float] = time.monotonic):
        self._expected, self._pending, self._clock = dict(expected), set(expected), clock
        self._trust = max(_TRUST * sum(e.seconds for e in expected.values()), 1e-6)
        self._measured: dict[str, float] = {}
        self._estimated: dict[str, float] = {}
        # Estimated seconds left by kind, of the whole run (None) and of each step.
        self._to_come: dict[int | None, dict[str, float]] = {None: defaultdict(float)}
        for e in expected.values():
            for step in (None, e.step):
                self._to_come.setdefault(step, defaultdict(float))[e.kind] += e.seconds
        self.steps = len(self._to_come) - 1
        self._total, self._finished = sum(e.seconds for e in expected.values()), 0
        self._last = clock()

    @property
    def is_known(self) -> bool:
        """Whether enough has been measured to tell the time left."""
        done = self._total - sum(self._to_come[None].values())
        return self._finished >= _ENOUGH and done >= _KNOWN * self._total

    def done(self, label: str, *, counts: bool = True) -> None:
        """Note a finished solve; with ``counts`` its time corrects the estimates (a failed one's should not)."""
        now = self._clock()
        if label in self._pending:
            self._pending.remove(label)
            expected = self._expected[label]
            self._finished += counts
            for step in (None, expected.step):
                self._to_come[step][expected.kind] -= expected.seconds
            is_first = expected.kind not in self._measured
            for sums, seconds in ((self._measured, now - self._last), (self._estimated, expected.seconds)):
                if counts:
                    sums[expected.kind] = 0.0 if is_first else _MEMORY * sums[expected.kind] + seconds
        self._last = now

    def step_of(self, label: str) -> int | None:
        """Return the number of the step of a solve, from 0."""
        return self._expected[label].step if label in self._expected else None

    def seconds(self, step: int | None = None) -> float:
        """Return the seconds left of the whole run, or of a step."""
        if not self._pending:
            return 0.0
        total = sum(self._factor(kind) * max(seconds, 0.0) for kind, seconds in self._to_come[step].items())
        return max(total - (self._clock() - self._last), _LEAST * total)

    def _factor(self, kind: str) -> float:
        whole = (sum(self._measured.values()) + self._trust) / (sum(self._estimated.values()) + self._trust)
        measured, estimated = self._measured.get(kind, 0.0), self._estimated.get(kind, 0.0)
        return (measured + self._trust * whole) / (estimated + self._trust)


def format_seconds(value: float) -> str:
    """Return a time for people, such as ``2.5 s`` or ``1 h 05 min``."""
    if value < 9.95:
        return f"{value:.1f} s"
    if value < 119.5:
        return f"{value:.0f} s"
    minutes = round(value / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60:,} h {minutes % 60:02d} min"
