"""The drawing of body, tool and ε-mesh in the README: ``python docs/draw_symbols.py``."""

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from epsmesh.report.figures import STYLE

PICTURE = Path(__file__).parent / "figures" / "symbols.png"
# In mm: half the body's width, its thickness, ε, the tool's radius.
WIDTH, THICKNESS, EPSILON, RADIUS = 30.0, 20.0, 10.0, 2.0
TISSUE, FINE, TOOL = "#f6d7c3", "#e0936c", "#4a5560"


def body(ax: Axes) -> None:
    """Draw tissue on its support, the fine region, and the tool above them."""
    ax.add_patch(Rectangle((-WIDTH, -THICKNESS), 2 * WIDTH, THICKNESS, facecolor=TISSUE, edgecolor="black", lw=1))
    region = Circle((0, 0), EPSILON, facecolor=FINE, edgecolor="black", lw=0.8, ls="--")
    ax.add_patch(region)
    region.set_clip_path(Rectangle((-WIDTH, -THICKNESS), 2 * WIDTH, THICKNESS, transform=ax.transData))
    for x in np.arange(-WIDTH, WIDTH, 2.0):
        ax.plot([x, x + 1.5], [-THICKNESS - 1.5, -THICKNESS], color="black", lw=0.7)
    ax.add_patch(Rectangle((-RADIUS, 0), 2 * RADIUS, 9, facecolor=TOOL))


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], text: str, at: tuple[float, float]) -> None:
    """Draw an arrow from ``start`` to ``end`` and ``text`` beside it."""
    ax.annotate("", end, start, arrowprops={"arrowstyle": "->", "lw": 1.3})
    ax.text(*at, text, fontsize=10)


def main() -> None:
    """Write the picture."""
    with mpl.rc_context(STYLE):
        drawn, ax = plt.subplots(figsize=(8, 3.6), layout="constrained")
        body(ax)
        arrow(ax, (5.5, 8.5), (5.5, 2.5), "depth d", (6.3, 5))
        arrow(ax, (-5.5, 2.5), (-5.5, 8.5), "reaction F", (-14.6, 5))
        ax.text(0, 10, "tool (probe)", ha="center", fontsize=10)
        angle = np.deg2rad(-50)
        arrow(ax, (0, 0), (EPSILON * np.cos(angle), EPSILON * np.sin(angle)), "ε", (3.9, -3.6))
        ax.text(0, -7.6, "fine mesh", ha="center", fontsize=10)
        ax.text(21, -8, "beyond ε:\ncoarse · free · fixed", ha="center", fontsize=10)
        ax.text(-21, -8, "tissue: E, ν", ha="center", fontsize=10)
        ax.text(0, -24.5, "support (displacement zero)", ha="center", fontsize=10)
        ax.set(xlim=(-WIDTH - 1, WIDTH + 1), ylim=(-26, 13), aspect="equal")
        ax.set_axis_off()
        drawn.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
