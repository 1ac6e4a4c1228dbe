"""A film of an insertion: the deformed section over depth, true to scale, beside F."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pipeline.files import atomic
from pipeline.insertion.steps import PHASES
from pipeline.report.figures.insertion import with_puncture
from pipeline.report.figures.style import COLOURS, DEFAULTS, GRID, LINE
from pipeline.report.values import punctures
from pipeline.shapes.probes.blade import Blade
from pipeline.view.palette import TOOL
from pipeline.view.section import Section

_MM = 1e3
# Inches and dots, and frames per second; the last frame stays for so many.
_SIZE, _DOTS, _RATE, _LAST = (8.0, 3.9), 90, 6, 8
# What is seen of the section, in last depths: to each side, below the surface, and above it.
_SIDE, _BELOW, _ABOVE = 0.8, 1.3, 0.3


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


def write_film(path: xr.Dataset, blade: Blade, sections: Mapping[float, Section], file: Path, title: str) -> Path:
    """Write the film of one case as a GIF, and return the file.

    ``sections`` has the solved slits by the depth of the tip (m), and the intact body at 0, with the ``blade`` at its
    last depth, to which the displacement is proportional. At the puncture the nearest slit is shown.
    """
    frames, last = list(frames_of(path)), float(path["depth"][-1])
    pressed = max((frame.depth for frame in frames if frame.is_whole), default=0.0)
    largest = _MM * max(pressed, *(float(section.size.max()) for depth, section in sections.items() if depth > 0), 0.0)
    solved = np.array([depth for depth in sections if depth > 0])
    with mpl.rc_context(DEFAULTS | {"font.size": 8}), atomic(file) as temporary:
        figure = Figure(figsize=_SIZE)
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1))
        figure.suptitle(title, fontsize=9)
        _draw_force(right, path)
        (dot,) = right.plot([], [], "o", color=COLOURS[4], zorder=5)
        figure.tight_layout()
        writer = PillowWriter(fps=_RATE)
        writer.setup(figure, str(temporary), dpi=_DOTS)
        for frame in [*frames, *[frames[-1]] * _LAST]:
            intact = frame.is_whole
            # A blade that indents a layer is drawn in the slit with which it arrived there.
            key = 0.0 if intact else float(solved[np.argmin(abs(solved - min(frame.depth, frame.crack)))])
            share = frame.depth / blade.depth if intact else 1.0  # the path may end above the blade's last depth
            _draw_section(left, sections[key], frame, blade, share=share, largest=largest)
            left.set(xlim=np.multiply(_MM * last, (-_SIDE, _SIDE)), ylim=np.multiply(_MM * last, (-_BELOW, _ABOVE)))
            dot.set_data([_MM * frame.depth], [_MM * frame.force])
            writer.grab_frame()
        writer.finish()
    return file


def _draw_force(ax: Axes, path: xr.Dataset) -> None:
    into = path.isel(stroke=0) if "stroke" in path.dims else path
    ax.plot(_MM * with_puncture(into, "depth"), _MM * with_puncture(into, "force"), color=LINE)
    if "stroke" in path.dims:
        back = path.isel(stroke=1)
        ax.plot(_MM * back["depth"], _MM * back["force"], color=COLOURS[4])
    ax.axhline(0, color=LINE, linewidth=0.6)
    ax.grid(color=GRID)
    ax.set(xlabel="depth of the tip (mm)", ylabel="force (mN)")


def _draw_section(ax: Axes, section: Section, frame: Frame, blade: Blade, *, share: float, largest: float) -> None:
    ax.clear()
    colours = _MM * share * section.size.mean(axis=1)
    body = PolyCollection(_MM * section.at(share), array=colours, cmap="YlGnBu", edgecolors=LINE, linewidths=0.08)
    body.set_clim(0, largest)
    ax.add_collection(body)
    half, tip, top = _MM * blade.width / 2, -_MM * frame.depth, _MM
    ax.fill([-half, half, half, -half], [tip, tip, top, top], color=TOOL, zorder=3)
    if frame.crack > frame.depth:
        ax.plot([0, 0], [tip, -_MM * frame.crack], color=COLOURS[4], linewidth=1.0, zorder=2)
    ax.set_aspect("equal")
    ax.set(xlabel="across the blade (mm)", ylabel="height (mm)", title=f"{frame.phase}, {_MM * frame.depth:.3g} mm")
