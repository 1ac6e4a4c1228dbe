"""What a study says of the file of a force curve, and the error of a file that is none."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

Segment = Literal["approach", "hold", "approach+hold", "retract"]
# Columns of a file, and their SI units.
UNITS = {"depth": "m", "force": "N", "time": "s", "piezo": "m", "deflection": "m"}


@dataclass(frozen=True)
class Window:
    """A range of depth (m) or of time (s), by its SI ``unit``."""

    low: float
    high: float
    unit: Literal["m", "s"]


@dataclass(frozen=True)
class Reading:
    """How a file is read; what is not given is found where it is unmistakable.

    ``columns`` has headers or numbers from 1, ``units`` units as text, both by the names in ``UNITS``; ``spring`` (N/m)
    is the stiffness by which a deflection is a force. ``depth_sign`` and ``force_sign`` are 1 or -1. ``window`` is a
    range of the depth as recorded, or of the time since the first row.
    """

    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    spring: float | None = None
    segment: Segment = "approach"
    cycle: int = 1
    window: Window | None = None
    depth_sign: int | None = None
    force_sign: int | None = None


class ExperimentError(Exception):
    """A file that is no force curve, or not the one that was described: file, place, and what to do."""

    def __init__(self, file: str, why: str, *, column: str = "", line: int | None = None):
        self.file, self.why, self.column, self.line = file, why, column, line
        place = [f"line {line}"] if line is not None else []
        place += [f"column `{column}`"] if column else []
        super().__init__(f"{file}: {', '.join(place)}{': ' if place else ''}{why}")

    def __reduce__(self) -> tuple[Callable[..., "ExperimentError"], tuple[str, str]]:
        """Return how it is made again on another rank."""
        return partial(type(self), column=self.column, line=self.line), (self.file, self.why)
