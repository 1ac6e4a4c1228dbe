"""Where the time of a run goes: seconds by stage, each stage without those within it.

A stage within another one is called "outer / inner". Costs a microsecond a stage; nothing is switched off. What a case
reports, :class:`Times`, is summed from the stages that are passed while it is recorded.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields

seconds: dict[str, float] = {}
_since = [time.perf_counter()]
_names: list[str] = []
_REST = "else"


@dataclass
class Times:
    """Seconds of a case; what is needed for the error bar, assembly and set-up included, is ``error``."""

    mesh: float = 0.0
    assemble: float = 0.0
    setup: float = 0.0
    solve: float = 0.0
    error: float = 0.0

    def add(self, kind: str, spent: float) -> None:
        """Add the seconds ``spent``."""
        setattr(self, kind, getattr(self, kind) + spent)

    @property
    def total(self) -> float:
        """Seconds without the error bar."""
        return self.mesh + self.assemble + self.setup + self.solve


# The kind of time that a stage counts as, where it is the innermost of these; within an error bar all is that.
KINDS = {
    "meshing": "mesh",
    "assembly": "assemble",
    "set-up": "setup",
    "solve": "solve",
    "error bar": "error",
}
_recordings: list[Times] = []


def _charge() -> None:
    """Put the time since the last change of stage to the account of the present one."""
    now = time.perf_counter()
    spent, _since[0] = now - _since[0], now
    name = " / ".join(_names) or _REST
    seconds[name] = seconds.get(name, 0.0) + spent
    if kind := _kind():
        for times in _recordings:
            times.add(kind, spent)


def _kind() -> str:
    kinds = [KINDS[name] for name in _names if name in KINDS]
    return "error" if "error" in kinds else kinds[-1] if kinds else ""


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Charge the time of a block, or of the function that this decorates, to ``name``."""
    _charge()
    _names.append(name)
    try:
        yield
    finally:
        _charge()
        _names.pop()


@contextmanager
def recorded() -> Iterator[Times]:
    """Record the times of a block."""
    _charge()
    times = Times()
    _recordings.append(times)
    try:
        yield times
    finally:
        _charge()
        _recordings.pop()


def recharge(times: Times) -> None:
    """Add ``times`` of earlier work that is used again to what is recorded now: a case reports what it costs alone."""
    for field in fields(times):
        kind = "error" if _kind() == "error" else field.name
        for recording in _recordings:
            recording.add(kind, getattr(times, field.name))


def table() -> list[tuple[str, float, float]]:
    """Return stage, seconds and share of the total of every stage, the longest first, of this process so far."""
    _charge()
    total = sum(seconds.values())
    return [(name, spent, spent / total) for name, spent in sorted(seconds.items(), key=lambda item: -item[1])]
