"""What campaigns share: the ranks, an end by Ctrl-C, and a line for each result as soon as it exists."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from typing import Any, TypeVar

from pipeline import workflow
from pipeline.workflow import world

__all__ = ["each", "ended_soon", "finite", "world"]

T = TypeVar("T")
_INTERRUPTED = 130


@contextmanager
def ended_soon() -> Iterator[None]:
    """End with status 130, on all ranks, if the program is asked to end."""
    workflow.load_solvers()
    try:
        with workflow.abort_on_exception(world()), workflow.ended_soon():
            yield
    except KeyboardInterrupt:
        workflow.end_ranks(world(), _INTERRUPTED)
        sys.exit(_INTERRUPTED)


def each(items: Iterable[T], words: Callable[[T], str] | None) -> Iterator[T]:
    """Yield ``items``, each with its line printed at once, if there are ``words`` for it."""
    for item in items:
        if words is not None:
            print(words(item), flush=True)
        yield item


def finite(value: Any) -> Any:
    """Return plain data with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
