"""Error against time, one panel for each scene."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from benchmarks.peers.results import TARGETS, Run
from benchmarks.peers.tasks import TASKS
from epsmesh.report.figures import STYLE, save
from epsmesh.report.pareto import front

_LOOKS = {
    "this program": ("#d81b60", "-", "*"),
    "this program, meridian": ("#2a9d8f", "-", "D"),
    "NGSolve": ("#1f5fa8", "-", "o"),
    "scikit-fem": ("#c98a00", "-", "s"),
    "CalculiX": ("#7b4fa3", "-", "^"),
}
# Panels in a row, at most.
_COLUMNS = 4


def draw(runs: Sequence[Run], path: Path) -> Path:
    """Draw the runs on one thread: all as marks, the best of each program connected."""
    names = list(dict.fromkeys(run.scene for run in runs))
    with mpl.rc_context(STYLE):
        columns = min(len(names), _COLUMNS)
        rows = -(-len(names) // columns)
        height = 2.9 * rows + 0.4
        figure = Figure(figsize=(2.6 * columns + 2.1 * (columns == 1), height), layout="constrained")
        figure.get_layout_engine().set(rect=(0, 0.4 / height, 1, 1 - 0.4 / height))
        FigureCanvasAgg(figure)
        panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for axes in panels.flat[len(names) :]:
            axes.remove()
        for axes, name in zip(panels.flat, names, strict=False):
            _panel(axes, [run for run in runs if run.scene == name and run.threads == 1])
            axes.set_title(f"{TASKS[name].title}, ν = {TASKS[name].poisson:g}", fontsize=8)
            axes.set_xlabel("time from geometry to F (s)")
        for axes in panels[:, 0]:
            axes.set_ylabel("|true error of F| (%)")
        known = {
            label: h
            for axes in panels.flat[: len(names)]
            for h, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(known.values(), known.keys(), loc="lower center", ncol=len(known))
        return save(figure, path)


def _panel(axes: Axes, runs: Sequence[Run]) -> None:
    for target in TARGETS:
        axes.axhline(100 * target, color="#bbbbbb", linewidth=0.6, zorder=0)
    for label, (colour, line, marker) in _LOOKS.items():
        mine = [run for run in runs if _label(run) == label]
        if mine:
            axes.plot(*_points(mine), marker, color=colour, markersize=3, alpha=0.45)
            best = front(*_points(mine))
            axes.plot(*_points([mine[i] for i in best]), line, color=colour, marker=marker, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    # A LogLocator would label every minor tick of less than a decade.
    axes.xaxis.set_major_locator(FixedLocator([digit * 10.0**power for power in range(-3, 4) for digit in (1, 2, 5)]))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _points(runs: Sequence[Run]) -> tuple[list[float], list[float]]:
    return [run.seconds for run in runs], [100 * abs(run.error) for run in runs]


def _label(run: Run) -> str:
    if run.program != "program":
        return run.program
    return "this program, meridian" if run.setting.get("model") == "auto" else "this program"
