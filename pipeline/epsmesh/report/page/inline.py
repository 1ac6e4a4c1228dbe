"""A figure as SVG inside a page: colours that follow the page's theme, names that no other figure has."""

import re
from io import StringIO
from pathlib import Path

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
_COLOUR = re.compile("|".join(_THEME))


def inline_svg(figure: Figure, name: str) -> tuple[Markup, int]:
    """Return ``figure`` as an ``<svg>`` element, and its width (CSS pixels); ``name`` goes before every name in it.

    Its caption is left to the page. It is never shown smaller than it is drawn: letters would be.
    """
    figure.supxlabel("")
    with mpl.rc_context(STYLE):
        buffer = StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
    head, rest = text.split(">", 1)
    points = float(re.findall(r'width="([\d.]+)pt"', head)[0])
    width = round(points * 4 / 3)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    head = f'{head} style="max-width: {1.3 * width:.0f}px; min-width: {width:.0f}px" aria-hidden="true"'
    return Markup(f"{head}>{_COLOUR.sub(lambda found: _THEME[found[0]], rest)}".strip()), width
