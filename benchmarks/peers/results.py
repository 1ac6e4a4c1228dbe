"""Results of the runs: the fastest of each program within a true error, tables, JSON."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

from benchmarks.peers.processes import PEERS
from benchmarks.peers.tasks import TASKS
from benchmarks.peers.truth import Truth
from benchmarks.tables import markdown

TARGETS = (1e-2, 3e-3, 1e-3)
GOAL = 0.5  # this program's time over the best peer's
_PLACE, _RATIO = ("scene", "threads", "true error"), "asked / best peer"


@dataclass(frozen=True)
class Run:
    """One setting of one program. ``error`` is relative to the truth; ``all_seconds`` are those of every repeat."""

    scene: str
    program: str
    threads: int
    setting: dict[str, Any]
    force: float
    error: float
    seconds: float
    cpu: float
    dofs: int
    parts: dict[str, float]
    all_seconds: tuple[float, ...] = ()

    def on(self, clock: str) -> float:
        """Return the time by ``clock``: "seconds", or "cpu" (of two ranks, the first one's)."""
        return self.cpu if clock == "cpu" else self.seconds

    @property
    def asked(self) -> float | None:
        """The accuracy required of this program."""
        text = self.setting.get("accuracy")
        return float(text.split()[0]) / 100 if text else None


@dataclass(frozen=True)
class Standing:
    """The fastest runs within a true error: this program's as required, its best in hindsight, and each peer's."""

    scene: str
    threads: int
    target: float
    clock: str
    asked: Run | None
    hindsight: Run | None
    meridian: Run | None
    peers: dict[str, Run | None]

    @property
    def best_peer(self) -> Run | None:
        """The fastest peer."""
        return _fastest((run for run in self.peers.values() if run), self.clock)

    @property
    def ratio(self) -> float | None:
        """Time of this program, at the required accuracy, over the best peer's."""
        best = self.best_peer
        return self.asked.on(self.clock) / best.on(self.clock) if self.asked and best else None


def medians(runs: Iterable[Run]) -> list[Run]:
    """Return the median of each setting's repeats, with the median of their processor times."""
    repeats: dict[str, list[Run]] = {}
    for run in runs:
        repeats.setdefault(json.dumps([run.scene, run.program, run.threads, run.setting]), []).append(run)
    found = []
    for same in repeats.values():
        seconds = tuple(run.seconds for run in same)
        middle = sorted(same, key=lambda run: run.seconds)[len(same) // 2]
        found.append(replace(middle, cpu=median(run.cpu for run in same), all_seconds=seconds))
    return found


def standings(runs: Sequence[Run], clock: str = "seconds") -> list[Standing]:
    """Return the comparison by ``clock``, for every scene, number of threads and accuracy that was run."""
    found = []
    for name, threads in dict.fromkeys((run.scene, run.threads) for run in runs):
        here = [run for run in runs if (run.scene, run.threads) == (name, threads)]
        for target in TARGETS:
            good = [run for run in here if abs(run.error) <= target]
            own = [run for run in good if run.program == "program"]
            flat = [run for run in own if run.setting.get("model") == "auto"]
            own = [run for run in own if run not in flat]
            peers = {peer: _fastest((run for run in good if run.program == peer), clock) for peer in PEERS}
            asked = next((run for run in own if run.asked == target), None)
            found.append(
                Standing(name, threads, target, clock, asked, _fastest(own, clock), _fastest(flat, clock), peers)
            )
    return found


def _fastest(runs: Iterable[Run], clock: str) -> Run | None:
    return min(runs, key=lambda run: run.on(clock), default=None)


def table(found: Sequence[Standing]) -> str:
    """Return the comparison in markdown."""
    names = ("program, asked", "program, hindsight", "meridian", *PEERS)
    rows = []
    for s in found:
        cells = (_cell(run, s.clock) for run in (s.asked, s.hindsight, s.meridian, *s.peers.values()))
        ratio = s.ratio
        verdict = "" if ratio is None else f"{ratio:.2f}{'' if ratio <= GOAL else ' (missed)'}"
        rows.append(_place(s, TASKS[s.scene].title) | dict(zip(names, cells, strict=True)) | {_RATIO: verdict})
    return markdown(rows, dict.fromkeys([*_PLACE, *names, _RATIO], ""))


def _place(s: Standing, title: str) -> dict[str, str]:
    """Return the first cells of a row."""
    return dict(zip(_PLACE, (title, str(s.threads), f"{100 * s.target:g} %"), strict=True))


def _cell(run: Run | None, clock: str) -> str:
    return f"{run.on(clock):.2f} s ({100 * abs(run.error):.2f} %)" if run else "—"


def breakdown(found: Sequence[Standing]) -> str:
    """Return, in markdown, the parts of the time of this program and of the best peer."""
    rows = [
        _place(s, s.scene)
        | {
            "who": f"{who} ({run.program})",
            "setting": ", ".join(f"{key} {value}" for key, value in run.setting.items()),
            "seconds": f"{run.seconds:.2f}",
            "parts": ", ".join(f"{name} {seconds:.2f}" for name, seconds in run.parts.items()),
        }
        for s in found
        for who, run in (("program, asked", s.asked), ("best peer", s.best_peer))
        if run
    ]
    return markdown(rows, dict.fromkeys((*_PLACE, "who", "setting", "seconds", "parts"), ""))


def truths_table(truths: dict[str, Truth]) -> str:
    """Return, in markdown, the converged F by source."""
    rows = [
        {
            "scene": TASKS[name].title,
            "F/(E·d·mm)": truth.force,
            "bar (%)": 100 * truth.bar,
            "sources": ", ".join(
                f"{who} {force:.6f} ± {100 * bar:.2g} %" for who, (force, bar) in truth.sources.items()
            ),
            "": "agree" if truth.agree else "DO NOT AGREE",
        }
        for name, truth in truths.items()
    ]
    return markdown(rows, {"scene": "", "F/(E·d·mm)": ".6f", "bar (%)": ".2g", "sources": "", "": ""})


def to_json(
    truths: dict[str, Truth], runs: Sequence[Run], machine: dict[str, Any], failures: list[Any]
) -> dict[str, Any]:
    """Return all results in JSON's types."""
    ratios = [
        {"scene": s.scene, "threads": s.threads, "target": s.target, "ratio": s.ratio, "ratio_cpu": by_cpu.ratio}
        for s, by_cpu in zip(standings(runs), standings(runs, "cpu"), strict=True)
    ]
    return {
        "machine": machine,
        "goal": GOAL,
        "ratios": ratios,
        "failures": failures,
        "truths": {name: asdict(truth) for name, truth in truths.items()},
        "runs": [asdict(run) for run in runs],
    }
