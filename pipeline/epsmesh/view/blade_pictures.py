"""Pictures of a blade's insertion: the deformed section across the blade, true to scale."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from epsmesh.report.figures.style import COLOURS
from epsmesh.shapes.probes.blade import Blade
from epsmesh.view.film import Frame, frames_of
from epsmesh.view.palette import TOOL
from epsmesh.view.section import Section

_MM = 1e3
# What is seen of the section, in last depths: to each side, below the surface, and above it.
_SIDE, _BELOW, _ABOVE = 0.8, 1.3, 0.3


class BladePictures:
    """The ``sections`` of solved slits by the depth of the tip (m), and of the intact body at 0.

    The intact body is that with the ``blade`` at its last depth, to which the displacement is proportional. At the
    puncture the nearest slit is shown.
    """

    widths: tuple[float, ...] = (4.4,)

    def __init__(self, path: xr.Dataset, blade: Blade, sections: Mapping[float, Section]):
        """Find the largest displacement of the ``path`` of one case."""
        self._blade, self._sections, self._last = blade, sections, float(path["depth"][-1])
        self._slits = np.array([depth for depth in sections if depth > 0])
        pressed = max((frame.depth for frame in frames_of(path) if frame.is_whole), default=0.0)
        slits = (float(section.size.max()) for depth, section in sections.items() if depth > 0)
        self._largest = max(pressed, *slits, 0.0)

    def draw(self, panels: Sequence[Axes], frame: Frame) -> None:
        """Draw the section."""
        (ax,) = panels
        tip, slits = frame.depth, self._slits
        # A blade that indents a layer is drawn in the slit with which it arrived there, if that was solved.
        above = slits[slits < frame.crack]
        slits = above if frame.crack < tip and len(above) else slits
        key = 0.0 if frame.is_whole else float(slits[np.argmin(abs(slits - tip))])
        # The path may end above the blade's last depth.
        share = frame.depth / self._blade.depth if frame.is_whole else 1.0
        self._sections[key].draw(ax, share, self._largest)
        half, tip, top = _MM * self._blade.width / 2, -_MM * frame.depth, _MM
        ax.fill([-half, half, half, -half], [tip, tip, top, top], color=TOOL, zorder=3)
        if frame.crack > frame.depth:
            ax.plot([0, 0], [tip, -_MM * frame.crack], color=COLOURS[4], linewidth=1.0, zorder=2)
        ax.set(xlabel="across the blade (mm)", ylabel="height (mm)", title=f"{frame.phase}, {_MM * frame.depth:.3g} mm")
        ax.set(
            xlim=np.multiply(_MM * self._last, (-_SIDE, _SIDE)), ylim=np.multiply(_MM * self._last, (-_BELOW, _ABOVE))
        )
