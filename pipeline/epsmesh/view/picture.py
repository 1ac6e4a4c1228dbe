"""Pictures of one case: its mesh cut open, and the body as the probe deforms it, whole and close to the probe."""

from math import inf
from pathlib import Path
from textwrap import shorten

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from epsmesh.report.figures.style import DEFAULTS, save
from epsmesh.view.drawing import MM, Colouring, Drawing
from epsmesh.view.fields import Fields
from epsmesh.view.numbers import unit_of_length
from epsmesh.view.palette import FOOTPRINT, HELD, INK, TOOL, region_colours

# Inches, at 200 dots each: 1200 × 720 pixels.
_WIDTH, _HEIGHT = 6.0, 3.6
_DOTS = 200
# Panels as shares of the figure: left, bottom, width, height.
_WHOLE, _CLOSE = (0.01, 0.19, 0.60, 0.70), (0.63, 0.19, 0.36, 0.70)
_BAR = (0.1, 0.115, 0.4, 0.03)
_STYLE = DEFAULTS | {"font.size": 8, "axes.linewidth": 0.6}
# Names of regions side by side.
_COLUMNS = 4
# Letters of a title that fit the width.
_LONGEST = 92


def draw_mesh(fields: Fields, path: Path, title: str) -> Path:
    """Draw the mesh, cut open through the contact, coloured by region or, if there is one, by element size."""
    sizes, names = MM * fields.sizes, fields.region_names
    if fields.regions is None:
        colouring = Colouring(sizes, "viridis", (float(sizes.min()), float(sizes.max())), logarithmic=True)
    else:
        colouring = Colouring(fields.regions, region_colours(len(names)), (-0.5, len(names) - 0.5), names=names)
    words = f"{len(fields.cells):,} elements" + (", fine everywhere" if fields.epsilon == inf else "")
    return _compose(fields, Drawing(fields, colouring), colouring, "element size, mm", (title, words), path)


def draw_deformed(fields: Fields, path: Path, title: str) -> tuple[Path, float]:
    """Draw the deformed body, coloured by displacement; return the file, and the factor that makes it visible.

    Raises:
        ValueError: if the fields hold no displacement.
    """
    factor = fields.drawn_factor
    moved = fields.magnitude
    largest = float(moved.max())
    unit, scale = unit_of_length(largest)
    colouring = Colouring(scale * moved, "YlGnBu", (0.0, scale * largest))
    words = "true to scale" if factor == 1 else f"displacement drawn {factor:,.0f} × as large"
    body = Drawing(fields, colouring, factor)
    return _compose(fields, body, colouring, f"displacement, {unit}", (title, words), path), factor


def _compose(
    fields: Fields, body: Drawing, colouring: Colouring, quantity: str, words: tuple[str, str], path: Path
) -> Path:
    """Put the two views, the scale of colours and the words together."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, _HEIGHT))
        FigureCanvasAgg(figure)
        for place, close in ((_WHOLE, False), (_CLOSE, True)):
            size = round(place[2] * _WIDTH * _DOTS), round(place[3] * _HEIGHT * _DOTS)
            axes = figure.add_axes(place)
            axes.imshow(body.render(size, close=close), aspect="auto", interpolation="none")
            axes.set(xticks=[], yticks=[])
            axes.spines[:].set_visible(close)
            axes.spines[:].set_color("#777777")
        _add_names(figure, colouring) if colouring.names else _add_scale(figure, colouring, quantity)
        figure.legend(
            handles=_lines(fields),
            loc="lower right",
            bbox_to_anchor=(0.99, 0.02),
            frameon=False,
            ncols=2,
            handlelength=1.5,
        )
        figure.text(0.012, 0.965, shorten(words[0], _LONGEST, placeholder=" …"), fontweight="bold", va="center")
        figure.text(0.012, 0.915, words[1], va="center")
        figure.text(0.99, 0.915, "close to the probe", ha="right", va="center")
        return save(figure, path)


def _add_names(figure: Figure, colouring: Colouring) -> None:
    patches = [Patch(color=c, label=n) for c, n in zip(colouring.cmap, colouring.names, strict=True)]
    figure.legend(
        handles=patches,
        loc="lower left",
        bbox_to_anchor=(0.01, 0.02),
        frameon=False,
        ncols=_COLUMNS,
        handlelength=1.2,
        columnspacing=1.2,
    )


def _add_scale(figure: Figure, colouring: Colouring, quantity: str) -> None:
    norm = (LogNorm if colouring.logarithmic else Normalize)(*colouring.limits)
    bar = figure.colorbar(
        ScalarMappable(norm, colouring.cmap), cax=figure.add_axes(_BAR), orientation="horizontal", label=quantity
    )
    if colouring.logarithmic:
        bar.ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        bar.ax.xaxis.set_major_formatter("{x:g}")
        bar.ax.xaxis.set_minor_formatter(NullFormatter())


def _lines(fields: Fields) -> list[Artist]:
    edge = "edge of the probe" if fields.case.probe.is_flat else "where contact may be"
    lines: list[Artist] = [
        Line2D([], [], color=FOOTPRINT, linewidth=1.6, label=edge),
        Patch(color=TOOL, alpha=0.5, label="probe"),
        Patch(color=HELD, alpha=0.6, label="fixed"),
    ]
    if fields.epsilon < inf:
        lines.insert(0, Line2D([], [], color=INK, linewidth=1.6, label=f"ε = {MM * fields.epsilon:g} mm"))
    return lines
