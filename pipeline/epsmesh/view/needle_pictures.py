"""Pictures of a round needle's insertion: along the needle, and across it.

Before the puncture, the body of revolution is cut open, as it is solved. After it, only the plane section across the
needle is solved: along the needle the shaft is drawn in tissue that is not deformed, with the crack at its sides. A
ring crack contains a column of compressed tissue, from a flat end to the crack's front.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from epsmesh.arrays import FloatArray
from epsmesh.insertion.steps import WITHDRAWAL
from epsmesh.report.figures.style import COLOURS, LINE, QUIET
from epsmesh.run.problem import law_of, meridian_problem
from epsmesh.shapes.insertion import Needle
from epsmesh.solve.meridian.large_contact import LargeMeridianContact
from epsmesh.solve.plane import crack, hole
from epsmesh.study.case import Case
from epsmesh.view.film import Frame, frames_of
from epsmesh.view.palette import TOOL
from epsmesh.view.section import Section

_MM = 1e3
# What is seen along the needle, in last depths: to each side, below the surface, and above it.
_SIDE, _BELOW, _ABOVE = 0.7, 1.15, 0.25
# Before the puncture, the last depth is that of the puncture, but so many radii at least.
_NEAR = 3.5
# What is seen across the needle to each side, in radii or half lengths of the crack.
_ACROSS = 2.2
_BOTH, _ALL = ((1, 1), (-1, 1)), ((1, 1), (-1, 1), (1, -1), (-1, -1))
_TISSUE, _COLUMN = "#eef6d5", "#c3d98a"
_POINTS = 60
# The front of a ring crack is deeper than the tip, by more than rounding.
_RING = 1 + 1e-6
# Opacity of the crack round the needle, and where it has closed.
_OPEN, _CLOSED = 0.3, 0.12


class NeedlePictures:
    """Sections of the intact body with the needle, by depth (m), and the section ``across`` it, None if it never cuts.

    ``half`` (m) is half the length of the crack, or its radius if it is a ring.
    """

    widths: tuple[float, ...] = (3.4, 3.0)

    def __init__(
        self, path: xr.Dataset, needle: Needle, along: Mapping[float, Section], across: Section | None, half: float
    ):
        """Find the largest displacements of the ``path`` of one case."""
        self._needle, self._along, self._section, self._half = needle, along, across, half
        self._last, self._pierced = float(path["depth"][-1]), float(path["puncture_depth"].min())
        self._reach = self.reach(path)
        self._depths = np.array(list(along))

    @classmethod
    def of(cls, case: Case, needle: Needle, path: xr.Dataset) -> "NeedlePictures":
        """Solve what is drawn of the ``path`` of a ``case``, on this process alone.

        Raises:
            CaseFailure, SolveError: if it cannot be solved.
        """
        pressed = sorted({frame.depth for frame in frames_of(path) if frame.is_whole})
        intact = replace(case, probe=needle.pressed_to(pressed[-1] if pressed else needle.limit))
        problem, law = meridian_problem(intact), law_of(intact)
        assert isinstance(problem, LargeMeridianContact)
        solved = problem.sections(law, pressed)
        along = {depth: Section.mirrored(*each, _BOTH) for depth, each in zip(pressed, solved, strict=False)}
        if not np.isfinite(path["puncture_depth"].min()):
            return cls(path, needle, along, None, 0.0)
        half = cls.half_length(path, needle)
        across = cls.across(case, needle, half, is_ring=cls.reach(path) > _RING)
        return cls(path, needle, along, across, half)

    @staticmethod
    def reach(path: xr.Dataset) -> float:
        """Return how many times as deep as the tip the front is while it cuts: more than once for a ring crack."""
        into = path.isel(stroke=0) if "stroke" in path.dims else path
        return max(1.0, float((into["crack_depth"] / into["depth"]).max()))

    @classmethod
    def half_length(cls, path: xr.Dataset, needle: Needle) -> float:
        """Return half the length (m) of the crack round the shaft, or a ring's radius, by the force that cuts it."""
        assert needle.toughness is not None
        force, reach = float(np.nanmax(path["force_cutting"].values)) / needle.toughness, cls.reach(path)
        return force / (2 * np.pi * reach) if reach > _RING else force / 2

    @staticmethod
    def across(case: Case, needle: Needle, half: float, *, is_ring: bool = False) -> Section:
        """Solve the section across the needle, in a crack of ``half`` this length (m), or of this radius.

        Raises:
            SolveError: if it cannot be solved.
        """
        places, moved = (hole if is_ring else crack).section(law_of(case), needle.limit / half)
        return Section.mirrored(half * places, half * moved, _ALL)

    def draw(self, panels: Sequence[Axes], frame: Frame) -> None:
        """Draw the section along the needle, and the one across it."""
        along, across = panels
        radius, last = self._needle.limit, self._reach * self._last
        if frame.is_whole:
            last = max(_NEAR * radius, self._pierced if np.isfinite(self._pierced) else last)
            nearest = self._depths[np.argmin(abs(self._depths - frame.depth))]
            self._along[float(nearest)].draw(along, 1.0, float(self._depths.max()))
        else:
            self._draw_crack(along, frame)
        along.fill(*_MM * self._outline(frame.depth), color=TOOL, zorder=3)
        along.set_aspect("equal")
        where = "across (mm)" if frame.is_whole or self._reach > _RING else "along the crack (mm)"
        along.set(xlabel=where, ylabel="height (mm)", title=f"{frame.phase}, {_MM * frame.depth:.3g} mm")
        along.set(xlim=np.multiply(_MM * last, (-_SIDE, _SIDE)), ylim=np.multiply(_MM * last, (-_BELOW, _ABOVE)))
        self._draw_across(across, is_whole=frame.is_whole)

    def _draw_crack(self, ax: Axes, frame: Frame) -> None:
        """Draw tissue that is not deformed, and the crack in its plane, which closes below a tip that returns.

        A ring crack goes round the shaft, and round the column ahead of it.
        """
        low, half, tip = -2 * _MM * self._reach * self._last, _MM * self._half, -_MM * frame.depth
        wide = -low
        ax.fill([-wide, wide, wide, -wide], [low, low, 0, 0], color=_TISSUE)
        ax.plot([-wide, wide], [0, 0], color=LINE, linewidth=0.6)
        if self._reach > _RING:
            radius, front = _MM * self._needle.limit, -_MM * frame.crack
            ax.fill([-radius, radius, radius, -radius], [front, front, tip, tip], color=_COLUMN)
            for side in (-radius, radius):
                ax.plot([side, side], [front, 0], color=COLOURS[4])
            ax.axhline(tip / 2, color=QUIET, linewidth=0.8, linestyle="--", zorder=4)
            return
        deepest = -_MM * self._last if frame.phase == WITHDRAWAL else tip
        for end, opacity in ((tip, _OPEN), (deepest, _CLOSED)):
            ax.fill([-half, half, half, -half], [end, end, 0, 0], color=COLOURS[4], alpha=opacity, linewidth=0)
        ax.axhline(tip / 2, color=QUIET, linewidth=0.8, linestyle="--", zorder=4)

    def _draw_across(self, ax: Axes, *, is_whole: bool) -> None:
        """Draw the section across the needle at its middle."""
        ax.set_aspect("equal")
        if is_whole or self._section is None:
            ax.set_axis_off()
            ax.text(0.5, 0.5, "not cut yet", ha="center", transform=ax.transAxes, color=QUIET)
            return
        radius, half = self._needle.limit, self._half
        self._section.draw(ax, 1.0, float(self._section.size.max()))
        angles = np.linspace(0.0, 2 * np.pi, _POINTS)
        ax.fill(_MM * radius * np.cos(angles), _MM * radius * np.sin(angles), color=TOOL, zorder=3)
        side = _MM * _ACROSS * max(radius, half)
        ax.set(
            xlim=(-side, side),
            ylim=(-side, side),
            xlabel="across (mm)" if self._reach > _RING else "along the crack (mm)",
        )
        ax.set_title("across, deep in tissue")

    def _outline(self, depth: float) -> FloatArray:
        """Return the outline (2, n) in m of the needle with its tip at a ``depth`` (m)."""
        heights = self._needle.tip_heights - depth
        radii = self._needle.limit * np.linspace(0.0, 1.0, len(heights))
        top = np.array([self._needle.limit, 2 * self._reach * self._last])
        right = np.column_stack([np.column_stack([radii, heights]).T, top])
        return np.column_stack([right * np.array([[-1.0], [1.0]]), right[:, ::-1]])
