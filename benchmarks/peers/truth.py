"""Converged F of a scene from two independent programs, each with its bar."""

from dataclasses import dataclass
from typing import Any

from benchmarks.peers.processes import ask
from benchmarks.peers.tasks import TASKS, Task

# NGSolve: one mesh, refined to a two-thousandth of its size at the rim, with increasing orders.
_MESH = {"rim": 0.7, "maxh": 20, "grading": 0.4, "levels": 4, "factor": 0.15}
_ORDERS = (3, 4, 5)
# For a ball: smaller elements below it. Nitsche's F is no bound, and does not converge monotonically.
_CONTACT = {"order": 3, "maxh": 15, "grading": 0.3, "levels": 0, "safety": 1.0, "gamma": 5.0, "tolerance": 1e-5}
_RIMS = (0.4, 0.3, 0.2)
_PROGRAM, _LARGE = {"accuracy": "0.05 %"}, {"accuracy": "1 %"}


@dataclass(frozen=True)
class Truth:
    """F (E·d·mm), its relative bar, and the value of each program."""

    force: float
    bar: float
    sources: dict[str, tuple[float, float]]

    @property
    def agree(self) -> bool:
        """Whether every two sources agree within their bars."""
        found = list(self.sources.values())
        return all(abs(a / b - 1) <= bar_a + bar_b for a, bar_a in found for b, bar_b in found)


def known(scene: Task) -> Truth:
    """Return the stored value."""
    return Truth(*scene.truth, {"stored": scene.truth})


def converge(name: str) -> Truth:
    """Return the converged F of a scene, from NGSolve, this program, and the stored value.

    Raises:
        RuntimeError: if a program crashes.
    """
    if TASKS[name].is_large:
        sources = {"stored": TASKS[name].truth, "program": _program(name, _LARGE)}
    else:
        sources = {"stored": TASKS[name].truth, "NGSolve": _ngsolve(name), "program": _program(name, _PROGRAM)}
    best = min(sources.values(), key=lambda found: found[1])
    return Truth(*best, sources)


def _ngsolve(name: str) -> tuple[float, float]:
    """Return F and its bar: F falls with the order, in steps whose ratio is extrapolated.

    For a ball: the last F, and the largest step.
    """
    if TASKS[name].probe[0] == "ball":
        jobs = {"scene": name, "settings": [_CONTACT | {"rim": rim} for rim in _RIMS], "warm": False}
        found = [_done(answer) for answer in ask("NGSolve", jobs)]
        return found[-1], (max(found) - min(found)) / found[-1]
    settings = [_MESH | {"order": p} for p in _ORDERS]
    forces = [_done(answer) for answer in ask("NGSolve", {"scene": name, "settings": settings, "warm": False})]
    before, last = forces[-3] - forces[-2], forces[-2] - forces[-1]
    rest = last * last / (before - last)
    # The rest of a geometric sequence, with half of it as the bar.
    return forces[-1] - rest, 0.5 * rest / forces[-1]


def _program(name: str, setting: dict[str, str]) -> tuple[float, float]:
    (answer,) = ask("program", {"scene": name, "settings": [setting], "warm": False})
    return _done(answer), float(setting["accuracy"].split()[0]) / 100


def _done(answer: dict[str, Any]) -> float:
    if "failed" in answer:
        raise RuntimeError(f"{answer['setting']}: {answer['failed']}")
    return float(answer["force"])
