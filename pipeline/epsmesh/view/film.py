"""A film of an insertion: its pictures over depth, true to scale, beside F."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from PIL import Image

from epsmesh.arrays import IntArray
from epsmesh.files import atomic
from epsmesh.report.figures.insertion import with_puncture
from epsmesh.report.figures.style import COLOURS, DEFAULTS, GRID, LINE, PAPER, STEPS
from epsmesh.view.frames import frames_of
from epsmesh.view.palette import TOOL
from epsmesh.view.pictures import Pictures
from epsmesh.view.section import SCALE

_MM = 1e3
# Height and dots per inch, and frames per second; the last frame stays for so many.
_HEIGHT, _DOTS, _RATE, _LAST = 3.9, 90, 6, 8
# Colours of a film, taken from so many pictures, and the number of the one that leaves what is there.
_COLOURS, _SHEET, _SAME = 128, 8, 255
# Colours that are not lost, though few points have them: in one of so many lines of the sheet.
_KEPT, _EVERY = (PAPER, LINE, COLOURS[4], TOOL, *mpl.colormaps[SCALE](np.linspace(0.0, 1.0, 32))), 6
# Inches: the width of the force.
_FORCE = 3.6


def write_film(pictures: Pictures, file: Path, title: str) -> Path:
    """Write the film of the path of one case as a GIF, and return the file."""
    path = pictures.path
    frames, seen = list(frames_of(path)), list[IntArray]()
    with mpl.rc_context(DEFAULTS | {"font.size": 8}), atomic(file) as temporary:
        widths = (*pictures.widths, _FORCE)
        figure = Figure(figsize=(sum(widths), _HEIGHT))
        canvas = FigureCanvasAgg(figure)
        figure.set_dpi(_DOTS)
        *panels, right = figure.subplots(1, len(widths), width_ratios=widths)
        figure.suptitle(title, fontsize=9)
        _draw_force(right, path)
        (dot,) = right.plot([], [], "o", color=COLOURS[4], zorder=5)
        for frame in (frames[-1], *frames):
            for panel in panels:
                panel.clear()
            pictures.draw(panels, frame)
            if not seen:
                for panel, colours in zip(panels, pictures.colours, strict=False):
                    figure.colorbar(colours, ax=panel, label="displacement, mm", shrink=0.8)
                figure.tight_layout()
            dot.set_data([_MM * frame.depth], [_MM * frame.force])
            canvas.draw()
            seen.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
        _save(seen[1:], temporary)
    return file


def _save(pictures: Sequence[IntArray], file: Path) -> None:
    """Write pictures (height, width, 3) in the same few colours, each as what differs from the one before."""
    sheet = np.concatenate(pictures[:: max(len(pictures) // _SHEET, 1)])
    sheet[::_EVERY, :] = to_rgba_array(list(_KEPT))[np.arange(sheet.shape[1]) % len(_KEPT), :3] * 255
    colours = Image.fromarray(sheet).quantize(_COLOURS)
    found, before = [], np.full(pictures[0].shape[:2], -1)
    for picture in pictures:
        now = np.asarray(Image.fromarray(picture).quantize(palette=colours, dither=Image.Dither.NONE), dtype=np.int64)
        frame = Image.fromarray(np.where(now == before, _SAME, now).astype(np.uint8))
        frame.putpalette(colours.getpalette())
        found.append(frame)
        before = now
    seconds = [1 / _RATE] * (len(found) - 1) + [_LAST / _RATE]
    first, *others = found
    first.save(
        file,
        save_all=True,
        append_images=others,
        duration=[round(1e3 * each) for each in seconds],
        loop=0,
        transparency=_SAME,
        disposal=1,
        optimize=False,
    )


def _draw_force(ax: Axes, path: xr.Dataset) -> None:
    into = path.isel(stroke=0) if "stroke" in path.dims else path
    ax.plot(_MM * with_puncture(into, "depth"), _MM * with_puncture(into, "force"), color=LINE)
    if "stroke" in path.dims:
        back = path.isel(stroke=1)
        ax.plot(_MM * back["depth"], _MM * back["force"], color=COLOURS[4])
    ax.axhline(0, color=LINE, linewidth=0.6)
    ax.grid(color=GRID)
    ax.locator_params(steps=STEPS)
    ax.set(xlabel="depth of the tip, mm", ylabel="reaction force F, mN")
