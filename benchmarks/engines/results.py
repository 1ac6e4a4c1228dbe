"""Tables of what engines say: at their default settings, at the best ones, and at all."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.tables import markdown

Answer = dict[str, Any]
_COLUMNS = (
    "engine", "settings", "F, N", "error", "dragged, N", "error, dragged", "aside", "jitter", "contact radius, mm",
    "sunk, mm", "unknowns", "ms a step", "step, ms", "real time",
)  # fmt: skip
_SHORT = {"size": "size, mm", "tick": "step, ms"}


@dataclass(frozen=True)
class Truth:
    """This program's F (N) at the middle and at the end of the drag, their bars (N), and the contact's radius (m)."""

    middle: float
    end: float
    middle_bar: float
    end_bar: float
    radius: float


def errors(answer: Answer, truth: Truth) -> tuple[float, float, float]:
    """Return the relative errors of the static and of the dragged force, and the force along the path over F."""
    along, _, up = answer["dragged"]
    return answer["force"][2] / truth.middle - 1, up / truth.end - 1, along / truth.end


def best(answers: Sequence[Answer], truth: Truth) -> Answer | None:
    """Return the answer whose larger error, static or dragged, is smallest; None if none succeeded."""
    good = [answer for answer in answers if "failed" not in answer]
    return min(good, key=lambda answer: max(map(abs, errors(answer, truth)[:2])), default=None)


def table(found: Mapping[str, Sequence[Answer]], truth: Truth) -> str:
    """Return the comparison in markdown: for each engine, the default, then the best."""
    rows = []
    for engine, answers in found.items():
        chosen = best(answers, truth)
        rows += [_row(engine, "default", answers[0], truth)] if answers else []
        rows += [_row(engine, f"best of {len(answers)}", chosen, truth)] if chosen else []
    return markdown(rows, dict.fromkeys(_COLUMNS, ""))


def scan_table(found: Mapping[str, Sequence[Answer]], truth: Truth) -> str:
    """Return all answers in markdown, with their settings."""
    rows = [_row(engine, _words(a["setting"]), a, truth) for engine, answers in found.items() for a in answers]
    return markdown(rows, dict.fromkeys(_COLUMNS, ""))


def truths_table(truths: Mapping[str, Truth]) -> str:
    """Return this program's forces in markdown, by the law of the pad."""
    rows = [
        {
            "this program": f"{law} pad",
            "F, N": f"{one.middle:.4f} ± {one.middle_bar:.4f}",
            "F at the end of the drag, N": f"{one.end:.4f} ± {one.end_bar:.4f}",
            "contact radius, mm": f"{1e3 * one.radius:.2f}",
        }
        for law, one in truths.items()
    ]
    return markdown(rows, dict.fromkeys(rows[0], ""))


def _words(setting: Answer) -> str:
    return ", ".join(
        f"{_SHORT.get(key, key)} {1e3 * value:.3g}" if key in _SHORT else f"{key} {value}"
        for key, value in setting.items()
    )


def _row(engine: str, settings: str, answer: Answer, truth: Truth) -> dict[str, str]:
    if "failed" in answer:
        cells = dict.fromkeys(_COLUMNS, "") | {"F, N": answer["failed"].split("\n")[0][:90]}
        return cells | {"engine": engine, "settings": settings}
    static, dragged, aside = errors(answer, truth)
    texts = (
        f"{engine} {answer['version']}", settings, f"{answer['force'][2]:.3f}", f"{static:+.0%}",
        f"{answer['dragged'][2]:.3f}", f"{dragged:+.0%}", f"{aside:+.1%}", f"{answer['jitter'] / truth.middle:.1%}",
        _millimetres(answer["radius"]), _millimetres(answer["sunk"]), f"{answer['unknowns']}",
        f"{answer['step_ms']:.2g}", f"{1e3 * answer['tick']:.2g}", f"{1e3 * answer['tick'] / answer['step_ms']:.2g}",
    )  # fmt: skip
    return dict(zip(_COLUMNS, texts, strict=True))


def _millimetres(length: float) -> str:
    return "" if math.isnan(length) else f"{1e3 * length:.2f}"
