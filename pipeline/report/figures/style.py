"""What all figures share: colours, sizes, files."""

import re
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.style.core import STYLE_BLACKLIST

from pipeline.files import atomic
from pipeline.report.figures.text import width_of, wrapped

WIDTH, PANEL_HEIGHT = 7.1, 1.75  # inches: the width of a page's text
# From dark to light, told apart by the colour-blind and in grey; markers tell them apart as well.
COLOURS = ("#00204d", "#1f5fa8", "#2a9d8f", "#b87d00", "#b0413e", "#9030f0", "#480000")
MARKERS = "osD^vPX"
CLAIM, FAILED, QUIET, LINE, GRID, PAPER = "#d81b60", "#c62828", "#555555", "#000000", "#dddddd", "#ffffff"
_TITLE, _LEGEND, _NOTE = 9.5, 7.5, 7.0  # points
_TITLE_LINES = 4
# Of an SVG: its tags, and in these a name that matplotlib makes up.
_TAG, _NAME = re.compile(r"<[^<>]*>"), re.compile(r'(?<=["#])[a-zA-Z][0-9a-f]{10}(?=["\)])')
_EDGE, _HANDLE = 0.2, 0.55  # inches: beside a figure's text, and of a legend's entry beside its words
# Whatever a matplotlibrc says, the user's own or one in the folder that one is in: the same dataset, the same file.
DEFAULTS = {name: value for name, value in mpl.rcParamsDefault.items() if name not in STYLE_BLACKLIST}
STYLE = DEFAULTS | {
    "font.size": 8, "axes.titlesize": 8, "legend.fontsize": _LEGEND, "svg.fonttype": "none", "axes.grid": True,
    "grid.linewidth": 0.4, "grid.color": GRID, "lines.linewidth": 1.2, "lines.markersize": 3.5,
    "svg.hashsalt": "epsmesh",
}  # fmt: skip


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
        if path.suffix == ".svg":
            temporary.write_text(_numbered(temporary.read_text(encoding="utf-8")), encoding="utf-8")
    return path


def _numbered(svg: str) -> str:
    """Return ``svg`` with the names of its parts numbered: matplotlib makes them of sizes down to their last digit."""
    numbers: dict[str, str] = {}

    def number(name: re.Match[str]) -> str:
        return numbers.setdefault(name[0], f"{name[0][0]}{len(numbers)}")

    return _TAG.sub(lambda tag: _NAME.sub(number, tag[0]), svg)
