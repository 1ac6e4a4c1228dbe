"""What all figures share: colours, sizes, files."""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.files import atomic
from pipeline.report.figures.text import width_of, wrapped

WIDTH, PANEL_HEIGHT = 7.1, 1.75  # inches: the width of a page's text
# From dark to light, told apart by the colour-blind and in grey; markers tell them apart as well.
COLOURS = ("#00204d", "#1f5fa8", "#2a9d8f", "#b87d00", "#b0413e", "#9030f0", "#480000")
MARKERS = "osD^vPX"
CLAIM, FAILED, QUIET, LINE, GRID, PAPER = "#d81b60", "#c62828", "#555555", "#000000", "#dddddd", "#ffffff"
_TITLE, _LEGEND, _NOTE = 9.5, 7.5, 7.0  # points
_TITLE_LINES = 4
_EDGE, _HANDLE = 0.2, 0.55  # inches: beside a figure's text, and of a legend's entry beside its words
STYLE = {"font.size": 8, "axes.titlesize": 8, "legend.fontsize": _LEGEND, "svg.fonttype": "none", "axes.grid": True,
          "grid.linewidth": 0.4, "grid.color": GRID, "lines.linewidth": 1.2, "lines.markersize": 3.5,
          "svg.hashsalt": "epsmesh"}  # fmt: skip


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, whose parts make room for each other."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def look(position: int) -> dict[str, str]:
    """Return colour and marker of the curve at ``position``."""
    return {"color": COLOURS[position % len(COLOURS)], "marker": MARKERS[position % len(MARKERS)]}


def finish(figure: Figure, title: str, note: str = "", warning: str = "", *, legend: bool = True) -> None:
    """Add title, legend, and the notes below: what is shown of a large study, and what is missing."""
    if title:
        words = wrapped(title, figure.get_figwidth() - _EDGE, _TITLE, bold=True, most=_TITLE_LINES)
        figure.suptitle(words, fontsize=_TITLE, fontweight="bold")
    lines, bottom = [], 0.0
    for text, colour in ((note, QUIET), (warning, FAILED)):
        for line in reversed(wrapped(text, figure.get_figwidth() - _EDGE, _NOTE).splitlines()):
            lines.append((line, colour))
    for line, colour in lines:
        figure.text(0.01, (0.04 + bottom) / figure.get_figheight(), line, fontsize=_NOTE, color=colour, va="bottom")
        bottom += 0.14
    entries: dict[str, Any] = {}
    for ax in figure.axes if legend else ():
        handles, labels = ax.get_legend_handles_labels()
        entries = dict(zip(labels, handles, strict=True)) | entries
    labels = list(entries)
    if len(labels) > 1:
        room = figure.get_figwidth() - _EDGE
        labels = [wrapped(label, room - _HANDLE, _LEGEND, most=1) for label in labels]
        columns = max(1, min(len(labels), int(room / (_HANDLE + max(width_of(label, _LEGEND) for label in labels)))))
        columns = -(-len(labels) // -(-len(labels) // columns))  # rows as even as can be
        anchor = (0.5, bottom / figure.get_figheight())
        figure.legend(
            list(entries.values()), labels, loc="lower center", ncol=columns, frameon=False, bbox_to_anchor=anchor
        )
        bottom += 0.12 + 0.16 * -(-len(labels) // columns)
    share = (bottom + 0.02) / figure.get_figheight()
    figure.align_ylabels()
    figure.get_layout_engine().set(rect=(0, share, 1, 1 - share))


def save(figure: Figure, path: Path) -> Path:
    """Write ``figure`` to ``path``, in place of an earlier one only once it is whole."""
    with atomic(path) as temporary:
        # Without a date, the same dataset gives the same file.
        figure.savefig(temporary, dpi=200, metadata={"Date": None} if path.suffix == ".svg" else None)
    return path
