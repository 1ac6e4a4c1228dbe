"""A figure as SVG inside a page: colours that follow the page's theme, names that no other figure has."""

import re
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

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
# Inches: narrower figures are drawn so wide that they fill the page beside what is said of them.
_LEAST = 8.0
_COLOUR = re.compile("|".join(_THEME))


def in_page(figure: Figure, name: str) -> dict[str, Any]:
    """Return ``figure`` for a page: an ``<svg>`` element, its width (CSS pixels) and caption; ``name`` is its kind.

    It is never shown smaller than it is drawn: letters would be. ``name`` goes before every name in it.
    """
    caption = figure.get_label()
    figure.supxlabel("")
    with mpl.rc_context(STYLE):
        figure.set_figwidth(max(figure.get_figwidth(), _LEAST))
        buffer = StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
    head, rest = text.split(">", 1)
    width = round(float(re.findall(r'width="([\d.]+)pt"', head)[0]) * 4 / 3)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    svg = f'{head} style="min-width: {width}px" aria-hidden="true">{_COLOUR.sub(lambda found: _THEME[found[0]], rest)}'
    return {"kind": name, "caption": caption, "svg": Markup(svg.strip()), "width": width}
