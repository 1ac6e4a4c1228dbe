"""Style of all figures: colours, sizes, legend, notes, files."""

import textwrap
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from epsmesh.files import atomic

WIDTH, LEGEND = 7.1, 1.9  # inches: the width of a page's text, and of the legend beside the panels
# From dark to light, distinguishable for the colour-blind and in grey; markers differ as well.
COLOURS = ("#00204d", "#1f5fa8", "#2a9d8f", "#b87d00", "#b0413e", "#9030f0", "#480000")
MARKERS = "osD^vPX"
CLAIM, FAILED, QUIET, LINE, GRID, PAPER = "#d81b60", "#c62828", "#555555", "#000000", "#dddddd", "#ffffff"
SIZE = 9.0  # points
STEPS = [1, 2, 5, 10]  # of ticks: 2.5 takes one more digit
# Letters of SIZE in an inch of a line, and in a line of the legend.
_LETTERS, _LEGEND_LETTERS = 13, 24
_DECADES = {"x": 1.4, "y": 2.2}  # from here on a logarithmic axis writes powers of ten alone
_MARGIN = 1.3  # of a logarithmic axis, below its least number
_NARROW = 3.0  # below this ratio of its ends, even steps
# What is of the program that draws, not of a figure: what matplotlib's own styles leave alone.
_NO_STYLE = {
    "backend", "backend_fallback", "date.epoch", "docstring.hardcopy", "figure.max_open_warning",
    "figure.raise_window", "interactive", "savefig.directory", "timezone", "tk.window_focus", "toolbar",
    "webagg.address", "webagg.open_in_browser", "webagg.port", "webagg.port_retries",
}  # fmt: skip
# A matplotlibrc, of the user or of the current folder, changes nothing: the same dataset gives the same file.
DEFAULTS = {name: value for name, value in mpl.rcParamsDefault.items() if name not in _NO_STYLE}
STYLE = DEFAULTS | {
    "font.size": SIZE,
    "axes.titlesize": SIZE,
    "legend.fontsize": SIZE,
    "svg.fonttype": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.4,
    "grid.color": GRID,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "svg.hashsalt": "epsmesh",
}


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, whose parts make room for each other."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def look(position: int) -> dict[str, str]:
    """Return colour and marker of the curve at ``position``; markers are open where colours come again."""
    style = {"color": COLOURS[position % len(COLOURS)], "marker": MARKERS[position % len(MARKERS)]}
    return style if position < len(COLOURS) else style | {"markerfacecolor": PAPER}


def finish(figure: Figure, title: str, caption: str = "", warning: str = "", *, legend: bool = True) -> None:
    """Add the title, a legend beside the panels, and the caption below them; with a warning it is red.

    The caption is the figure's label as well, for a page, which writes it itself.
    """
    letters = int(_LETTERS * figure.get_figwidth())
    if title:
        figure.suptitle(textwrap.fill(title, int(0.9 * letters)), fontsize=SIZE + 1, fontweight="bold")
    parts = [text for text in (caption, warning) if text]
    figure.set_label(" ".join(parts))
    if lines := [textwrap.fill(text, letters) for text in parts]:
        colour = FAILED if warning else QUIET
        figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize=SIZE, color=colour)
    if legend:
        write_legend(figure)
    figure.align_ylabels()


def add_note(figure: Figure, note: str, warning: str = "") -> None:
    """Add a sentence to the caption, which stays red with a warning."""
    figure.set_label(f"{figure.get_label()} {note}".strip())
    words = textwrap.fill(str(figure.get_label()), int(_LETTERS * figure.get_figwidth()))
    figure.supxlabel(words, x=0.01, ha="left", fontsize=SIZE, color=FAILED if warning else QUIET)


def write_legend(figure: Figure) -> None:
    """Name the curves of all panels, to the right of the upper right one."""
    known = [ax.get_legend_handles_labels() for ax in figure.axes]
    entries = {
        label: handle for handles, labels in reversed(known) for handle, label in zip(handles, labels, strict=True)
    }
    if len(entries) < 2:
        return
    names = list(dict.fromkeys(label for _, labels in known for label in labels))
    first = figure.axes[0].get_subplotspec()
    last = first.get_gridspec().ncols - 1 if first else 0
    beside = next(ax for ax in figure.axes if not first or ax.get_subplotspec().colspan.start == last)
    beside.legend(
        [entries[name] for name in names],
        [textwrap.fill(name, _LEGEND_LETTERS) for name in names],
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        borderaxespad=0.0,
        frameon=False,
    )


def write_above(ax: Axes, title: str, letters: int, columns: int) -> Legend:
    """Name the curves of a panel above it, and return the legend."""
    handles, texts = ax.get_legend_handles_labels()
    return ax.legend(
        handles,
        [textwrap.fill(text, letters) for text in texts],
        title=title,
        title_fontsize="medium",
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01),
        borderaxespad=0.0,
        ncol=columns,
        frameon=False,
    )


def log_scale(ax: Axes, which: str = "y") -> None:
    """Make an axis logarithmic, with round numbers written as people write them; not one without a positive number."""
    together = getattr(ax, f"get_shared_{which}_axes")().get_siblings(ax)
    least = min(getattr(one, f"{which}axis").get_minpos() for one in together)
    if not np.isfinite(least):
        return
    getattr(ax, f"set_{which}scale")("log")
    axis: Axis = getattr(ax, f"{which}axis")
    low, high = sorted(axis.get_view_interval())
    if low <= 0:  # a margin of the linear axis
        low = least / _MARGIN
        getattr(ax, f"set_{which}lim")(low, high)
    if high < _NARROW * low:
        axis.set_major_locator(MaxNLocator(3 if which == "x" else 6))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(_written))
        return
    subs = (1.0,) if high > 10 ** _DECADES[which] * low else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=subs, numticks=5 if which == "x" else 10))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(_written))


def _written(value: float, _position: int | None = None) -> str:
    return f"{value:,.12g}"


def save(figure: Figure, path: Path) -> Path:
    """Write ``figure`` to ``path``, in place of an earlier one only once it is whole."""
    # Without a date the same dataset gives the same file.
    metadata: dict[str, str | None] = {"Date": None} if path.suffix == ".svg" else {}
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=200, metadata=metadata)
    return path
