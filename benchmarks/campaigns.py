"""Helpers of campaigns: an end by Ctrl-C, a printed line for each result, and data for JSON."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from typing import Any, TypeVar

from mpi4py import MPI

from epsmesh import workflow

T = TypeVar("T")
_INTERRUPTED = 130


@contextmanager
def ended_soon() -> Iterator[None]:
    """End with status 130, on all ranks, if the program is interrupted."""
    workflow.load_solvers()
    try:
        with workflow.abort_on_exception(MPI.COMM_WORLD), workflow.ended_soon():
            yield
    except KeyboardInterrupt:
        workflow.end_ranks(MPI.COMM_WORLD, _INTERRUPTED)
        sys.exit(_INTERRUPTED)


def each(items: Iterable[T], words: Callable[[T], str] | None) -> Iterator[T]:
    """Yield ``items``; with ``words``, print a line for each at once."""
    for item in items:
        if words is not None:
            print(words(item), flush=True)
        yield item


def finite(value: Any) -> Any:
    """Return plain data with None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
