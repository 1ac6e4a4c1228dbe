"""A function of many items in one process beside this one: a new one if it dies or takes too long."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, TypeVar

T = TypeVar("T")
# What stands for the result of an item whose process died, or took too long (`TimeoutError`).
Ended = BrokenProcessPool | TimeoutError


def isolated(
    function: Callable[..., T], items: Iterable[tuple[Any, ...]], limit: float | None = None
) -> Iterator[tuple[tuple[Any, ...], T | Ended]]:
    """Yield each item, and what ``function`` returns for it as arguments; ``limit`` is the most seconds of an item.

    Raises what the function raises.
    """
    pool = None
    try:
        for arguments in items:
            pool = pool or ProcessPoolExecutor(1, mp_context=get_context("spawn"))
            found: T | Ended
            try:
                found = pool.submit(function, *arguments).result(limit)
            except (BrokenProcessPool, TimeoutError) as error:
                _end(pool)
                pool, found = None, error
            yield arguments, found
    finally:
        if pool is not None:
            _end(pool)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the process, which would outlive this one while it is busy (public from Python 3.14 on: `kill_workers`)."""
    for process in list((pool._processes or {}).values()):
        process.kill()
    pool.shutdown()
