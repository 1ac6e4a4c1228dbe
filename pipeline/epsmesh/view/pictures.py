"""Pictures of an insertion: the section along the tool and, of a needle, the one across it; in mm, true to scale.

Intact tissue, and the slits of a blade, are drawn as they are solved. Of a round needle in its crack only the plane
section across it is solved: along it, the shaft is drawn in tissue that is not deformed, with the crack at its sides. A
ring crack contains a column of compressed tissue, from a flat end to the crack's front.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from epsmesh.arrays import FloatArray
from epsmesh.insertion.steps import WITHDRAWAL
from epsmesh.report.figures.style import COLOURS, LINE, QUIET, STEPS
from epsmesh.run.problem import law_of, meridian_problem
from epsmesh.shapes.insertion import Needle
from epsmesh.shapes.probes.blade import Blade
from epsmesh.solve.meridian.large_contact import LargeMeridianContact
from epsmesh.solve.plane import crack, hole
from epsmesh.study.case import Case
from epsmesh.view.fields import Fields
from epsmesh.view.frames import Frame, frames_of
from epsmesh.view.palette import TOOL
from epsmesh.view.section import SCALE, Section, section_of

_MM = 1e3
# Inches: the widths of the two panels.
_ALONG, _ACROSS = 4.5, 3.6
# What is seen along the tool, in last depths: to each side, below the surface, and above it.
_SIDE, _BELOW, _ABOVE = 0.75, 1.2, 0.25
# Before the puncture, the last depth is that of the puncture, but so many half widths of the tool at least.
_NEAR = 3.5
# What is seen across the needle to each side, in radii or half lengths of the crack.
_BESIDE = 2.2
_BOTH, _ALL = ((1, 1), (-1, 1)), ((1, 1), (-1, 1), (1, -1), (-1, -1))
_TISSUE, _COLUMN = "#eef6d5", "#c3d98a"
_POINTS = 60
# The front of a ring crack is deeper than the tip, by more than rounding.
_RING = 1 + 1e-6
# Opacity of the crack round the needle, and where it has closed.
_OPEN, _CLOSED = 0.3, 0.12


@dataclass(frozen=True, eq=False)
class Pictures:
    """What is drawn of the ``path`` of one case beside its force, and the sections that are solved for it.

    ``pressed`` are those of intact tissue by the depth of the ``tool`` (m); between two, the displacement is in
    proportion to the depth. ``slits`` are those of a blade by the depth of its tip. ``across`` is the section across a
    needle, None if it never cuts, in a crack of ``half`` this length (m), or of this radius if it is a ring.
    """

    path: xr.Dataset
    tool: Blade | Needle
    pressed: Mapping[float, Section]
    slits: Mapping[float, Section] = field(default_factory=dict)
    across: Section | None = None
    half: float = 0.0

    @classmethod
    def of_blade(
        cls,
        path: xr.Dataset,
        blade: Blade,
        states: Iterable[tuple[float, Case]],
        solved: Callable[[Case], Fields | None],
    ) -> "Pictures":
        """Return those of a blade, whose ``states`` by the depth of the tip are ``solved``: 0 is the intact body with
        the blade at its last depth. Collective; on ranks other than the first they have no sections.
        """
        sections = {}
        pierced, deepest = float(path["puncture_depth"].min()), float(path["depth"][-1])
        # A blade that is pulled out passes all slits. Without a puncture there are none.
        first = 0.0 if "stroke" in path.dims and pierced > 0 else pierced
        for depth, case in states:
            if depth and not first <= depth <= deepest:
                continue
            if (fields := solved(case)) is not None:
                sections[depth] = section_of(fields)
        pressed = {blade.depth: sections.pop(0.0)} if sections else {}
        return cls(path, blade, pressed, sections)

    @classmethod
    def of_needle(cls, path: xr.Dataset, needle: Needle, case: Case) -> "Pictures":
        """Solve what is drawn of a needle, on this process alone.

        Raises:
            CaseFailure, SolveError: if it cannot be solved.
        """
        depths = sorted({frame.depth for frame in frames_of(path) if frame.is_whole})
        intact = replace(case, probe=needle.pressed_to(depths[-1] if depths else needle.limit))
        problem, law = meridian_problem(intact), law_of(intact)
        assert isinstance(problem, LargeMeridianContact)
        solved = problem.sections(law, depths)
        pressed = {depth: Section.mirrored(*each, _BOTH) for depth, each in zip(depths, solved, strict=False)}
        if not np.isfinite(path["puncture_depth"].min()):
            return cls(path, needle, pressed)
        half = half_of_crack(path, needle)
        across = section_across(case, needle, half, is_ring=reach_of(path) > _RING)
        return cls(path, needle, pressed, across=across, half=half)

    @cached_property
    def widths(self) -> tuple[float, ...]:
        """Widths of the panels (inches)."""
        return (_ALONG, _ACROSS) if isinstance(self.tool, Needle) else (_ALONG,)

    @cached_property
    def _reach(self) -> float:
        return reach_of(self.path) if isinstance(self.tool, Needle) else 1.0

    @cached_property
    def _radius(self) -> float:
        """Half the width of the tool (m)."""
        return self.tool.limit if isinstance(self.tool, Needle) else self.tool.width / 2

    @cached_property
    def _last(self) -> float:
        return float(self.path["depth"][-1])

    @cached_property
    def _largest(self) -> float:
        """The largest displacement (m)."""
        pressed = (frame.depth for frame in frames_of(self.path) if frame.is_whole)
        return max([*pressed, *(float(section.size.max()) for section in self.slits.values())], default=0.0)

    @property
    def colours(self) -> tuple[ScalarMappable, ...]:
        """What the colours of each section mean (mm), in all frames."""
        largest = self._largest, *([float(self.across.size.max())] if self.across else [])
        return tuple(ScalarMappable(Normalize(0, _MM * one), SCALE) for one in largest)

    def draw(self, panels: Sequence[Axes], frame: Frame) -> None:
        """Draw a frame into cleared panels."""
        ax, *across = panels
        self._draw_tissue(ax, frame)
        ax.fill(*_MM * self._outline(frame.depth), color=TOOL, zorder=3)
        last, pierced = self._reach * self._last, float(self.path["puncture_depth"].min())
        if frame.is_whole:
            last = max(_NEAR * self._radius, pierced if np.isfinite(pierced) else last)
        is_cut = bool(across) and not frame.is_whole and self._reach <= _RING
        ax.set(
            aspect="equal",
            xlabel="along the crack, mm" if is_cut else "across the tool, mm",
            ylabel="height, mm",
            title=f"{frame.phase}, {_MM * frame.depth:.3g} mm",
            xlim=np.multiply(_MM * last, (-_SIDE, _SIDE)),
            ylim=np.multiply(_MM * last, (-_BELOW, _ABOVE)),
        )
        for panel in across:
            self._draw_across(panel, is_whole=frame.is_whole)
        for panel in panels:
            panel.locator_params(steps=STEPS)

    def _draw_tissue(self, ax: Axes, frame: Frame) -> None:
        """Draw the nearest state that is solved: of the intact body, or of the slit; or the crack round a needle."""
        if frame.is_whole:
            depth = min(self.pressed, key=lambda one: abs(one - frame.depth))
            self.pressed[depth].draw(ax, frame.depth / depth, self._largest)
        elif isinstance(self.tool, Needle):
            self._draw_crack(ax, frame)
        else:
            # A blade that indents a layer is drawn in the slit with which it arrived there, if that was solved.
            arrived = [depth for depth in self.slits if frame.crack < frame.depth and depth < frame.crack]
            depth = min(arrived or self.slits, key=lambda one: abs(one - frame.depth))
            self.slits[depth].draw(ax, 1.0, self._largest)
            if frame.crack > frame.depth:
                ax.plot([0, 0], [-_MM * frame.depth, -_MM * frame.crack], color=COLOURS[4], linewidth=1.0, zorder=2)

    def _draw_crack(self, ax: Axes, frame: Frame) -> None:
        """Draw tissue that is not deformed, and the crack in its plane, which closes below a tip that returns.

        A ring crack goes round the shaft, and round the column ahead of it.
        """
        wide, half, tip = 2 * _MM * self._reach * self._last, _MM * self.half, -_MM * frame.depth
        ax.fill([-wide, wide, wide, -wide], [-wide, -wide, 0, 0], color=_TISSUE)
        ax.plot([-wide, wide], [0, 0], color=LINE, linewidth=0.6)
        ax.axhline(tip / 2, color=QUIET, linewidth=0.8, linestyle="--", zorder=4)
        if self._reach > _RING:
            radius, front = _MM * self._radius, -_MM * frame.crack
            ax.fill([-radius, radius, radius, -radius], [front, front, tip, tip], color=_COLUMN)
            for side in (-radius, radius):
                ax.plot([side, side], [front, 0], color=COLOURS[4])
            return
        deepest = -_MM * self._last if frame.phase == WITHDRAWAL else tip
        for end, opacity in ((tip, _OPEN), (deepest, _CLOSED)):
            ax.fill([-half, half, half, -half], [end, end, 0, 0], color=COLOURS[4], alpha=opacity, linewidth=0)

    def _draw_across(self, ax: Axes, *, is_whole: bool) -> None:
        """Draw the section across the needle at its middle."""
        ax.set_aspect("equal")
        if is_whole or self.across is None:
            ax.set_axis_off()
            ax.text(0.5, 0.5, "not cut yet", ha="center", transform=ax.transAxes, color=QUIET)
            return
        self.across.draw(ax, 1.0, float(self.across.size.max()))
        angles, radius = np.linspace(0.0, 2 * np.pi, _POINTS), _MM * self._radius
        ax.fill(radius * np.cos(angles), radius * np.sin(angles), color=TOOL, zorder=3)
        side = _BESIDE * max(radius, _MM * self.half)
        ax.set(xlim=(-side, side), ylim=(-side, side), title="across, deep in tissue")
        ax.set_xlabel("across the tool, mm" if self._reach > _RING else "along the crack, mm")

    def _outline(self, depth: float) -> FloatArray:
        """Return the outline (2, n) in m of the tool with its tip at a ``depth`` (m)."""
        heights = (self.tool.tip_heights if isinstance(self.tool, Needle) else np.zeros(2)) - depth
        top = 2 * self._reach * self._last
        right = np.array([[*self._radius * np.linspace(0.0, 1.0, len(heights)), self._radius], [*heights, top]])
        return np.column_stack([right * np.array([[-1.0], [1.0]]), right[:, ::-1]])


def reach_of(path: xr.Dataset) -> float:
    """Return how many times as deep as a needle's tip the front is while it cuts: more than once for a ring crack."""
    into = path.isel(stroke=0) if "stroke" in path.dims else path
    return max(1.0, float((into["crack_depth"] / into["depth"]).max()))


def half_of_crack(path: xr.Dataset, needle: Needle) -> float:
    """Return half the length (m) of the crack round the shaft, or a ring's radius, by the force that cuts it."""
    assert needle.toughness is not None
    force, reach = float(np.nanmax(path["force_cutting"].values)) / needle.toughness, reach_of(path)
    return force / (2 * np.pi * reach) if reach > _RING else force / 2


def section_across(case: Case, needle: Needle, half: float, *, is_ring: bool = False) -> Section:
    """Solve the section across a needle, in a crack of ``half`` this length (m), or of this radius.

    Raises:
        SolveError: if it cannot be solved.
    """
    places, moved = (hole if is_ring else crack).section(law_of(case), needle.limit / half)
    return Section.mirrored(half * places, half * moved, _ALL)
