"""A figure as SVG inside a page: colours that follow the page's theme, names that no other figure has."""

import itertools
import re
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from epsmesh.report.figures.style import CLAIM, COLOURS, FAILED, GRID, LINE, PAPER, QUIET, STYLE

# Styles of every report.
PAGE_CSS = Path(__file__).parent / "templates" / "page.css"
# The page's variable for each colour: what is dark on paper must be light on a dark screen.
_THEME = {colour: f"var(--curve-{i})" for i, colour in enumerate(COLOURS, start=1)} | {
    CLAIM: "var(--claim)",
    FAILED: "var(--bad)",
    QUIET: "var(--quiet)",
    GRID: "var(--grid)",
    LINE: "currentColor",
    PAPER: "var(--paper)",
}
# Inches: figures of several columns are drawn so wide at least that they fill the page beside what is said of them; one
# column alone is so narrow that its letters are legible on a phone.
_LEAST, _ALONE = 7.8, 4.8
_POINTS, _PIXELS = 72, 4 / 3  # in an inch; of CSS in a point
_MARGIN = 2.0  # points left of a column
_COLOUR = re.compile("|".join(_THEME))


def in_page(figure: Figure, name: str) -> dict[str, Any]:
    """Return ``figure`` for a page: ``<svg>`` elements, their width (CSS pixels) and caption; ``name`` is its kind.

    There is one for each column of panels, and one for a legend beside them: side by side they are the figure, and on a
    narrow screen they are one below the other. None is shown much smaller than it is drawn: letters would be. ``name``
    goes before every name in it.
    """
    caption = figure.get_label()
    figure.supxlabel("")
    with mpl.rc_context(STYLE):
        figure.set_dpi(_POINTS)  # as in the file: places and cuts are then the same
        figure.set_figwidth(_width(figure))
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        cuts, key = _cuts(figure)
        buffer = StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", buffer.getvalue(), flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text[text.index("<svg") :])
    content = text[text.index(">") + 1 : text.rindex("</svg>")].strip()
    # Styles of the page do not reach what is shown again of it.
    content = _COLOUR.sub(lambda found: _THEME[found[0]], content).replace("<text ", '<text fill="currentColor" ')
    content = f'<g id="{name}-whole">{content}</g>'
    width, height = figure.bbox.size
    parts = []
    for left, right in itertools.pairwise([0.0, *cuts, width]):
        is_key = bool(key) and right == width
        pixels, high = (right - left) * _PIXELS, key if is_key else height
        size = f"--width: {pixels:.1f}px; flex-grow: {pixels:.0f}"
        box = f"{left:.2f} 0 {right - left:.2f} {high:.2f}"
        of_key = ' class="key"' if is_key else ""
        parts.append(f'<svg{of_key} viewBox="{box}" style="{size}" aria-hidden="true">{content}</svg>')
        content = f'<use href="#{name}-whole"/>'
    return {"kind": name, "caption": caption, "svg": Markup("".join(parts)), "width": round(width * _PIXELS)}


def _width(figure: Figure) -> float:
    """Return how wide (inches) a figure is to be in a page; one column alone is drawn, to see what is beside it."""
    width, columns = figure.get_figwidth(), _columns(figure)
    if columns != 1:
        return max(width, _LEAST) if columns else width
    figure.draw_without_rendering()
    cuts, _ = _cuts(figure)
    return width + _ALONE - min([*cuts, _POINTS * width]) / _POINTS


def _columns(figure: Figure) -> int:
    """Return how many columns of panels a figure has; 0 if its rows have columns of their own."""
    places = [place for place in map(_place, figure.axes) if place]
    is_one = len({id(place.get_gridspec()) for place in places}) == 1
    return len({place.colspan.start for place in places}) if is_one else 0


def _place(ax: Axes) -> SubplotSpec | None:
    """Return the place of axes among the others: scales of colours have none, and of some versions not the question."""
    return ax.get_subplotspec() if hasattr(ax, "get_subplotspec") else None


def _cuts(figure: Figure) -> tuple[list[float], float]:
    """Return where (pt) a figure may be cut: left of columns, and of a legend beside them.

    A legend ends so far (pt) below the top; 0 without one.
    """
    if not _columns(figure):
        return [], 0.0
    drawn = figure.canvas.get_renderer()
    lefts, key = dict[float, float](), 0.0
    for ax in figure.axes:
        found = {place.colspan.start: ax.yaxis.get_tightbbox(drawn).x0} if (place := _place(ax)) else {}
        if (legend := ax.get_legend()) and (box := legend.get_window_extent(drawn)).x0 > ax.bbox.x1:
            found[inf], key = box.x0, figure.bbox.height - box.y0 + _MARGIN
        lefts |= {number: min(left, lefts.get(number, left)) for number, left in found.items()}
    return [left - _MARGIN for column, left in sorted(lefts.items()) if column], key
