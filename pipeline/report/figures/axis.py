"""The axes of a figure: where values stand, which of them are written out."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pipeline.report.figures.text import fits, shortened, width_of, wrapped
from pipeline.report.words import heading, is_numeric, lengths, number, scale

_SIZE = 8.0  # points: what is written at an axis
_GAP = 0.06  # inches between two texts
_WORD_LINES, _SLANTED = 3, 24  # of words: lines; letters where they are slanted
# Values that span more than this are shown on a logarithmic axis.
_LONG = 30.0


@dataclass(frozen=True)
class Horizontal:
    """A horizontal axis: positions of the values (in the units people read), their texts, and the heading."""

    positions: np.ndarray
    texts: tuple[str, ...]
    heading: str
    is_log: bool = False
    joins: bool = True  # whether a line may join its points: numbers yes, words no

    def finish(self, ax: Axes, width: float, *, last: bool = True) -> None:
        """Write as many values as fit ``width`` inches, the largest first; each has a tick."""
        x = self._even(self.positions)
        span = float(np.ptp(x)) or 1.0
        if self.is_log:
            ax.set_xscale("log")
        texts = self.texts if self.joins else self._in_lines(width)
        chosen = self._chosen(x, span, width, texts)
        slanted = not chosen
        chosen = chosen or list(range(len(x)))
        ticks = [float(self.positions[i]) for i in chosen]
        if slanted:
            texts = tuple(shortened(texts, _SLANTED))
        labels = [texts[i] for i in chosen] if last else [""] * len(chosen)
        turned = {"rotation": 30, "ha": "right", "rotation_mode": "anchor"} if slanted and last else {}
        ax.set_xticks(ticks, labels, **turned)
        ax.set_xticks([x for i, x in enumerate(self.positions) if i not in chosen], [], minor=True)
        margin = 0.05 * span if self.joins else 0.5
        low, high = x.min() - margin, x.max() + margin
        ax.set_xlim(*((10**low, 10**high) if self.is_log else (low, high)))
        if last:
            ax.set_xlabel(wrapped(self.heading, width + 0.3, _SIZE))

    def _even(self, x: np.ndarray) -> np.ndarray:
        return np.log10(x) if self.is_log else x

    def _in_lines(self, width: float) -> tuple[str, ...]:
        """Return words in lines, where that makes room for all of them side by side."""
        room = width / len(self.texts) - _GAP
        lines = tuple(wrapped(text, room, _SIZE) for text in self.texts)
        is_good = all(fits(text, room, _SIZE) for text in self.texts)
        return lines if is_good and all(text.count("\n") < _WORD_LINES for text in lines) else self.texts

    def _chosen(self, x: np.ndarray, span: float, width: float, texts: tuple[str, ...]) -> list[int]:
        """Return which values are written, the largest first; none if they are words that do not all fit."""
        reach = 1.1 * span if self.joins else span + 1.0
        chosen: list[int] = []
        for i in np.argsort(-x, kind="stable"):
            room = _GAP + (_widest(texts[i]) + _widest(texts[chosen[-1]])) / 2 if chosen else 0.0
            if not chosen or (x[chosen[-1]] - x[i]) / reach * width > room:
                chosen.append(int(i))
        return chosen if self.joins or len(chosen) == len(texts) else []


def horizontal(coordinate: xr.DataArray) -> Horizontal:
    """Return the axis for a dimension: numbers to scale, with full order a step past the largest, or words in a row."""
    values = coordinate.values
    if not is_numeric(coordinate):
        row = np.arange(len(values), dtype=float)
        head = heading(coordinate)
        written = [lengths(coordinate, str(value)) for value in values]
        if head.endswith(" (mm)") and all(text.endswith(" mm") and (")" in text or "×" in text) for text in written):
            written = [text.removesuffix(" mm") for text in written]
        return Horizontal(row, tuple(written), head, joins=False)
    factor, unit = scale(coordinate)
    finite = values[np.isfinite(values)].astype(float) * factor
    if not finite.size:
        return Horizontal(np.zeros(len(values)), ("full",) * len(values), heading(coordinate))
    is_log = bool(finite.min() > 0 and finite.max() > _LONG * finite.min())
    if is_log:
        past = finite.max() * (finite.max() / finite.min()) ** 0.15
    else:
        past = finite.max() + 0.2 * max(np.ptp(finite), finite.max() / 3)
    positions = np.where(np.isfinite(values), values * factor, past)
    texts = tuple(number(coordinate, value).removesuffix(f" {unit}").replace("-", "−") for value in values)
    return Horizontal(positions, texts, heading(coordinate), is_log)


def log_axis(ax: Axes, low: float, high: float, which: str = "y") -> None:
    """Make an axis logarithmic from ``low`` to ``high``, with round numbers written out."""
    ticks = _round_numbers(low, high, most=8 if which == "y" else 4)
    is_many = max(ticks, default=0.0) >= 1e4
    texts = [f"{tick / 1000:g}k" if is_many and tick >= 1e3 else f"{tick:g}" for tick in ticks]
    if which == "y":
        ax.set_yscale("log")
        ax.set_yticks(ticks, texts)
        ax.set_yticks([], minor=True)
        ax.set_ylim(low, high)
    else:
        ax.set_xscale("log")
        ax.set_xticks(ticks, texts)
        ax.set_xticks([], minor=True)
        ax.set_xlim(low, high)


def _round_numbers(low: float, high: float, most: int) -> list[float]:
    """Return round numbers from ``low`` to ``high``, as many as are allowed."""
    exponents = range(int(np.floor(np.log10(low))) - 1, int(np.ceil(np.log10(high))) + 1)
    ticks: list[float] = []
    denser: list[float] = []
    for steps, stride in (
        ((1, 1.5, 2, 3, 4, 5, 6, 8), 1),
        ((1, 2, 5), 1),
        ((1, 3), 1),
        ((1,), 1),
        ((1,), 2),
        ((1,), 4),
    ):
        ticks = [m * 10.0**e for e in exponents if e % stride == 0 for m in steps]
        ticks = [tick for tick in ticks if low / 1.05 <= tick <= 1.05 * high]
        if len(ticks) <= most:
            break
        denser = ticks
    # Rather every second number of a dense axis than one alone.
    return denser[:: -(-len(denser) // most)] if denser and len(ticks) < 2 else ticks


def bounds(values: np.ndarray, margin: float = 1.25) -> tuple[float, float]:
    """Return limits of a logarithmic axis that holds the positive ones of ``values``, at least half a decade."""
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.1, 1.0)
    if high < 3 * low:
        low, high = low / (3 * low / high) ** 0.5, high * (3 * low / high) ** 0.5
    return low / margin, high * margin


def _widest(text: str) -> float:
    return max(width_of(line, _SIZE) for line in text.splitlines() or [""])
