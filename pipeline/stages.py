"""Where the time of a run goes: seconds by stage, each stage without those within it.

A stage within another one is called "outer / inner". Costs a microsecond a stage; nothing is switched off.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

seconds: dict[str, float] = {}
_since = [time.perf_counter()]
_names: list[str] = []
_REST = "else"


def _charge() -> None:
    """Put the time since the last change of stage to the account of the present one."""
    now = time.perf_counter()
    name = " / ".join(_names) or _REST
    seconds[name] = seconds.get(name, 0.0) + now - _since[0]
    _since[0] = now


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


def table() -> list[tuple[str, float, float]]:
    """Return stage, seconds and share of the total of every stage, the longest first, of this process so far."""
    _charge()
    total = sum(seconds.values())
    return [(name, spent, spent / total) for name, spent in sorted(seconds.items(), key=lambda item: -item[1])]
