"""A film of an insertion: its pictures over depth, true to scale, beside F."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

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
from epsmesh.insertion.steps import PHASES
from epsmesh.report.figures.insertion import with_puncture
from epsmesh.report.figures.style import COLOURS, DEFAULTS, GRID, LINE, PAPER
from epsmesh.report.values import punctures
from epsmesh.view.palette import TOOL
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


@dataclass(frozen=True)
class Frame:
    """One picture: the tip's ``depth`` (m), the phase, the force (N), and the front of the slit (m), NaN without."""

    depth: float
    phase: str
    force: float
    crack: float

    @property
    def is_whole(self) -> bool:
        """Whether the body has no slit."""
        return bool(np.isnan(self.crack))


class Pictures(Protocol):
    """What is drawn of a path beside its force: in panels of so many inches each."""

    widths: tuple[float, ...]

    def draw(self, panels: Sequence[Axes], frame: Frame) -> None:
        """Draw a frame into cleared panels."""
        ...


def frames_of(path: xr.Dataset) -> Iterator[Frame]:
    """Yield the frames of the path of one case, in the order of the motion, with both sides of the puncture."""
    strokes = [path.isel(stroke=number) for number in range(2)] if "stroke" in path.dims else [path]
    pierced = punctures(path)
    for number, stroke in enumerate(strokes):
        known = stroke.isel(depth=np.flatnonzero(np.isfinite(stroke["force"].values)))
        phases = [PHASES[int(phase)] for phase in known["phase"]]
        found = [_frame(known.isel(depth=place), phase) for place, phase in enumerate(phases)]
        if number == 0:
            for place in range(pierced.sizes["puncture"]):
                one = pierced.isel(puncture=place)
                depth, (peak, fall) = float(one["puncture_depth"]), one["force_at_puncture"].values
                fronts = one["crack_depth_at_puncture"].values
                found.append(Frame(depth, "indentation", float(peak), float(fronts[0]) or np.nan))
                found.append(Frame(depth, "puncture", float(fall), float(fronts[1])))
            found.sort(key=lambda one: (one.depth, one.phase != "indentation", one.phase != "puncture"))
        yield from found if number == 0 else found[::-1]


def _frame(step: xr.Dataset, phase: str) -> Frame:
    return Frame(float(step["depth"]), phase, float(step["force"]), float(step["crack_depth"]) or np.nan)


def write_film(path: xr.Dataset, pictures: Pictures, file: Path, title: str) -> Path:
    """Write the film of the path of one case as a GIF, and return the file."""
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
    ax.set(xlabel="depth of the tip (mm)", ylabel="force (mN)")
