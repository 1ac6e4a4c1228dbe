"""Error of the static force against the time of a step, all settings of all engines."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from benchmarks.engines.results import Truth, best, errors
from epsmesh.report.figures import STYLE, save
from epsmesh.report.figures.style import COLOURS, MARKERS

_LEAST = 1e-3  # of the errors that are drawn


def draw(found: Mapping[str, Sequence[dict[str, Any]]], truth: Truth, path: Path) -> Path:
    """Draw them: the default's mark is filled, the best's has a ring."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.4), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for (engine, answers), colour, marker in zip(found.items(), COLOURS[1:], MARKERS, strict=False):
            good = [answer for answer in answers if "failed" not in answer]
            if not good:
                continue
            chosen = best(answers, truth)
            for answer in good:
                at = answer["step_ms"], 100 * max(abs(errors(answer, truth)[0]), _LEAST)
                is_default = answer is answers[0]
                axes.plot(
                    *at, marker, color=colour, markersize=6, markerfacecolor=colour if is_default else "none",
                    label=f"{engine} {answer['version']}" if is_default else None,
                )  # fmt: skip
                if answer is chosen:
                    axes.plot(*at, "o", color=colour, markersize=13, markerfacecolor="none", markeredgewidth=0.8)
        bar = 100 * truth.middle_bar / truth.middle
        axes.axhspan(100 * _LEAST, bar, color="#d81b60", alpha=0.15, label="this program's bar")
        axes.set(xscale="log", yscale="log", xlabel="processor time of a step (ms)", ylabel="|error of the force| (%)")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.legend(frameon=False, title="filled: default; ring: best")
        return save(figure, path)
